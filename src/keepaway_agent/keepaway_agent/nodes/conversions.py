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
_MATCH_ID = struct.Struct("<Q")
_STAMP_AND_LENGTH = 12  # [bytes] of a header, before its frame's name
_COUNT = struct.Struct("<I")
_MOST_PADDING = 3
"""Bytes that may follow a message's last field."""


def match_facts(message: Match) -> MatchFacts:
    """What a player must know of a match.

    Raises:
        AgentError: a match that cannot be played.
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


def read_perception(data: bytes, num_players: int, index: int, own_match_id: int = 0) -> Perceived:
    """A Perception's bytes, checked to be one that this player can have.

    Raises:
        AgentError: of another match, player or number of players, not finite, or no Perception.
    """
    layout, objects = _perception_layout(num_players), num_players + 1
    size = _size_with_header(data, layout.size)
    if not size <= len(data) <= size + _MOST_PADDING:
        raise AgentError(f"{len(data)} bytes: a perception of {num_players} has {size}")
    (
        header, _, _, player, episode, cycle, outcome, is_due, is_kickable, _, _, *arrays, match_id
    ) = layout.unpack_from(data)  # fmt: skip
    counts = arrays[0], arrays[2 * objects + 1], arrays[4 * objects + 2], arrays[-num_players - 1]
    if header != HEADER or counts != (2 * objects, 2 * objects, objects, num_players):
        raise AgentError(f"not the perception of one of {num_players} players")
    if match_id not in (0, own_match_id):
        raise AgentError(f"a perception of match {match_id}, which is another one")
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


def write_request(index: int, perceived: Perceived, decision: Decision, match_id: int = 0) -> bytes:
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
        match_id,
    )


@functools.cache
def _perception_layout(num_players: int) -> struct.Struct:
    objects = num_players + 1
    moment = "4s iI B3x II B??x"  # header, stamp, player, episode, cycle, outcome, due, kickable
    angles = "dd"
    vectors = f"I4x {2 * objects}d"
    padding = "2x" if objects % 2 else ""
    counts = f"I {objects}H {padding} I {num_players}H"
    text = f"< {moment} {angles} {vectors} {vectors} {counts}"
    unaligned = (struct.calcsize(text) - len(HEADER)) % _MATCH_ID.size
    return struct.Struct(f"{text} {-unaligned % _MATCH_ID.size}x Q")


def _size_with_header(data: bytes, size: int) -> int:
    """The bytes of a message that ends with a std_msgs/Header."""
    end = size + _STAMP_AND_LENGTH
    return end + (_COUNT.unpack_from(data, end - _COUNT.size)[0] if len(data) >= end else 0)


@functools.cache
def _request_layout(num_values: int) -> struct.Struct:
    return struct.Struct(f"< 4s B3x II BB2x I 4x {num_values}d Q")
