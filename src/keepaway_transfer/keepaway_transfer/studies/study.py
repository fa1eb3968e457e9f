"""A study as data: which rows of trials are run, from which settings, to which threshold.

Each of the paper's experiments is a TOML file in the package's folder `studies`; a person's own is
a path to a file of the same form. Row `stages` say what a trial trains on before the target task;
no stages is training from scratch.

>>> load_study("table2").rows[6]
Row(name='1000', stages=(Stage(task='3v2', episodes=1000),), variant='rho', widths='')
"""

import difflib
import tomllib
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import attrs

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.cmac import WIDTH_PROFILES
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.settings import build
from keepaway_sim.errors import KeepawayError
from keepaway_sim.settings import required, same, setting
from keepaway_sim.task import Task
from keepaway_sim.world import config as world_config
from keepaway_sim.world.config import Config
from keepaway_transfer.errors import MappingError, StudyError
from keepaway_transfer.variants import variant_of

FOLDER = Path(__file__).parent


@attrs.frozen
class Stage:
    """Training before the target task: N episodes of a smaller one."""

    task: str = required(str, "keepers v takers")
    episodes: int = required(int, "learned from", "episodes", "[1, 1000000000]")


@attrs.frozen
class Row:
    """One line of the study's table: trials that start alike."""

    name: str = required(str, "of the row")
    stages: tuple[Stage, ...] = ()  # in order; the weights of one keeper are carried to the next
    variant: str = setting("rho", "what is carried between stages, or a start without a source")
    widths: str = setting("", "of the tiles; empty: as the study's", choices=("", *WIDTH_PROFILES))

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


@attrs.frozen(kw_only=True)
class Study:
    """Everything that decides what the trials give; `trials` only decides how many there are.

    Raises:
        KeepawayError, AgentError: settings that make no study, by name.
    """

    name: str = required(str, "of the study")
    target: str = required(str, "task that all rows end with, keepers v takers")
    rows: tuple[Row, ...]
    references: tuple[str, ...]  # rows that the others are compared with; the first is scratch
    threshold: float = required(
        float, "mean duration of episodes at which the target task is learned", "s", "(0, 1000000]"
    )
    seed: int = required(int, "of all trials", "", "[0, 9223372036854775807]")
    trials: int = setting(100, "of every row", "trials", "[1, 1000000000]")
    window: int = setting(1000, "that the mean is over", "episodes", "[1, 1000000000]")
    min_hours: float = setting(
        0.0, "simulated, of the target task: played also after the threshold", "h", "[0, 1000000]"
    )
    max_hours: float = setting(
        40.0, "simulated, of the target task: then the trial is censored", "h", "[0.0001, 1000000]"
    )
    greedy_episodes: int = setting(
        0,
        "played without learning or exploring after the target task",
        "episodes",
        "[0, 1000000000]",
    )
    shared_sources: bool = setting(
        False, "a row's source run is part of that of a row of more episodes"
    )
    shared_seeds: bool = setting(False, "trials of one number have one seed in the target task")
    field: str = setting("25x25", "length x width of the field", "m")
    profile: str = same(Config, "profile")
    world: Mapping[str, float] = attrs.field(factory=dict)  # of Config, changed by name
    shared_keepers: bool = setting(False, "all keepers of a trial learn one value function")
    ordering: str = same(LearnerConfig, "ordering")
    widths: str = same(LearnerConfig, "tile_widths")
    learner: Mapping[str, float] = attrs.field(factory=dict)  # of LearnerConfig, changed by name

    def __attrs_post_init__(self) -> None:
        _check_rows(self)
        if self.min_hours > self.max_hours:
            raise StudyError(f"min_hours={self.min_hours}: give 0 to max_hours={self.max_hours}")
        _ = self.world_settings, self.learner_config  # refuse unknown names now

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
        data = attrs.asdict(self)
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
        _refuse_unknown(data, Study)
        rows = tuple(_row_from(row) for row in data["rows"])
        rest = {key: value for key, value in data.items() if key != "rows"}
        return Study(rows=rows, references=tuple(rest.pop("references")), **rest)
    except KeyError as missing:
        raise StudyError(
            f"{missing} is missing; studies/tiny.toml shows a whole study"
        ) from missing
    except (KeepawayError, AgentError) as error:
        raise StudyError(str(error)) from error
    except (TypeError, AttributeError) as error:
        raise StudyError(f"not the settings of a study: {error}") from error


def _refuse_unknown(data: Mapping[str, Any], kind: type[attrs.AttrsInstance]) -> None:
    known = [field.name for field in attrs.fields(kind)]
    for name in data:
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            way_out = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
            raise StudyError(f"{name}: no such setting; {way_out}")


def _row_from(data: Mapping[str, Any]) -> Row:
    try:
        for part, kind in ((data, Row), *((stage, Stage) for stage in data.get("stages", ()))):
            _refuse_unknown(part, kind)
        stages = tuple(Stage(**stage) for stage in data.get("stages", ()))
        return Row(**{**data, "stages": stages})
    except (KeepawayError, AgentError) as error:
        raise StudyError(f"row {data.get('name')}: {error}") from error


def _check_rows(study: Study) -> None:
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
    tasks = [study.task(stage.task) for stage in row.stages] + [study.task(study.target)]
    for smaller, larger in pairwise(tasks):
        if smaller.num_keepers > larger.num_keepers or smaller.num_takers > larger.num_takers:
            raise StudyError(f"row {row.name}: {smaller.name} is no source for {larger.name}")
