"""Is the world the real one? Hold times, their causes and learning, beside the real server's.

The reference was measured on the RoboCup soccer server 19.0.0 with UT Austin's keepaway players
(`keepaway_sim/reference/`): its profile E05 is `2005` here, D19 is `v19`. `Cell` is one of its
measurements, `measure` plays it, `record` keeps true positions for
`keepaway_agent.fidelity.trajectories.process_statistics`, `learn` trains keepers from scratch.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from keepaway_agent.actions import Outcome
from keepaway_agent.fidelity.reference import GOAL_OUT, Cell
from keepaway_agent.fidelity.trajectories import Trajectories, process_statistics
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.training import Training
from keepaway_agent.training.workers import play_trials
from keepaway_sim.task import Task
from keepaway_sim.world.config import CYCLE_TIME
from keepaway_sim.world.state import DASH, KICK, TURN
from keepaway_sim.world.world import World

POINT: Final = 200
"""Episodes of which a learning curve has the mean in one point."""
SEED: Final = 1


class Ratio(NamedTuple):
    """Our mean over the reference's, with its 95 % interval."""

    estimate: float
    low: float
    high: float


class Measured(NamedTuple):
    """What a cell gave here."""

    cell: Cell
    duration: np.ndarray  # (num_episodes,) [s]
    out: float  # share that ended out of bounds

    @property
    def mean(self) -> float:
        """Mean duration [s]."""
        return float(self.duration.mean())

    @property
    def std(self) -> float:
        """Standard deviation over episodes [s]."""
        return float(self.duration.std(ddof=1))

    @property
    def sem(self) -> float:
        """Standard error of the mean [s]."""
        return self.std / math.sqrt(len(self.duration))

    @property
    def ratio(self) -> Ratio:
        """Ours over the reference; the interval takes both means as normal on a log scale."""
        estimate = self.mean / self.cell.mean
        spread = 1.96 * math.hypot(self.sem / self.mean, self.cell.sem / self.cell.mean)
        return Ratio(estimate, estimate * math.exp(-spread), estimate * math.exp(spread))

    @property
    def reached(self) -> bool:
        """Are mean and share out of bounds as near as they should be?"""
        near = self.cell.is_near(self.mean)
        return near and (self.cell.out is None or abs(self.out - self.cell.out) <= GOAL_OUT)

    def to_dict(self) -> dict[str, Any]:
        """Plain data for --json."""
        cell = self.cell
        return {
            "profile": cell.profile,
            "visible_angle": cell.visible_angle,
            "task": cell.task,
            "policy": cell.policy,
            "episodes": len(self.duration),
            "mean_s": self.mean,
            "sem_s": self.sem,
            "std_s": self.std,
            "out_of_bounds_share": self.out,
            "reference": {
                "mean_s": cell.mean,
                "sem_s": cell.sem,
                "std_s": cell.std,
                "out_of_bounds_share": cell.out,
                "episodes": cell.n,
                "second_session_mean_s": cell.second,
            },
            "ratio": self.ratio._asdict(),
            "goal": cell.goal,
            "goal_reached": self.reached,
        }


def summarize(trajectories: Trajectories, task: str) -> dict[str, Any]:
    """Number of episodes, cycles of each, and process statistics, of recorded play."""
    _, cycles = np.unique(trajectories.episode, return_counts=True)
    statistics = process_statistics(trajectories, Task.parse(task).num_keepers)
    return {"episodes": len(cycles), "cycles": cycles.tolist(), "statistics": statistics}


def training(cell: Cell, episodes: int) -> Training:
    """Trials of `episodes` episodes in which a cell's keepers play."""
    return Training(
        task=cell.task,
        profile=cell.profile,
        visible_angle_deg=float(cell.visible_angle),
        policy=cell.policy,
        episodes=episodes,
        seed=SEED,
    )


def measure(cell: Cell, episodes: int, num_fields: int = 64) -> Measured:
    """Play a cell for at least `episodes` episodes, equally many on every field."""
    trials = training(cell, math.ceil(episodes / num_fields))
    results = list(play_trials(trials, range(num_fields), num_fields=num_fields))
    cycles = np.concatenate([result.durations for result in results])
    outcomes = np.concatenate([result.outcomes for result in results])
    return Measured(cell, cycles * CYCLE_TIME, float(np.mean(outcomes == Outcome.OUT_OF_BOUNDS)))


def record(cell: Cell, episodes: int, num_fields: int = 64) -> Trajectories:
    """True positions of a cell's episodes; like the reference's without their last cycle."""
    trials = training(cell, math.ceil(episodes / num_fields))
    recorder = TrajectoryRecorder(num_fields)
    trainer = Trainer(trials.trainer, num_fields)
    for _ in trainer.run((trials.trial(k, None) for k in range(num_fields)), watch_cycle=recorder):
        pass
    return recorder.trajectories()


def learn(profile: str, num_trials: int, episodes: int) -> np.ndarray:
    """Learning curves of 3v2 from scratch, (num_trials, num_blocks).

    Means of successive blocks of POINT episodes [s]. All trials are played side by side. The
    learner is the reference framework's: its order of players and its tile widths.
    """
    trials = Training(
        profile=profile,
        episodes=episodes,
        seed=SEED,
        learner=LearnerConfig(ordering="k1", tile_widths="framework"),
    )
    durations = {r.trial.label: r.durations for r in play_trials(trials, range(num_trials))}
    played = np.stack([durations[number] for number in range(num_trials)])
    blocks = played[:, : episodes // POINT * POINT].reshape(num_trials, -1, POINT)
    return np.asarray(blocks.mean(axis=2) * CYCLE_TIME)


class TrajectoryRecorder:
    """Keeps the true positions of all episodes of a world, cycle by cycle."""

    def __init__(self, num_fields: int) -> None:
        self._rows: list[list[tuple[np.ndarray, ...]]] = [[] for _ in range(num_fields)]
        self._counts: list[np.ndarray] = [np.zeros(0)] * num_fields

    def __call__(self, world: World) -> None:
        """Take note of the cycle that the world has come to."""
        state, seen = world.truth, world.belief
        kinds = world.commands[:, :, 0]
        for f in np.flatnonzero(state.running & (seen.outcome == Outcome.IN_PLAY)):
            done = np.stack([kinds[f] == kind for kind in (KICK, DASH, TURN)], axis=1)
            begins = seen.cycle[f] == 0
            self._counts[f] = np.zeros(done.shape, int) if begins else self._counts[f] + done
            objects = np.concatenate([state.position[f], state.velocity[f]], axis=1)
            episode = np.array([f, seen.episode[f]])
            self._rows[f].append((episode, objects, self._counts[f]))

    def trajectories(self) -> Trajectories:
        """All episodes, one after the other."""
        rows = [row for field in self._rows for row in field]
        named, objects, counts = (np.stack(column) for column in zip(*rows, strict=True))
        _, episode = np.unique(named, axis=0, return_inverse=True)
        return Trajectories(episode.ravel(), objects[:, -1], objects[:, :-1], counts)
