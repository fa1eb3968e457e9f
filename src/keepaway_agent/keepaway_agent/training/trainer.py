"""Training in one process: a World of many fields, with learners for every player of each.

A trial is one team's life, from its first episode to a stop rule: its own world, its own learners,
its own random numbers. The trainer plays as many trials side by side as it has fields, and gives a
field that has become free to the next trial. What a trial gives depends on the trial alone: it is
the same to the last bit alone, among a hundred, and in any number of processes; and its players
are those of the ROS nodes, decision for decision.

Random numbers: with the seed sequence S of a trial, the world takes the child (0,) of S, and the
policy of player p the child (1, p). `trial_seed(seed, number)` is S for numbered trials; a match of
ROS nodes is trial 0.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Generator, Iterable, Iterator
from typing import Final

import numpy as np

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.compiled import Kernel, prepare
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.sarsa import UNIFORMS_PER_CHOICE
from keepaway_agent.playing.policies import make_player
from keepaway_agent.training.deciding import Deciders, decide_all
from keepaway_agent.training.trial import (
    Moment,
    Progress,
    RunningTrial,
    TrainerConfig,
    Trial,
    TrialResult,
    child_seed,
)
from keepaway_sim.world.streams import RandomStreams
from keepaway_sim.world.world import World

WATCH_INTERVAL: Final = 200
"""Cycles between two calls of the watcher of a run."""


class Trainer:
    """Plays trials, `num_fields` at a time.

    Attributes:
        config: what is the same for all trials.
        progress: of the current run, or of the last.
    """

    def __init__(self, config: TrainerConfig, num_fields: int = 128) -> None:
        """Lay out the fields and make room for the learners.

        Raises:
            KeepawayError, AgentError: settings with which no player can play.
        """
        task = config.task
        self.config, self.progress = config, Progress()
        self._world = World(task, config.world, num_fields, is_stepped=False)
        self._teams = {role: _Team(config, role, num_fields) for role in Role}
        self._streams = RandomStreams(
            num_fields * task.num_players, reserve=UNIFORMS_PER_CHOICE, block=512
        )
        shape = (num_fields, task.num_players)
        self._deciders = Deciders(
            belief=self._world.belief,
            keepers=self._teams[Role.KEEPER].learners,
            takers=self._teams[Role.TAKER].learners,
            policy=np.zeros(shape, dtype=np.int64),
            keeper=self._teams[Role.KEEPER].player,
            taker=self._teams[Role.TAKER].player,
            random=self._streams.draws,
            order=np.zeros(task.num_players, dtype=np.int64),
            action=np.zeros(shape, dtype=np.int64),
            target=np.zeros(shape, dtype=np.int64),
            chose=np.zeros(shape, dtype=np.bool_),
        )
        self._everywhere = np.ones(num_fields, dtype=np.bool_)
        self._decide_all = Kernel(decide_all, self._deciders)
        prepare(*self._world.calls, (self._decide_all, (self._everywhere,)))
        self._lives: list[RunningTrial | None] = [None] * num_fields
        self._cycles_left = np.zeros(num_fields, dtype=np.int64)  # of the trial, from kick-off
        self._watched: set[int] = set()  # fields whose trial has a `watch`

    def run(
        self,
        trials: Iterable[Trial],
        watch: Callable[[Progress], None] | None = None,
        watch_cycle: Callable[[World], None] | None = None,
    ) -> Generator[TrialResult, None, None]:
        """Play trials, and give each one's result as soon as it is over.

        Args:
            trials: any number; the next is asked for when a field is free.
            watch: is called with the progress every WATCH_INTERVAL cycles.
            watch_cycle: is shown the world before every cycle.

        Raises:
            AgentError: a trial that cannot be played.
        """
        waiting, self.progress = iter(trials), Progress()
        fields = range(self._world.num_fields)
        try:
            for number in fields:
                self._start_next(number, waiting)
            for cycle in itertools.count(1):
                self._decide(self._everywhere)
                ended = self._fields_at_an_end()
                for number in ended:
                    if result := self._end_episode(number):
                        self._start_next(number, waiting)
                        self._decide(np.arange(len(fields)) == number)
                        yield result
                if (ended or cycle == 1) and not self._world.truth.running.any():
                    return
                if watch_cycle:
                    watch_cycle(self._world)
                self._world.step(self._deciders.action, self._deciders.target)
                if watch and cycle % WATCH_INTERVAL == 0:
                    watch(self.progress)
        finally:
            for number in fields:
                self._world.stop(number)

    def _start_next(self, number: int, waiting: Iterator[Trial]) -> None:
        """Give a field to the next trial, and kick off; let it rest if there is none."""
        trial = next(waiting, None)
        self._watched.discard(number)
        if trial is None:
            self._world.stop(number)
            return
        task = self.config.task
        for player in range(task.num_players):
            policy = trial.keeper_policy if player < task.num_keepers else trial.taker_policy
            self._deciders.policy[number, player] = make_player(
                player, task.num_keepers, policy
            ).policy
            generator = np.random.default_rng(child_seed(trial.seed, 1, player))
            self._streams.seed(number * task.num_players + player, generator)
        self._teams[Role.KEEPER].prepare(number, trial.keeper_policy, trial.keeper_weights)
        self._teams[Role.TAKER].prepare(number, trial.taker_policy, trial.taker_weights)
        self._lives[number] = RunningTrial(trial)
        self._cycles_left[number] = trial.stop.max_cycles or _ENDLESS
        self._world.start(number, child_seed(trial.seed, 0))
        if trial.watch:
            self._watched.add(number)

    def _fields_at_an_end(self) -> list[int]:
        """Fields whose episode is over, or whose trial has used up its cycles."""
        belief = self._world.belief
        over = (belief.outcome != _IN_PLAY) | (belief.cycle >= self._cycles_left)
        ended: list[int] = (over & self._world.truth.running).nonzero()[0].tolist()
        return ended

    def _end_episode(self, number: int) -> TrialResult | None:
        """Take note of a field's episode; the trial's result if that was its last."""
        life = self._lives[number]
        assert life is not None
        cycle = int(self._world.belief.cycle[number])
        outcome = int(self._world.belief.outcome[number])
        if outcome != _IN_PLAY:
            life.count(cycle, outcome)
            self.progress.episodes += 1
            self.progress.cycles += cycle
            if len(life.durations) in life.trial.snapshots:
                life.snapshots[len(life.durations)] = self._teams[Role.KEEPER].weights(number)
        self._cycles_left[number] -= cycle
        if not life.is_over() and self._cycles_left[number] > 0:
            return None
        self.progress.trials += 1
        return self._result(number, life)

    def _result(self, number: int, life: RunningTrial) -> TrialResult:
        trial = life.trial
        keepers, takers = self._teams[Role.KEEPER], self._teams[Role.TAKER]
        return TrialResult(
            trial=trial,
            durations=np.array(life.durations, dtype=np.int32),
            outcomes=np.array(life.outcomes, dtype=np.int8),
            reached=life.reached,
            keeper_weights=keepers.weights(number) if trial.keeper_policy in _LEARNED else None,
            taker_weights=takers.weights(number) if trial.taker_policy in _LEARNED else None,
            snapshots=life.snapshots,
        )

    def _decide(self, asked: np.ndarray) -> None:
        """Let players of the (num_fields,) `asked` answer; those whose episode is over are paid."""
        self._streams.refill()
        self._decide_all(asked)
        for number in self._watched:
            if asked[number]:
                self._show(number)

    def _show(self, number: int) -> None:
        """Show a trial's moment."""
        life, deciders, num_keepers = (
            self._lives[number],
            self._deciders,
            self.config.task.num_keepers,
        )
        assert life is not None
        assert life.trial.watch is not None
        chose = deciders.chose[number]
        keepers = self._teams[Role.KEEPER].expected(number, chose[:num_keepers])
        takers = self._teams[Role.TAKER].expected(number, chose[num_keepers:])
        asked = deciders.action[number], deciders.target[number]
        life.trial.watch(Moment(self._world, number, *asked, keepers + takers))


_IN_PLAY: Final = int(Outcome.IN_PLAY)
_ENDLESS: Final = np.iinfo(np.int64).max
_LEARNED: Final = ("learn", "greedy")


class _Team:
    """The learners of one role on all fields.

    Attributes:
        learners: `Learners`, field by field.
        player: the first player of the role, described by its `Player`.
    """

    def __init__(self, config: TrainerConfig, role: Role, num_fields: int) -> None:
        task = config.task
        keeps = role == Role.KEEPER
        self._size = task.num_keepers if keeps else task.num_takers
        self.learners = sarsa.make_learners(
            num_fields * self._size,
            task.num_keepers,
            config.tiling(role),
            config.learner,
            self._size if keeps and config.shared else 1,
        )
        self._has_learners = np.zeros(num_fields, dtype=np.bool_)
        first = 0 if keeps else task.num_keepers
        self.player = make_player(
            first, task.num_keepers, "learn", config.learner.ordering, config.decision_interval
        )

    def prepare(self, number: int, policy: str, weights: np.ndarray | None) -> None:
        """Let the team on a field begin with these weights, or knowing nothing.

        Raises:
            AgentError: weights of another shape.
        """
        rows = self._rows(number)
        for i in rows:
            sarsa.forget(self.learners, i)
        self._has_learners[number] = policy in _LEARNED
        if policy not in _LEARNED:
            return
        shape = (self._size, *sarsa.tiles_of(self.learners, 0).shape)
        given = np.zeros(1) if weights is None else weights
        if weights is not None and weights.shape not in (shape, shape[1:]):
            raise AgentError(f"weights of shape {weights.shape}: the team takes {shape[1:]}")
        for i, own in zip(rows, np.broadcast_to(given, shape), strict=True):
            sarsa.tiles_of(self.learners, i)[:] = own

    def weights(self, number: int) -> np.ndarray:
        """What the team on a field has learned, (num_players, num_actions, ..), a copy."""
        return np.stack([sarsa.tiles_of(self.learners, i) for i in self._rows(number)])

    def expected(self, number: int, chose: np.ndarray) -> list[np.ndarray]:
        """What each player's learner expected of its choices; empty where none has just chosen."""
        values, asked = self.learners.values, chose & self._has_learners[number]
        return [
            values[i].copy() if known else values[i, :0]
            for i, known in zip(self._rows(number), asked, strict=True)
        ]

    def _rows(self, number: int) -> range:
        return range(number * self._size, (number + 1) * self._size)
