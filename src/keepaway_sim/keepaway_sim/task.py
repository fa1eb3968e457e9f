"""What is played: how many keepers and takers on what field; actions and outcomes by number."""

from __future__ import annotations

import re
from enum import IntEnum

import attrs

from keepaway_sim.errors import KeepawayError
from keepaway_sim.settings import setting

MAX_TEAM_SIZE = 11  # a soccer team; the soccer server knows no larger one
MIN_FIELD_SIDE = 10.0  # [m] below this the kick-off corners (3 m) and the ball's place overlap
MAX_FIELD_SIDE = 100.0  # [m] about the soccer server's pitch; beyond it players see no others
FIELD_SIDES = f"[{MIN_FIELD_SIDE:g}, {MAX_FIELD_SIDE:g}]"


class Action(IntEnum):
    """A high-level action that an agent requests for a player."""

    HOLD_BALL = 0
    PASS_BALL = 1
    GET_OPEN = 2
    GO_TO_BALL = 3
    MARK_KEEPER = 4


class Outcome(IntEnum):
    """Why an episode ended."""

    IN_PLAY = 0
    TAKEN_AWAY = 1
    OUT_OF_BOUNDS = 2
    ABORTED = 3


class Role(IntEnum):
    """A player's team."""

    KEEPER = 0
    TAKER = 1


@attrs.frozen
class Task:
    """Keepaway of `num_keepers` against `num_takers` on a rectangular field.

    Players are counted in match order: keepers 0..n-1, then takers n..n+m-1. The ball is
    object n+m wherever positions of all objects stand in one array.

    Raises:
        KeepawayError: a team or a field on which keepaway makes no sense.
    """

    num_keepers: int = setting(
        3, "keepers; one alone has nobody to pass to", "players", f"[2, {MAX_TEAM_SIZE}]"
    )
    num_takers: int = setting(2, "takers", "players", f"[1, {MAX_TEAM_SIZE}]")
    field_length: float = setting(25.0, "side of the field along x", "m", FIELD_SIDES)
    field_width: float = setting(25.0, "side of the field along y", "m", FIELD_SIDES)

    @classmethod
    def parse(cls, name: str, field: str = "25x25") -> Task:
        """The task called e.g. "3v2" on a field called e.g. "25x25" (metres).

        Raises:
            KeepawayError: a name that is not N"v"M, or a field that is not L"x"W.

        >>> Task.parse("4v3", "30x20").num_players
        7
        """
        teams = re.fullmatch(r"(\d{1,3})v(\d{1,3})", name.strip())
        if not teams:
            raise KeepawayError(f"task={name!r}: write keepers v takers, for example 3v2")
        sides = re.fullmatch(r"(\d+(?:\.\d+)?)x(\d+(?:\.\d+)?)", field.strip())
        if not sides:
            raise KeepawayError(f"field={field!r}: write length x width in metres, like 25x25")
        return cls(int(teams[1]), int(teams[2]), float(sides[1]), float(sides[2]))

    @property
    def name(self) -> str:
        """For example "3v2"."""
        return f"{self.num_keepers}v{self.num_takers}"

    @property
    def field(self) -> str:
        """For example "25x25" (length x width in metres)."""
        return f"{self.field_length:g}x{self.field_width:g}"

    @property
    def num_players(self) -> int:
        """Keepers and takers together."""
        return self.num_keepers + self.num_takers

    @property
    def player_names(self) -> tuple[str, ...]:
        """Names in match order: keeper_1.., taker_1.. ."""
        keepers = (f"keeper_{i + 1}" for i in range(self.num_keepers))
        takers = (f"taker_{i + 1}" for i in range(self.num_takers))
        return (*keepers, *takers)

    def role(self, player: int) -> Role:
        """The team of a player given by its index in match order."""
        return Role.KEEPER if player < self.num_keepers else Role.TAKER
