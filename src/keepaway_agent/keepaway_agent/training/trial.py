"""One team's training from its first episode to a stop rule: its settings and its result."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import attrs
import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.cmac import Tiling, make_tiling
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.weights import HOURS_PER_CYCLE
from keepaway_agent.playing.agent import AgentConfig
from keepaway_agent.settings import group, same, setting
from keepaway_sim.task import Task
from keepaway_sim.world.config import CYCLE_TIME, Config
from keepaway_sim.world.world import World


@attrs.frozen
class TrainerConfig:
    """What is the same for all trials of a trainer.

    Raises:
        AgentError: a value outside its range.
    """

    task: Task = attrs.field(factory=Task)
    world: Config = group(Config)
    learner: LearnerConfig = group(LearnerConfig)
    decision_interval: int = same(AgentConfig, "decision_interval")
    shared: bool = setting(False, "all keepers of a trial learn one value function")

    def tiling(self, role: Role) -> Tiling:
        """The tiling of a role's state variables."""
        task = self.task
        return make_tiling(
            role,
            task.num_keepers,
            task.num_takers,
            task.field_length,
            task.field_width,
            self.learner.tile_widths,
        )


@attrs.frozen
class StopRule:
    """When a trial ends: at the first of these. 0 sets no limit.

    Raises:
        AgentError: a value outside its range, or a rule that never stops.
    """

    max_episodes: int = setting(0, "then it ends", "episodes", "[0, 1000000000]")
    max_cycles: int = setting(
        0, "then it ends; an unfinished episode is dropped", "cycles", "[0, 1000000000000]"
    )
    threshold: float = setting(
        0.0, "the mean duration over a window is more than this", "s", "[0, 1000000]"
    )
    window: int = setting(1000, "that the mean is over", "episodes", "[1, 1000000000]")
    min_cycles: int = setting(
        0, "the threshold ends no trial before", "cycles", "[0, 1000000000000]"
    )

    def __attrs_post_init__(self) -> None:
        if not self.max_episodes and not self.max_cycles:
            raise AgentError("a trial needs max_episodes or max_cycles: it may never end otherwise")


class Moment(NamedTuple):
    """A cycle of a trial that is watched: all have answered, and the next cycle has not begun."""

    world: World
    field: int  # of the world, on which the trial is played
    action: np.ndarray  # (num_players,) int64, what each player asks for where a decision is due
    target: np.ndarray  # (num_players,) int64
    values: list[np.ndarray]  # what each player's learner expected; empty where none was asked


@dataclass(frozen=True, eq=False)
class Trial:
    """One team's life.

    Weights are (num_actions, num_features, num_tiles, num_tilings) for all players of the role
    to start from, or the same with a leading axis, one for each player.
    """

    seed: np.random.SeedSequence
    stop: StopRule
    keeper_policy: str = "learn"
    taker_policy: str = "hand"
    keeper_weights: np.ndarray | None = None
    taker_weights: np.ndarray | None = None
    snapshots: tuple[int, ...] = ()  # numbers of episodes after which keepers' weights are kept
    label: Any = None  # whatever its owner knows it by
    watch: Callable[[Moment], None] | None = None  # is shown every cycle


@dataclass(frozen=True, eq=False)
class TrialResult:
    """What a trial gave."""

    trial: Trial
    durations: np.ndarray  # (num_episodes,) int32 [cycles]
    outcomes: np.ndarray  # (num_episodes,) int8, `Outcome`
    reached: bool  # did the mean duration pass the threshold?
    keeper_weights: np.ndarray | None  # (num_keepers, num_actions, ..) if they were learned
    taker_weights: np.ndarray | None  # ditto of takers
    snapshots: dict[int, np.ndarray]  # keepers' weights by number of episodes

    @property
    def hours(self) -> float:
        """Simulated hours played."""
        return float(self.durations.sum()) * HOURS_PER_CYCLE


@dataclass
class Progress:
    """How far a run has got."""

    trials: int = 0  # finished
    episodes: int = 0
    cycles: int = 0  # of finished episodes


def trial_seed(seed: int, number: int) -> np.random.SeedSequence:
    """The seed sequence of a run's trial `number`."""
    return np.random.SeedSequence(seed, spawn_key=(number,))


def child_seed(seed: np.random.SeedSequence, *key: int) -> np.random.SeedSequence:
    """A child of a trial's seed sequence: (0,) is the world's, (1, p) the policy of player p."""
    return np.random.SeedSequence(seed.entropy, spawn_key=(*seed.spawn_key, *key))


class RunningTrial:
    """What a trial has gone through so far."""

    def __init__(self, trial: Trial) -> None:
        self.trial = trial
        self.durations: list[int] = []
        self.outcomes: list[int] = []
        self.snapshots: dict[int, np.ndarray] = {}
        self.reached = False
        self._cycles = self._cycles_in_window = 0

    def count(self, cycles: int, outcome: int) -> None:
        """Take note of an episode."""
        stop = self.trial.stop
        self.durations.append(cycles)
        self.outcomes.append(outcome)
        self._cycles += cycles
        self._cycles_in_window += cycles
        if len(self.durations) > stop.window:
            self._cycles_in_window -= self.durations[-stop.window - 1]
        if stop.threshold and len(self.durations) >= stop.window:
            mean = self._cycles_in_window * CYCLE_TIME / stop.window
            self.reached = self.reached or mean > stop.threshold

    def is_over(self) -> bool:
        """Whether the stop rule says so; its `max_cycles` is the trainer's business."""
        stop = self.trial.stop
        if stop.max_episodes and len(self.durations) >= stop.max_episodes:
            return True
        return self.reached and self._cycles >= stop.min_cycles
