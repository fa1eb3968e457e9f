"""Messages <-> what a player's functions take: only this module knows the messages' fields.

A perception comes, and an answer goes, every cycle: these two are read and written as the bytes
that they are (CDR, little-endian), because making message objects of them takes longer than
deciding. A test holds the layouts against ROS's own. An agent in another language, or one that is
not in a hurry, uses the ordinary messages.
"""

import functools
import math
import struct

import numpy as np

from keepaway_agent.actions import Outcome
from keepaway_agent.errors import AgentError
from keepaway_agent.playing.agent import Decision, MatchFacts, Perceived
from keepaway_agent.playing.policies import View
from keepaway_msgs.msg import Match

HEADER = b"\x00\x01\x00\x00"
"""CDR, little-endian; fields are aligned to their sizes, counted from its end."""
_OUTCOMES = frozenset(Outcome)
_MOST_PADDING = 3
"""Bytes that may follow a message's last field."""


def match_facts(message: Match) -> MatchFacts:
    """What a player must know of a match.

    Raises:
        AgentError: a match in which nobody can play.
    """
    if message.num_keepers < 2 or message.num_takers < 1:
        raise AgentError(f"a match of {message.num_keepers} keepers v {message.num_takers} takers")
    return MatchFacts(
        num_keepers=message.num_keepers,
        num_takers=message.num_takers,
        field_length=message.field_length,
        field_width=message.field_width,
        cycle_time=message.cycle_time,
        seed=message.seed,
        code_version=message.code_version,
        first_episode=message.first_episode,
    )


def read_perception(data: bytes, num_players: int, index: int) -> Perceived:
    """A Perception's bytes, checked to be one that this player can have.

    Raises:
        AgentError: of another player or number of players, not finite, or not a Perception.
    """
    layout, objects = _perception_layout(num_players), num_players + 1
    if not layout.size <= len(data) <= layout.size + _MOST_PADDING:
        raise AgentError(f"{len(data)} bytes: a perception of {num_players} has {layout.size}")
    (
        header, _, _, player, episode, cycle, outcome, is_due, is_kickable, _, _, *arrays
    ) = layout.unpack_from(data)  # fmt: skip
    counts = arrays[0], arrays[2 * objects + 1], arrays[4 * objects + 2], arrays[-num_players - 1]
    if header != HEADER or counts != (2 * objects, 2 * objects, objects, num_players):
        raise AgentError(f"not the perception of one of {num_players} players")
    if player != index or outcome not in _OUTCOMES:
        raise AgentError(f"a perception of player {player} with outcome {outcome}")
    positions = arrays[1 : 2 * objects + 1]
    if not all(map(math.isfinite, positions)):
        raise AgentError(f"positions that are not finite: {positions}")
    ages = arrays[4 * objects + 3 : 5 * objects + 3]
    view = View(
        position=np.array(positions).reshape(objects, 2),
        age=np.array(ages, dtype=np.int32),
        cycles_to_ball=np.array(arrays[-num_players:], dtype=np.int32),
        ball_kickable=is_kickable,
        cycle=cycle,
    )
    return Perceived(episode, outcome, is_due, view)


def write_request(index: int, perceived: Perceived, decision: Decision) -> bytes:
    """The ActionRequest with which a player answers what it perceived, as bytes."""
    values = decision.values.tolist()
    return _request_layout(len(values)).pack(
        HEADER,
        index,
        perceived.episode,
        perceived.view.cycle,
        decision.action,
        decision.target,
        len(values),
        *values,
    )


@functools.cache
def _perception_layout(num_players: int) -> struct.Struct:
    objects = num_players + 1
    moment = "4s iI B3x II B??x"  # header, stamp, player, episode, cycle, outcome, due, kickable
    angles = "dd"
    vectors = f"I4x {2 * objects}d"
    padding = "2x" if objects % 2 else ""
    counts = f"I {objects}H {padding} I {num_players}H"
    return struct.Struct(f"< {moment} {angles} {vectors} {vectors} {counts}")


@functools.cache
def _request_layout(num_values: int) -> struct.Struct:
    values = f"4x {num_values}d" if num_values else ""
    return struct.Struct(f"< 4s B3x II BB2x I {values}")
