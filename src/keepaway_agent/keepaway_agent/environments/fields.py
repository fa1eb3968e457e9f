"""Fields of a World on which players' choices are made from outside."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.compiled import Kernel, prepare
from keepaway_agent.environments.compiled_fields import (
    NO_CHOICE,
    Play,
    choose_all,
    observe_keepers,
    observe_takers,
    play,
)
from keepaway_agent.environments.refusals import (
    MAX_FIELDS,
    ClosedError,
    ResetNeededError,
    checked_config,
    checked_number,
    checked_task,
)
from keepaway_agent.environments.snapshots import FieldState, require_kind
from keepaway_agent.environments.spaces import observation_space
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.sarsa import UNIFORMS_PER_CHOICE
from keepaway_agent.playing.policies import TAKER_DECISION_INTERVAL, make_player
from keepaway_agent.training.deciding import Deciders
from keepaway_agent.training.trial import child_seed
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config
from keepaway_sim.world.streams import RandomStreams
from keepaway_sim.world.world import World

OUTSIDE: Final = "outside"
"""The policy of a team whose choices are made from outside."""
RULES: Final = ("random", "hold", "hand")
"""Policies of a team that plays by itself; takers cannot hold."""
LONGEST_WAIT: Final = 100_000
"""Cycles without a choice after which a world is given up."""
_STUCK: Final = f"no player has had a choice for {LONGEST_WAIT} cycles: check config"
_STAND_INS: Final = {Role.KEEPER: "hold", Role.TAKER: "random"}
"""What asks for a choice where a learner would; the choice from outside replaces its own."""


class DecisionFields:
    """Fields of one World on which choices of one team, or of both, are made from outside.

    Attributes:
        task: what is played.
        num_fields: side by side.
        choosing: (num_fields, num_players) bool, players with a choice to make from outside.
        watchers: called after every kick-off and every cycle that was played.
    """

    def __init__(
        self,
        task: str | Task = "3v2",
        num_fields: int = 1,
        *,
        keeper_policy: str = OUTSIDE,
        taker_policy: str = "hand",
        config: Config | None = None,
        ordering: str = "ball",
        decision_interval: int = TAKER_DECISION_INTERVAL,
    ) -> None:
        """Lay out the fields.

        Args:
            task: keepers v takers, on 25 m x 25 m; or a Task.
            num_fields: played side by side.
            keeper_policy: outside, or a rule: random, hold or hand.
            taker_policy: outside, or a rule: random or hand.
            config: of the world.
            ordering: what ranks players in keepers' variables, ball or k1.
            decision_interval: cycles between a taker's choices.

        Raises:
            AgentError, KeepawayError: settings that make no match.
        """
        self._settings = {name: value for name, value in locals().items() if name != "self"}
        self.task = checked_task(task)
        self.num_fields = checked_number("num_fields", num_fields, 1, MAX_FIELDS)
        interval = checked_number("decision_interval", decision_interval, 1, 1000)
        n = self.task.num_keepers
        self._outside = np.zeros(self.task.num_players, dtype=np.bool_)
        self._outside[:n] = keeper_policy == OUTSIDE
        self._outside[n:] = taker_policy == OUTSIDE
        self._keeper = _rule_player(0, n, keeper_policy, ordering, interval)
        self._taker = _rule_player(n, n, taker_policy, "ball", interval)
        config = checked_config(config)
        self._world = World(self.task, config, self.num_fields, is_stepped=False)
        self._is_started, self._is_closed = False, False
        self.watchers: list[Callable[[DecisionFields], None]] = []
        self._high = {role: observation_space(self.task, role).high for role in Role}
        self._state = {role: np.zeros(len(self._high[role])) for role in Role}
        self._lay_arrays()
        self._lay_kernels()

    def _lay_arrays(self) -> None:
        """Make what the compiled functions read and write."""
        shape = (self.num_fields, self.task.num_players)
        self.choosing = np.zeros(shape, dtype=np.bool_)
        self._everywhere = np.ones(self.num_fields, dtype=np.bool_)
        self._nowhere = np.zeros(self.num_fields, dtype=np.bool_)
        self._moving = np.zeros(self.num_fields, dtype=np.bool_)
        self._left = np.zeros(self.num_fields, dtype=np.int64)
        self._uncounted = np.zeros(self.num_fields, dtype=np.int64)
        self._streams = RandomStreams(shape[0] * shape[1], UNIFORMS_PER_CHOICE, block=512)
        self._deciders = self._make_deciders(shape)

    def _lay_kernels(self) -> None:
        """Bring together what the compiled functions work on."""
        self._choose_all = Kernel(choose_all, self._deciders)
        latest = np.array([self._world.streams.latest, self._streams.latest])
        self._play = Kernel(
            play, self._world.fields, self._deciders, self._outside, latest, self.choosing
        )
        self._observe = {
            Role.KEEPER: Kernel(observe_keepers, self._deciders),
            Role.TAKER: Kernel(observe_takers, self._deciders),
        }

    def _make_deciders(self, shape: tuple[int, int]) -> Deciders:
        """The players; those from outside have a stand-in, and none learns."""
        policy = np.full(shape, self._keeper.policy)
        policy[:, self.task.num_keepers :] = self._taker.policy
        return Deciders(
            belief=self._world.belief,
            keepers=self._make_learners(Role.KEEPER),
            takers=self._make_learners(Role.TAKER),
            policy=policy,
            keeper=self._keeper,
            taker=self._taker,
            random=self._streams.draws,
            order=np.zeros(shape[1], dtype=np.int64),
            action=np.zeros(shape, dtype=np.int64),
            target=np.zeros(shape, dtype=np.int64),
            chose=np.zeros(shape, dtype=np.bool_),
        )

    def _make_learners(self, role: Role) -> sarsa.Learners:
        n, m = self.task.num_keepers, self.task.num_takers
        size = n if role == Role.KEEPER else m
        count = self.num_fields * size  # of one table, which is never read or written
        return sarsa.make_learners(count, n, make_tiling(role, n, m), None, count)

    @property
    def is_over(self) -> np.ndarray:
        """(num_fields,) whether the episode has ended; the next cycle kicks off a new one."""
        over: np.ndarray = self._world.belief.outcome != Outcome.IN_PLAY
        return over

    @property
    def outcome(self) -> np.ndarray:
        """(num_fields,) int8, why the episode ended (`Outcome`)."""
        return self._world.belief.outcome

    @property
    def cycle(self) -> np.ndarray:
        """(num_fields,) cycles since kick-off."""
        return self._world.belief.cycle

    @property
    def world(self) -> World:
        """The world, to look at."""
        return self._world

    @property
    def deciders(self) -> Deciders:
        """The players, for compiled functions."""
        return self._deciders

    @property
    def is_started(self) -> bool:
        """Whether there was a first kick-off."""
        return self._is_started

    def require_open(self) -> None:
        """Refuse calls after `close`.

        Raises:
            ClosedError: these fields were closed.
        """
        if self._is_closed:
            raise ClosedError("this environment was closed: make a new one")

    def require_started(self) -> None:
        """Refuse what makes no sense before the first kick-off.

        Raises:
            ResetNeededError, ClosedError: it is too early, or too late.
        """
        self.require_open()
        if not self._is_started:
            raise ResetNeededError("nothing is played yet: call reset first")

    def close(self) -> None:
        """Play no more."""
        self._is_closed = True

    def start(self, field: int, seed: np.random.SeedSequence) -> None:
        """Begin anew on a field, with all random numbers from this seed."""
        self.require_open()
        self._seed_policies(field, seed)
        self._world.seed(field, child_seed(seed, 0))
        self._is_started = True
        self.step(np.arange(self.num_fields) == field)

    def _seed_policies(self, field: int, seed: np.random.SeedSequence) -> None:
        first = field * self.task.num_players
        for player in range(self.task.num_players):
            generator = np.random.default_rng(child_seed(seed, 1, player))
            self._streams.seed(first + player, generator)

    def abort(self, fields: np.ndarray) -> None:
        """End the episodes of (num_fields,) bool `fields`; their next cycle kicks off new ones."""
        self._world.abort(fields & ~self.is_over)
        self.choosing[fields] = False

    def choose(self, choices: np.ndarray) -> None:
        """Make choices: (num_fields, num_players) int64, NO_CHOICE for players who make none.

        A keeper's choice is 0 to hold the ball or k to pass to K(k+1); a taker's 0 to go to the
        ball or k to mark K(k+1).
        """
        self._choose_all(choices)
        self.choosing[choices != NO_CHOICE] = False

    def step(self, moved: np.ndarray) -> None:
        """Play a cycle on the fields of (num_fields,) `moved`; the others wait."""
        self._advance(self._plays(moved, self._nowhere, self._uncounted), 1)

    def play_on(self, moved: np.ndarray, in_play: np.ndarray, cycles: np.ndarray) -> None:
        """Play every field of `moved` to its next choice, each at its own pace.

        Args:
            moved: (num_fields,) bool.
            in_play: (num_fields,) bool, fields on which the end of the episode stops as well;
                the others kick off a new one first.
            cycles: (num_fields,) int64, those that are played are added.

        Raises:
            AgentError: no player gets a choice; with these constants no match can be played.
        """
        plays = self._plays(moved, in_play, cycles)
        most = 1 if self.watchers else LONGEST_WAIT
        rounds = LONGEST_WAIT // most
        while plays.moving.any():
            if rounds == 0:
                raise AgentError(_STUCK)
            rounds -= 1
            self._advance(plays, most)

    def play_until_any(self, in_play: np.ndarray, cycles: np.ndarray) -> None:
        """Play all fields, in step, until there is a choice on one, or the end of an episode.

        Arguments and errors are those of `play_on`.
        """
        plays = self._plays(self._everywhere, in_play, cycles)
        for _ in range(LONGEST_WAIT):
            if self._advance(plays, 1):
                return
            plays.moving.fill(True)
        raise AgentError(_STUCK)

    def _plays(self, moved: np.ndarray, in_play: np.ndarray, cycles: np.ndarray) -> Play:
        """What compiled code goes by; arguments as of `play_on`."""
        self._moving[:] = moved
        return Play(self._moving, in_play, self._left, cycles)

    def _advance(self, plays: Play, most: int) -> int:
        """Play moving fields to their next stop, `most` cycles at most; how many have stopped."""
        plays.left.fill(most)
        num_stopped, touches, is_short = self._play(plays)
        while touches or is_short:
            if touches:
                self._world.bodies.move()
            if is_short:
                self._world.streams.top_up()
                self._streams.top_up()
            newly, touches, is_short = self._play(plays)
            num_stopped += newly
        for watch in self.watchers:
            watch(self)
        return int(num_stopped)

    @property
    def play_call(self) -> tuple[Kernel, tuple[Any, ...]]:
        """What `prepare` compiles to play; for an environment that needs no more of this class."""
        return self._play, (self._plays(self._nowhere, self._nowhere, self._uncounted),)

    def prepare(self) -> None:
        """Compile all that is called here, side by side, so that no call waits."""
        who = np.zeros(self.num_fields, np.int64)
        observing = [
            (kernel, (who, high, state, np.zeros((self.num_fields, len(high)), np.float32)))
            for role, kernel in self._observe.items()
            for high, state in [(self._high[role], self._state[role])]
        ]
        choices = np.full(self.choosing.shape, NO_CHOICE)
        prepare((self._choose_all, (choices,)), self.play_call, *observing)

    def observe(self, role: Role, who: np.ndarray, into: np.ndarray) -> None:
        """Write what one player of every field sees.

        Args:
            role: of these players.
            who: (num_fields,) int64, in match order.
            into: (num_fields, num_variables) float32, written.
        """
        self._observe[role](who, self._high[role], self._state[role], into)

    def get_state(self, field: int) -> FieldState:
        """The whole state of a field now, random numbers included, as a copy.

        Raises:
            ResetNeededError, ClosedError: see `refusals`.
        """
        self.require_started()
        return self._state_of(field)

    def _state_of(self, field: int) -> FieldState:
        return FieldState(
            world=self._world.snapshot(field),
            streams=[self._streams.snapshot(stream) for stream in self._streams_of(field)],
            takers=self._taker_rows(field).copy(),
            requests=np.stack([self._deciders.action[field], self._deciders.target[field]]),
            choosing=self.choosing[field].copy(),
        )

    def set_state(self, field: int, state: FieldState) -> None:
        """Continue from a state, of this field or another of the same task and configuration.

        Raises:
            AgentError, KeepawayError, ClosedError: no such state, or one of another world.
        """
        self.require_open()
        self._world.restore(field, require_kind(state, FieldState).world)
        for stream, snapshot in zip(self._streams_of(field), state.streams, strict=True):
            self._streams.restore(stream, snapshot)
        takers, rows = self._deciders.takers, self._taker_slice(field)
        takers.action[rows], takers.cycle[rows], takers.target[rows] = state.takers
        self._deciders.action[field], self._deciders.target[field] = state.requests
        self.choosing[field] = state.choosing
        self._is_started = True

    def __getstate__(self) -> dict[str, Any]:
        """Settings and states: machine code and discs are made anew where they arrive."""
        fields = range(self.num_fields)
        return {
            "settings": self._settings,
            "states": [self._state_of(field) for field in fields] if self._is_started else [],
            "is_closed": self._is_closed,
            "watchers": self.watchers,
        }

    def __setstate__(self, kept: dict[str, Any]) -> None:
        """Lay the fields out again, and put them where they were."""
        self.__init__(**kept["settings"])  # type: ignore[misc]
        for field, state in enumerate(kept["states"]):
            self.set_state(field, state)
        self._is_closed, self.watchers = kept["is_closed"], kept["watchers"]

    def _streams_of(self, field: int) -> range:
        size = self.task.num_players
        return range(field * size, (field + 1) * size)

    def _taker_slice(self, field: int) -> slice:
        size = self.task.num_takers
        return slice(field * size, (field + 1) * size)

    def _taker_rows(self, field: int) -> np.ndarray:
        takers, rows = self._deciders.takers, self._taker_slice(field)
        return np.stack([takers.action[rows], takers.cycle[rows], takers.target[rows]])


def _rule_player(index: int, num_keepers: int, policy: Any, ordering: Any, interval: int) -> Any:
    """The Player that stands for a team; see `_STAND_INS`."""
    role = Role.KEEPER if index < num_keepers else Role.TAKER
    known = (OUTSIDE, *RULES) if role == Role.KEEPER else (OUTSIDE, "random", "hand")
    if not isinstance(policy, str) or policy not in known:
        raise AgentError(f"{role.name.lower()} policy {policy!r}: choose one of {', '.join(known)}")
    if not isinstance(ordering, str):
        raise AgentError(f"ordering {ordering!r}: choose ball or k1")
    rule = _STAND_INS[role] if policy == OUTSIDE else policy
    return make_player(index, num_keepers, rule, ordering, interval)
