"""A study as data: which rows of trials are run, from which settings, to which threshold.

Each of the paper's experiments is a TOML file in the package's folder `studies`; a person's own is
a path to a file of the same form. Row `stages` say what a trial trains on before the target task;
no stages is training from scratch.

>>> load_study("table2").rows[6]
Row(name='1000', stages=(Stage(task='3v2', episodes=1000),), variant='rho', widths='')
"""

import dataclasses
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from keepaway_agent.learning.cmac import WIDTH_PROFILES
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.settings import build
from keepaway_sim.task import Task
from keepaway_sim.world import config as world_config
from keepaway_sim.world.config import Config
from keepaway_transfer.errors import MappingError, StudyError
from keepaway_transfer.variants import variant_of

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Stage:
    """Training before the target task: N episodes of a smaller one."""

    task: str  # "3v2"
    episodes: int


@dataclass(frozen=True)
class Row:
    """One line of the study's table: trials that start alike."""

    name: str
    stages: tuple[Stage, ...] = ()  # in order; the weights of one keeper are carried to the next
    variant: str = "rho"  # as variants.variant_of reads it, between all stages
    widths: str = ""  # profile of tile widths; empty: the study's

    @property
    def is_scratch(self) -> bool:
        """Does it start with nothing?"""
        return not self.stages and self.variant == "rho"

    def origin(self, stages: int | None = None) -> str:
        """What was done before a task, in words that rows of other names share: the seed plan's.

        Args:
            stages: how many of the row's stages count; all by default.

        >>> Row("best", (Stage("3v2", 1000), Stage("4v3", 50)), "rescaled").origin()
        '3v2 1000 rescaled 4v3 50 rescaled '
        """
        learned = self.stages if stages is None else self.stages[:stages]
        before = "".join(f"{stage.task} {stage.episodes} {self.variant} " for stage in learned)
        return before if self.stages or self.is_scratch else f"{self.variant} "

    @property
    def source_episodes(self) -> int:
        """Episodes before the target task."""
        return sum(stage.episodes for stage in self.stages)


@dataclass(frozen=True)
class Study:
    """Everything that decides what the trials give; `trials` only decides how many there are.

    Raises:
        StudyError: settings that make no study, by name.
    """

    name: str
    target: str  # task that all rows end with, "4v3"
    rows: tuple[Row, ...]
    references: tuple[str, ...]  # rows that the others are compared with; the first is scratch
    threshold: float  # [s] mean duration at which the target task counts as learned
    seed: int
    trials: int = 100  # a row
    window: int = 1000  # episodes that the mean duration is over
    min_hours: float = 0.0  # simulated, of the target task: played also after the threshold
    max_hours: float = 40.0  # simulated, of the target task: give up, the trial is censored
    greedy_episodes: int = 0  # played without learning or exploring after the target task
    shared_sources: bool = False  # is a row's source run part of that of a row of more episodes?
    shared_seeds: bool = False  # do trials of one number have one seed in the target task?
    field: str = "25x25"  # length x width [m]
    profile: str = "2005"  # of the world's constants
    world: Mapping[str, float] = dataclasses.field(
        default_factory=dict
    )  # constants changed by name
    shared_keepers: bool = False  # do all keepers of a team learn one value function?
    ordering: str = "ball"  # of the players in the state variables
    widths: str = "default"  # profile of tile widths
    learner: Mapping[str, float] = dataclasses.field(
        default_factory=dict
    )  # of LearnerConfig, changed by name

    def __post_init__(self) -> None:
        _check(self)

    def task(self, name: str) -> Task:
        """A task of this study on its field."""
        return Task.parse(name, self.field)

    @property
    def world_settings(self) -> Config:
        """The constants of the world the trials are played in."""
        return world_config.profile(self.profile, **self.world)

    @property
    def learner_config(self) -> LearnerConfig:
        """How the keepers learn."""
        ordering_and_tiles = {"ordering": self.ordering, "tile_widths": self.widths}
        return build(LearnerConfig, {**ordering_and_tiles, **self.learner})

    def are_paired(self, first: Row, second: Row) -> bool:
        """Are these rows' trials of one number pairs: of one source run, or of one seed?"""
        if self.shared_seeds:
            return True
        if not first.stages or not second.stages:
            return False
        return self.source_name(first, 0) == self.source_name(second, 0)

    def source_name(self, row: Row, stage: int) -> str:
        """What the run of this stage is known by: rows share runs of one name."""
        before, itself = row.origin(stage), row.stages[stage]
        return before + itself.task + ("" if self.shared_sources else f" {itself.episodes}")

    def target_name(self, row: Row) -> str:
        """What the runs of the target task are known by."""
        return self.target if self.shared_seeds else f"{row.origin()}{self.target}{row.widths}"

    @property
    def settings(self) -> dict[str, Any]:
        """Plain data that decides what a trial gives; without `trials`, which may grow."""
        data = dataclasses.asdict(self)
        del data["trials"]
        return data


def load_study(name: str | Path) -> Study:
    """The study of this name in the package, or of a TOML file's path.

    Raises:
        StudyError: no such study, or a file that is none; the message has the path.
    """
    path = Path(name) if Path(name).suffix == ".toml" else FOLDER / f"{name}.toml"
    try:
        return study_from(tomllib.loads(path.read_text(encoding="utf-8")))
    except FileNotFoundError:
        known = ", ".join(sorted(file.stem for file in FOLDER.glob("*.toml")))
        raise StudyError(f"{path}: no such study; there are {known}") from None
    except (ValueError, RecursionError) as error:
        raise StudyError(f"{path}: {error}") from error


def study_from(data: Mapping[str, Any]) -> Study:
    """A study from the plain data of its TOML or JSON file.

    Raises:
        StudyError: an entry that is missing, unknown or of no use, by name.
    """
    try:
        rows = tuple(_row_from(row) for row in data["rows"])
        rest = {key: value for key, value in data.items() if key != "rows"}
        return Study(rows=rows, references=tuple(rest.pop("references")), **rest)
    except KeyError as missing:
        raise StudyError(f"{missing} is missing") from missing
    except (TypeError, AttributeError) as error:
        raise StudyError(f"not the settings of a study: {error}") from error


def _row_from(data: Mapping[str, Any]) -> Row:
    stages = tuple(Stage(**stage) for stage in data.get("stages", ()))
    return Row(**{**data, "stages": stages})


def _check(study: Study) -> None:
    names = [row.name for row in study.rows]
    if len(set(names)) != len(names):
        raise StudyError(f"two rows of one name among {', '.join(names)}")
    for name in study.references:
        if name not in names:
            raise StudyError(f"reference {name!r} is not one of the rows {', '.join(names)}")
    if not study.references:
        raise StudyError("references=[]: name the row that learns from scratch")
    for row in study.rows:
        _check_row(row, study)
    for name in ("threshold", "trials", "window", "max_hours"):
        if not getattr(study, name) > 0:
            raise StudyError(f"{name}={getattr(study, name)}: give a positive number")
    if not 0 <= study.min_hours <= study.max_hours:
        raise StudyError(f"min_hours={study.min_hours}: give 0 to max_hours={study.max_hours}")
    if study.greedy_episodes < 0:
        raise StudyError(f"greedy_episodes={study.greedy_episodes}: give 0 or more")
    _ = study.world_settings, study.learner_config  # refuse unknown names now


def _check_row(row: Row, study: Study) -> None:
    try:
        variant = variant_of(row.variant)
    except MappingError as error:
        raise StudyError(f"row {row.name}: {error}") from error
    if not row.stages and not row.is_scratch and not variant.needs_no_source:
        raise StudyError(
            f"row {row.name}: variant={row.variant!r} carries what was learned before: give the"
            " row stages, or let it start at a constant, like optimistic@5"
        )
    if row.widths and row.widths not in WIDTH_PROFILES:
        raise StudyError(
            f"row {row.name}: widths={row.widths!r}: choose one of {', '.join(WIDTH_PROFILES)}"
        )
    tasks = [study.task(stage.task) for stage in row.stages] + [study.task(study.target)]
    for smaller, larger in pairwise(tasks):
        if smaller.num_keepers > larger.num_keepers or smaller.num_takers > larger.num_takers:
            raise StudyError(f"row {row.name}: {smaller.name} is no source for {larger.name}")
    for stage in row.stages:
        if stage.episodes < 1:
            raise StudyError(f"row {row.name}: episodes={stage.episodes}: give a positive number")
