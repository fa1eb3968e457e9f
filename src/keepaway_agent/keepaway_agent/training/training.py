"""A training as data: what is trained, played in any number of processes, kept in a folder.

A folder of results holds `training.json` (settings, command, code version) and a folder for each
finished trial: `trial_0003/` with `episodes.csv`, a line an episode, and a weights file for every
player that learned. A trial's folder appears in one step when it is whole, so a training can be
stopped at any moment, and the same training resumes with the trials that are missing. What the
players of the first trial learned lies in the folder itself too, for programs that need a team.
"""

from __future__ import annotations

import io
import json
from collections.abc import Collection
from pathlib import Path
from typing import Any, Final

import attrs
import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.errors import WeightsError
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.weights import (
    HOURS_PER_CYCLE,
    LearnedWeights,
    check_fits,
    load_weights,
    write_weights,
)
from keepaway_agent.playing.agent import AgentConfig
from keepaway_agent.playing.policies import make_player
from keepaway_agent.settings import flat, group, same, setting, settings_of
from keepaway_agent.training.trial import (
    StopRule,
    TrainerConfig,
    Trial,
    trial_seed,
)
from keepaway_agent.training.trial_recorder import TrialRecorder
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config, Vision, profile

RECORDED_TRIAL: Final = 0
"""The trial that can be recorded: it is the same as a match of ROS nodes with the seed."""


@attrs.frozen
class Training:
    """Everything that decides what the trials of a training give.

    Raises:
        AgentError, KeepawayError: settings with which nothing can be trained, by name.
    """

    task: str = setting("3v2", "keepers v takers")
    field: str = setting("25x25", "length x width of the field", "m")
    profile: str = same(Config, "profile")
    visible_angle_deg: float = same(Vision, "visible_angle_deg")
    policy: str = setting("learn", "of the keepers: random, hold, hand, learn or greedy")
    taker_policy: str = setting("hand", "of the takers: random, hand, learn or greedy")
    episodes: int = setting(1000, "of every trial", "episodes", "[1, 1000000000]")
    hours: float = setting(
        0.0, "simulated, after which a trial stops anyway; 0 sets no limit", "h", "[0, 1000000]"
    )
    seed: int = setting(
        0, "of all trials; each has its own random numbers", "", "[0, 9223372036854775807]"
    )
    load_weights: str = setting("", "weights file for all keepers, or folder with keeper_1.npz, ..")
    learner: LearnerConfig = group(LearnerConfig)
    decision_interval: int = same(AgentConfig, "decision_interval")
    shared: bool = setting(False, "all keepers of a trial learn one value function")

    def __attrs_post_init__(self) -> None:
        config, _ = self.trainer, self.stop
        num_keepers = config.task.num_keepers
        make_player(0, num_keepers, self.policy)
        make_player(num_keepers, num_keepers, self.taker_policy)
        config.tiling(Role.KEEPER)

    @property
    def trainer(self) -> TrainerConfig:
        """What the trainer must know of it."""
        return TrainerConfig(
            task=Task.parse(self.task, self.field),
            world=profile(self.profile, visible_angle_deg=self.visible_angle_deg),
            learner=self.learner,
            decision_interval=self.decision_interval,
            shared=self.shared,
        )

    @property
    def stop(self) -> StopRule:
        """When a trial ends."""
        cycles = round(self.hours / HOURS_PER_CYCLE)
        return StopRule(max_episodes=self.episodes, max_cycles=cycles)

    def start(self) -> list[LearnedWeights]:
        """The weights that the keepers start from; none if they know nothing.

        Raises:
            WeightsError: files that cannot be read or belong to something else.
        """
        if not self.load_weights:
            return []
        path, config = Path(self.load_weights), self.trainer
        names = config.task.player_names[: config.task.num_keepers]
        files = [path / f"{name}.npz" for name in names] if path.is_dir() else [path] * len(names)
        if missing := [file.name for file in files if path.is_dir() and not file.exists()]:
            raise WeightsError(
                f"{path} has no {missing[0]}, and {config.task.name} has {len(names)} keepers:"
                " scripts/transfer.py carries over what was learned in a smaller task"
            )
        weights = [load_weights(file) for file in files]
        tiling = config.tiling(Role.KEEPER)
        for each in weights:
            teams = config.task.num_keepers, config.task.num_takers
            check_fits(each, Role.KEEPER, *teams, tiling, self.learner.ordering)
        return weights

    def trial(
        self, number: int, weights: np.ndarray | None, recorder: TrialRecorder | None = None
    ) -> Trial:
        """Trial `number`, its keepers starting from (num_keepers, ..) weights."""
        return Trial(
            seed=trial_seed(self.seed, number),
            stop=self.stop,
            keeper_policy=self.policy,
            taker_policy=self.taker_policy,
            keeper_weights=weights,
            label=number,
            watch=recorder if number == RECORDED_TRIAL else None,
        )

    def recorder(
        self, path: Path, episodes: Collection[int] | None = None, command: str = ""
    ) -> TrialRecorder:
        """What records RECORDED_TRIAL to `path`; only these episodes, or all.

        Raises:
            WeightsError: as in `start`.
        """
        names = self.trainer.task.player_names
        info = {"command": command}
        if not self.shared:  # no player that learns alone could be checked against those
            info["agents"] = json.dumps(
                dict(zip(names, self._agents(), strict=True)), allow_nan=False
            )
        starts = zip(names, self.start(), strict=False)
        files = {f"{name}.npz": _weights_bytes(weights) for name, weights in starts}
        wanted = None if episodes is None else frozenset(episodes).__contains__
        return TrialRecorder(path, self.seed, wanted, info, files)

    def _agents(self) -> list[dict[str, Any]]:
        """How each player plays, as the fields of AgentConfig."""
        own = settings_of(AgentConfig)
        settings = {name: value for name, value in flat(self).items() if name in own}
        task = self.trainer.task
        takers = settings | {"policy": self.taker_policy}
        return [settings] * task.num_keepers + [takers] * task.num_takers


def _weights_bytes(weights: LearnedWeights) -> bytes:
    file = io.BytesIO()
    write_weights(file, weights)
    return file.getvalue()
