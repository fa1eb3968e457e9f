"""A keeper that speaks DDS without ROS: Eclipse Cyclone DDS's Python client, no rclpy, no rmw.

ROS's names are only conventions on top of DDS: topic `rt/keeper_1/perception` has the type
`keepaway_msgs::msg::dds_::Perception_`, whose fields are those of `msgs/msg/Perception.msg` in
order. It goes to the ball and holds it.
"""

import os
import re
import signal
import sys
from dataclasses import dataclass, field

from cyclonedds.core import (
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint8, uint16, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

HOLD_BALL, GET_OPEN, GO_TO_BALL = 0, 2, 3
THIS_MACHINE_ONLY = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface name="lo" multicast="false"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer Address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""
"""What ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST means to ROS's nodes."""
COMMON = (
    Policy.Reliability.Reliable(duration(seconds=1)),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)
QUEUE = Qos(*COMMON, Policy.History.KeepLast(10))
LATCHED = Qos(*COMMON, Policy.History.KeepLast(1), Policy.Durability.TransientLocal)
ANY = ViewState.Any | InstanceState.Any | SampleState.Any


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """As in builtin_interfaces."""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """As in std_msgs."""

    stamp: Time
    frame_id: str


@dataclass
class Match(IdlStruct, typename="keepaway_msgs::msg::dds_::Match_"):
    """As in keepaway_msgs."""

    task: str
    profile: str
    num_keepers: uint8
    num_takers: uint8
    field_length: float64
    field_width: float64
    cycle_time: float64
    visible_angle: float64
    speed: float64
    seed: uint64
    player_names: sequence[str]
    code_version: str
    config_json: str
    first_episode: uint32
    match_id: uint64
    visible_angle_deg: float64


@dataclass
class Perception(IdlStruct, typename="keepaway_msgs::msg::dds_::Perception_"):
    """As in keepaway_msgs."""

    stamp: Time
    player_index: uint8
    episode: uint32
    cycle: uint32
    outcome: uint8
    decision_due: bool
    ball_kickable: bool
    body_yaw: float64
    neck_yaw: float64
    positions: sequence[float64]
    velocities: sequence[float64]
    ages: sequence[uint16]
    cycles_to_ball: sequence[uint16]
    match_id: uint64
    header: Header


@dataclass
class ActionRequest(IdlStruct, typename="keepaway_msgs::msg::dds_::ActionRequest_"):
    """As in keepaway_msgs."""

    player_index: uint8
    episode: uint32
    cycle: uint32
    action: uint8
    target: uint8 = 0
    action_values: sequence[float64] = field(default_factory=list)
    match_id: uint64 = 0


@dataclass
class AgentStatus(IdlStruct, typename="keepaway_msgs::msg::dds_::AgentStatus_"):
    """As in keepaway_msgs."""

    player_index: uint8
    name: str
    policy: str
    learning: bool = False
    ready: bool = True
    episodes: uint32 = 0
    simulated_hours: float64 = 0.0
    code_version: str = ""
    match_id: uint64 = 0


def choose(seen: Perception, index: int) -> int:
    """One of ActionRequest's actions."""
    if seen.ball_kickable:
        return HOLD_BALL
    is_fastest = seen.cycles_to_ball[index] == min(seen.cycles_to_ball)
    return GO_TO_BALL if is_fastest else GET_OPEN


def play(name: str, participant: DomainParticipant) -> None:
    """Answer what is due, for ever."""
    status = DataWriter(participant, Topic(participant, f"rt/{name}/status", AgentStatus), LATCHED)
    requests = DataWriter(
        participant, Topic(participant, f"rt/{name}/action_request", ActionRequest), QUEUE
    )
    matches = DataReader(participant, Topic(participant, "rt/match", Match), LATCHED)
    perceptions = DataReader(
        participant, Topic(participant, f"rt/{name}/perception", Perception), QUEUE
    )
    something = WaitSet(participant)
    for reader in (matches, perceptions):
        something.attach(ReadCondition(reader, ANY))
    index, num_players = 0, 0
    while True:
        something.wait(duration(seconds=1))
        for match in matches.take(1):
            if isinstance(match, Match):
                index, num_players = match.player_names.index(name), len(match.player_names)
                status.write(AgentStatus(index, name, "dds", match_id=match.match_id))
        for seen in perceptions.take(10):
            if not isinstance(seen, Perception) or len(seen.cycles_to_ball) != num_players:
                continue
            if seen.decision_due:
                action = choose(seen, index)
                requests.write(
                    ActionRequest(index, seen.episode, seen.cycle, action, match_id=seen.match_id)
                )


def main() -> None:
    """Play as the player that ROS's arguments name, until SIGINT or SIGTERM."""
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    signal.signal(signal.SIGINT, lambda *_: sys.exit(0))
    named = re.search(r"__node:=(\S+)", " ".join(sys.argv))
    number = int(os.environ.get("ROS_DOMAIN_ID", "0"))
    domain = None
    if os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE") == "LOCALHOST":
        domain = Domain(number, THIS_MACHINE_ONLY)
    play(named[1] if named else "keeper_1", DomainParticipant(number))
    del domain  # it had to live as long as its participant


if __name__ == "__main__":
    main()
