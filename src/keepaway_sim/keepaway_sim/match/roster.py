"""Who plays, and whose answers are in: what a simulator knows of players it cannot trust. No ROS.

Players are processes: they come late, die, freeze, come back, and any process may send anything in
their name. A seat is *absent* until its player reports that it is ready, then *present*: its
answers are waited for. One that does not answer for `answer_timeout` is absent again and gets
default actions; when it answers again it is present from the next kick-off on.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Action, Role, Task
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import AGENT_STATUS, Request, read_request
from keepaway_sim.world.config import Config
from keepaway_sim.world.constants import pack
from keepaway_sim.world.cycle import is_legal
from keepaway_sim.world.world import World

MAX_ACTION_VALUES = 64
"""More than any learner chooses from; a longer message is not an answer."""
MOST_OPEN = 1000  # missed answers that may still come; one so late is not looked for
_COUNT = struct.Struct("<I")


@dataclass
class Seat:
    """One player's place in a match.

    `missed` counts due answers that did not come in time, `late` those of them that came after
    their cycle was played, `rejected` messages that no player may send. An answer that comes twice,
    because its perception was sent again, is no trouble.
    """

    name: str
    holder: bytes = b""  # the process that plays it; empty while absent and not returning
    present: bool = False  # is waited for
    returning: bool = False  # absent, but has spoken: present from the next kick-off on
    data: bytes = b""  # this cycle's answer, empty while there is none
    in_force: Request | None = None  # the last request of this episode
    waiting_since: float = math.inf  # [s] when the oldest unanswered perception was sent
    late: int = 0
    missed: int = 0
    rejected: int = 0
    open: dict[tuple[int, int], None] = field(default_factory=dict)  # missed: episode, cycle

    def miss(self, moment: tuple[int, int]) -> None:
        """Count a due answer that did not come in time; of the last ones it is known which."""
        self.missed += 1
        self.open[moment] = None
        if len(self.open) > MOST_OPEN:
            del self.open[next(iter(self.open))]


class Roster:
    """All seats of a match, cycle by cycle: `begin`, then `take` answers, then `requests`.

    Attributes:
        seats: in match order.
        num_awaited: answers that are due from present players and not in yet.
    """

    def __init__(self, task: Task, config: Config, match_id: int = 0) -> None:
        """All players are absent; messages of players of another match are rejected."""
        self.seats = [Seat(name) for name in task.player_names]
        self.num_awaited = 0
        self._task, self._match_id = task, match_id
        self._legal = _legal_requests(task, config)
        self._episode = self._cycle = -1
        self._due = [False] * task.num_players
        self._kickable = [False] * task.num_players
        self._sent = -math.inf

    @property
    def absent(self) -> list[str]:
        """Names of players that are not waited for."""
        return [seat.name for seat in self.seats if not seat.present]

    @property
    def is_deserted(self) -> bool:
        """Is no player present, and none returning?"""
        return not any(seat.present or seat.returning for seat in self.seats)

    def take_seat(self, player: int, sender: bytes = b"") -> None:
        """A player reports that it is ready: before the match it is present, later it returns.

        Args:
            player: its index.
            sender: the process that reports it.

        Raises:
            KeepawayError: another process plays it.
        """
        seat = self.seats[player]
        _check_holder(seat, sender)
        seat.holder = sender
        seat.present = seat.present or self._episode < 0
        seat.returning = not seat.present

    def begin(self, world: World, now: float) -> list[str]:
        """A cycle's perceptions are being sent at wall time `now` [s].

        Returns:
            names of the players who are back.
        """
        seen = world.belief
        self._episode, self._cycle = int(seen.episode[0]), int(seen.cycle[0])
        self._due = seen.decision_due[0].tolist()
        self._kickable = seen.ball_kickable[0].tolist()
        self._sent = now
        back = self._kick_off() if self._cycle == 0 else []
        self.num_awaited = 0
        for seat, due in zip(self.seats, self._due, strict=True):
            seat.data = b""
            if due and seat.present:
                self.num_awaited += 1
                seat.waiting_since = min(seat.waiting_since, now)
        return back

    def take(self, player: int, data: bytes, sender: bytes = b"") -> None:
        """Take an ActionRequest's bytes that came on a player's topic from a process.

        An answer to this cycle's perception is this player's move. A late one is not, but in
        this episode it holds where a later answer does not come in time.

        Raises:
            KeepawayError: it is not a request, not one that this player may make now, or another
                process plays the player; it is counted, and nothing else comes of it.
        """
        seat = self.seats[player]
        try:
            _check_holder(seat, sender)
            request = self._checked(player, data)
        except KeepawayError:
            seat.rejected += 1
            raise
        seat.holder = sender
        seat.returning = not seat.present
        if (request.episode, request.cycle) != (self._episode, self._cycle):
            self._take_late(seat, request)
        elif self._due[player] and not seat.data:
            seat.data, seat.in_force = data, request
            seat.waiting_since = math.inf
            self.num_awaited -= seat.present

    def unanswered(self, since: float = math.inf) -> list[int]:
        """The players whose answers are waited for, from `since` [s] or longer."""
        return [
            player
            for player, seat in enumerate(self.seats)
            if seat.present and self._due[player] and not seat.data and seat.waiting_since <= since
        ]

    def time_out(self, now: float, answer_timeout: float) -> list[str]:
        """Wait no longer for players who have not answered for `answer_timeout` [s].

        Returns:
            their names.
        """
        gone = []
        for player in self.unanswered(now - answer_timeout):
            seat = self.seats[player]
            seat.present, seat.in_force, seat.waiting_since = False, None, math.inf
            self.num_awaited -= 1
            gone.append(seat.name)
        return gone

    def requests(self) -> tuple[np.ndarray, np.ndarray]:
        """What is played this cycle: (1, num_players) actions and targets.

        Where an answer is missing, a present player's last request holds, and an absent one does
        the default: a keeper holds the ball or gets open, a taker goes to the ball.
        """
        action = np.zeros((1, len(self.seats)), dtype=np.int64)
        target = np.zeros_like(action)
        for player, seat in enumerate(self.seats):
            if not self._due[player]:
                continue
            if not seat.data:
                seat.miss((self._episode, self._cycle))
            if seat.in_force is not None and (seat.present or seat.data):
                action[0, player], target[0, player] = seat.in_force.action, seat.in_force.target
            else:
                action[0, player] = self._default(player)
        return action, target

    def answers(self) -> Sequence[tuple[str, bytes]]:
        """This cycle's answers as they came, with the players' names, in match order."""
        return [(seat.name, seat.data) for seat in self.seats if seat.data]

    def _kick_off(self) -> list[str]:
        back = [seat.name for seat in self.seats if seat.returning]
        for seat in self.seats:
            seat.present, seat.returning = seat.present or seat.returning, False
            seat.in_force = None
        return back

    def _checked(self, player: int, data: bytes) -> Request:
        request = checked_request(data)
        if request.match_id not in (0, self._match_id):
            raise KeepawayError(f"a request in match {request.match_id}, which is another one")
        if request.player_index != player:
            raise KeepawayError(f"a request in the name of player {request.player_index}")
        if (request.episode, request.cycle) > (self._episode, self._cycle):
            raise KeepawayError(
                f"answers cycle {request.cycle} of episode {request.episode}, which is yet to come"
            )
        target = min(request.target, self._task.num_players)
        if (player, request.action, target) not in self._legal:
            raise KeepawayError(f"cannot carry out action={request.action} target={request.target}")
        return request

    def _take_late(self, seat: Seat, request: Request) -> None:
        moment = request.episode, request.cycle
        if moment in seat.open:
            seat.late += 1
            del seat.open[moment]
        if not seat.present or request.episode != self._episode:
            return
        known = seat.in_force
        if known is None or request.cycle > known.cycle:
            seat.in_force = request
            seat.waiting_since = self._sent

    def _default(self, player: int) -> Action:
        if self._task.role(player) == Role.TAKER:
            return Action.GO_TO_BALL
        return Action.HOLD_BALL if self._kickable[player] else Action.GET_OPEN


def _check_holder(seat: Seat, sender: bytes) -> None:
    if (seat.present or seat.returning) and sender != seat.holder:
        raise KeepawayError(f"another process plays {seat.name}")


def checked_request(data: bytes) -> Request:
    """The request in an ActionRequest's bytes, all of them checked.

    Raises:
        KeepawayError: bytes that are not a whole, finite ActionRequest.
    """
    if len(data) < 24 or data[:2] != b"\x00\x01":
        raise KeepawayError(f"{len(data)} bytes that are no ActionRequest")
    count = _COUNT.unpack_from(data, 20)[0]
    whole = 36 + 8 * count
    of_before = 28 + 8 * count if count else 24  # matches had no numbers, but agents live long
    if count > MAX_ACTION_VALUES or not (
        whole <= len(data) < whole + 4 or of_before <= len(data) < of_before + 4
    ):
        raise KeepawayError(f"an ActionRequest of {len(data)} bytes with {count} action values")
    if count and not all(map(math.isfinite, struct.unpack_from(f"<{count}d", data, 28))):
        raise KeepawayError("action values that are not finite")
    return read_request(data)


def checked_status(data: bytes, player: int, name: str) -> dict[str, Any]:
    """The fields of an AgentStatus's bytes; those of a ready player are of the named one.

    Raises:
        KeepawayError: bytes that are no AgentStatus, or one of another player.
    """
    status = codec(AGENT_STATUS).decode(data)
    if status["ready"] and (status["player_index"], status["name"]) != (player, name):
        raise KeepawayError(f"the status of {status['name']!r}, player {status['player_index']}")
    return status


def _legal_requests(task: Task, config: Config) -> frozenset[tuple[int, int, int]]:
    """All (player, action, target) that the world carries out; num_players is any target beyond."""
    constants = pack(task, config)
    return frozenset(
        (player, int(action), target)
        for player in range(task.num_players)
        for action in Action
        for target in range(task.num_players + 1)
        if is_legal(constants, player, int(action), target)
    )
