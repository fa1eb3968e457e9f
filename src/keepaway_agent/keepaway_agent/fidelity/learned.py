"""What learned keepers do and believe, at chosen stages of their learning.

Keepers learn from scratch (`learn_in_stages`); from their weights at each stage they play on,
learning, for some hundred episodes, and a `Witness` of every trial notes each cycle in which a
keeper has the ball: what it does, and by how much its belief is off. From their last weights they
play some more, of which the true positions are kept. `behaviour` and
`belief_errors` are the reference's measures of the real server (`learned_3v2` and
`belief_errors_of_keepers` in `keepaway_sim/reference/hold_times.json`).
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from keepaway_agent.actions import Action
from keepaway_agent.fidelity.measure import TrajectoryRecorder
from keepaway_agent.fidelity.trajectories import Trajectories
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import Moment, StopRule, TrialResult, child_seed
from keepaway_sim.world.config import CYCLE_TIME

RECORDED: Final = 20
"""Episodes of every trial of which true positions are kept, after it has learned."""
NEAR_BINS: Final = ((2.0, 3.0), (3.0, 4.0), (4.0, 5.0), (6.0, 10.0))
"""[m] Distances to the nearest taker for which the reference has the share of holding."""


class Held(NamedTuple):
    """Every cycle in which a keeper can kick the ball, in order of play."""

    episode: np.ndarray  # (num_rows,) int64, counted over all trials
    cycle: np.ndarray  # (num_rows,) int64
    keeper: np.ndarray  # (num_rows,) int64
    passes: np.ndarray  # (num_rows,) bool: it passes in this cycle; else it holds
    looked: np.ndarray  # (num_rows,) bool: it sees all players in this cycle
    believed: np.ndarray  # (num_rows, 1 + num_takers) [m] to the centre, T1, T2.. as it believes
    true: np.ndarray  # (num_rows, 1 + num_takers) [m] the same in truth


class LearnedStage(NamedTuple):
    """Play from one stage of learning on."""

    begin: int  # episodes learned before
    durations: np.ndarray  # (num_episodes,) [s]
    held: Held


class LearnedPlay(NamedTuple):
    """How keepers learn, and how they play."""

    durations: np.ndarray  # (num_trials, num_episodes) [s] of the episodes that they learn from
    stages: list[LearnedStage]
    trajectories: Trajectories  # of what they play after they have learned


class Witness:
    """Notes the cycles of one trial in which a keeper has the ball (`Trial.watch`)."""

    def __init__(self) -> None:
        self._rows: list[tuple[Any, ...]] = []

    def __call__(self, moment: Moment) -> None:
        """Take note of a cycle."""
        seen, f = moment.world.belief, moment.field
        num_keepers = moment.world.task.num_keepers
        for p in np.flatnonzero(seen.ball_kickable[f, :num_keepers]).tolist():
            belief, truth = seen.position[f, p], moment.world.truth.position[f]
            self._rows.append(
                (
                    int(seen.episode[f]),
                    int(seen.cycle[f]),
                    p,
                    moment.action[p] == Action.PASS_BALL,
                    not seen.age[f, p, :-1].any(),
                    _distances(belief, p, num_keepers),
                    _distances(truth, p, num_keepers),
                )
            )

    def held(self) -> Held:
        """What was noted."""
        return Held(*(np.array(column) for column in zip(*self._rows, strict=True)))


def _distances(position: np.ndarray, keeper: int, num_keepers: int) -> np.ndarray:
    """(1 + num_takers,) a keeper's distance to the centre and, in order, to the takers [m]."""
    own, takers = position[keeper], position[num_keepers:-1]
    away = np.sort(np.hypot(*(takers - own).T))
    return np.asarray(np.r_[np.hypot(*own), away])


def learn_in_stages(
    training: Training, num_trials: int, begins: Sequence[int], episodes: int
) -> LearnedPlay:
    """Let keepers learn, and play on from their weights at each stage.

    Args:
        training: what is trained, for `training.episodes` episodes.
        num_trials: played side by side.
        begins: numbers of episodes after which a stage begins.
        episodes: of every trial in a stage.
    """
    trials = [
        dataclasses.replace(training.trial(k, None), snapshots=tuple(begins))
        for k in range(num_trials)
    ]
    trainer = Trainer(training.trainer, num_trials)
    results = sorted(trainer.run(trials), key=lambda result: int(result.trial.label))
    stages = [_play_on(trainer, results, begin, episodes) for begin in begins]
    durations = np.stack([result.durations for result in results]) * CYCLE_TIME
    return LearnedPlay(durations, stages, _record(trainer, results))


def _record(trainer: Trainer, results: Sequence[TrialResult]) -> Trajectories:
    """Continue every trial from its last weights, learning, for RECORDED episodes."""
    recorder = TrajectoryRecorder(len(results))
    trials = [
        dataclasses.replace(
            result.trial,
            seed=child_seed(result.trial.seed, _RECORDED),
            stop=StopRule(max_episodes=RECORDED),
            keeper_weights=result.keeper_weights,
            snapshots=(),
        )
        for result in results
    ]
    for _ in trainer.run(trials, watch_cycle=recorder):
        pass
    return recorder.trajectories()


def _play_on(
    trainer: Trainer, results: Sequence[TrialResult], begin: int, episodes: int
) -> LearnedStage:
    """A stage: every trial continues from its weights after `begin` episodes."""
    witnesses = [Witness() for _ in results]
    trials = [
        dataclasses.replace(
            result.trial,
            seed=child_seed(result.trial.seed, _STAGE, begin),
            stop=StopRule(max_episodes=episodes),
            keeper_weights=result.snapshots.get(begin),
            snapshots=(),
            watch=witness,
        )
        for result, witness in zip(results, witnesses, strict=True)
    ]
    played = list(trainer.run(trials))
    parts = [
        witness.held()._replace(episode=witness.held().episode + number * episodes)
        for number, witness in enumerate(witnesses)
    ]
    held = Held(*(np.concatenate(column) for column in zip(*parts, strict=True)))
    return LearnedStage(begin, np.concatenate([one.durations for one in played]) * CYCLE_TIME, held)


_STAGE: Final = 2  # first entry of a stage's spawn key, beside the world's 0 and the policies' 1
_RECORDED: Final = 3


def behaviour(stage: LearnedStage) -> dict[str, float]:
    """What keepers do with the ball: the reference's columns.

    A pass is a run of cycles in which one keeper passes: one, or more where it sets up the ball.
    """
    held = stage.held
    num_episodes = len(stage.durations)
    same = np.r_[False, _same_possession(held)]
    begins = held.passes & ~(same & np.r_[False, held.passes[:-1]])
    first = np.flatnonzero(begins)
    follower = np.r_[first[1:], len(held.episode)] if len(first) else first
    received = _received(held, first, follower)
    after = np.diff(held.cycle[first])[np.diff(held.episode[first]) == 0]
    num_passes = len(first)
    num_holds = int((~held.passes).sum())
    return {
        "mean_s": float(stage.durations.mean()),
        "hold_share": num_holds / (num_holds + num_passes),
        "passes_per_episode": num_passes / num_episodes,
        "received_by_other": received / num_episodes,
        "hold_cycles_before_pass": float(
            np.mean([_holds_before(held, same, int(k)) for k in first])
        ),
        "s_between_passes": float(after.mean() * CYCLE_TIME),
        "setup_cycles_per_pass": int(held.passes.sum()) / num_passes - 1.0,
    }


def _same_possession(held: Held) -> np.ndarray:
    """(num_rows - 1,) is a row the next cycle of the same keeper with the ball?"""
    same = (np.diff(held.episode) == 0) & (np.diff(held.keeper) == 0)
    return np.asarray(same & (np.diff(held.cycle) == 1))


def _received(held: Held, first: np.ndarray, follower: np.ndarray) -> int:
    """How many passes come to another keeper before the passer has the ball again."""
    received = 0
    for begin, end in zip(first, follower, strict=True):
        rows = slice(begin, min(end + 1, len(held.episode)))
        others = (held.keeper[rows] != held.keeper[begin]) & (
            held.episode[rows] == held.episode[begin]
        )
        received += bool(others.any())
    return received


def _holds_before(held: Held, same: np.ndarray, row: int) -> int:
    """Cycles of holding right before a pass that begins in a row."""
    count = 0
    while same[row - count] and not held.passes[row - count - 1]:
        count += 1
    return count


def hold_share_by_distance(held: Held) -> dict[str, float]:
    """Share of holding where the nearest taker is believed so far away; no entry where never."""
    near = held.believed[:, 1]
    shares = {}
    for low, high in NEAR_BINS:
        passes = held.passes[(near >= low) & (near < high)]
        if len(passes):
            shares[f"{low:g}-{high:g}"] = float(1.0 - passes.mean())
    return shares


def belief_errors(held: Held) -> dict[str, dict[str, tuple[float, float]]]:
    """Bias and standard deviation of believed minus true distances [m], with and without a look."""
    off = held.believed - held.true
    names = ["K1_to_centre", *(f"K1_to_T{k}" for k in range(1, off.shape[1]))]
    return {
        name: {
            "with_look": (float(off[held.looked, k].mean()), float(off[held.looked, k].std())),
            "without": (float(off[~held.looked, k].mean()), float(off[~held.looked, k].std())),
        }
        for k, name in enumerate(names)
    }
