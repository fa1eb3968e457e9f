"""Studies side by side: what rows of one study, or of two, differ by."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports.statistics import Comparison, holm
from keepaway_transfer.reports.summary import (
    RowSummary,
    TrialMeasures,
    compare,
    measure_trials,
    summarise,
)
from keepaway_transfer.studies.results import STUDY_FILE, StudyResults, read_results
from keepaway_transfer.studies.study import Row, Study

FEWEST_TRIALS = 2
"""Of a row: one alone has no spread."""


@dataclass(frozen=True)
class Evidence:
    """The results of one study with all that was worked out of them."""

    results: StudyResults
    threshold: float | None = None  # [s] another than the study's

    @property
    def study(self) -> Study:
        """What was run."""
        return self.results.study

    @property
    def scratch(self) -> str:
        """The row that learns from scratch."""
        return self.study.references[0]

    @cached_property
    def measures(self) -> list[TrialMeasures]:
        """Every trial's."""
        return measure_trials(self.results, self.threshold)

    @cached_property
    def rows(self) -> dict[str, RowSummary]:
        """The lines of the table by name."""
        return {row.name: row for row in summarise(self.study, self.measures)}

    def trials(self, name: str) -> list[TrialMeasures]:
        """Those of one row."""
        return [one for one in self.measures if one.row == name]

    def row(self, name: str) -> Row:
        """How a row is defined."""
        return next(row for row in self.study.rows if row.name == name)

    @property
    def has_scratch(self) -> bool:
        """Does any row of it learn from scratch?"""
        return self.row(self.scratch).is_scratch

    @property
    def origin(self) -> str:
        """How many trials a row has, and of which version of the code they are, in words."""
        numbers = sorted({row.trials for row in self.rows.values()})
        versions = sorted({record.code_version for record in self.results.records})
        return f"{' or '.join(map(str, numbers))} trials a row, {', '.join(versions)}"

    def best(self, measure: str) -> str:
        """The row other than scratch with the least hours, `target` or `total`."""
        others = [name for name in self.rows if name != self.scratch]
        return min(others, key=lambda name: float(getattr(self.rows[name], measure).estimate))


Studies = Mapping[str, Evidence]
"""Studies by the name of their folder."""


def read_evidence(folder: Path | str) -> dict[str, Evidence]:
    """All studies whose results lie in this folder, each in one of its own, by folder's name.

    Raises:
        StudyError: there are none, or a row has too few trials to be compared.
    """
    folders = sorted(path.parent for path in Path(folder).glob(f"*/{STUDY_FILE}"))
    if not folders:
        raise StudyError(f"{folder} holds no studies' results: no folder in it has a {STUDY_FILE}")
    studies = {each.name: Evidence(read_results(each)) for each in folders}
    for name, one in studies.items():
        _check_trials(Path(folder) / name, one)
    return studies


def _check_trials(folder: Path, one: Evidence) -> None:
    counts = Counter(record.row for record in one.results.records)
    for row in one.study.rows:
        if counts[row.name] < FEWEST_TRIALS:
            raise StudyError(
                f"{folder}: row {row.name!r} has too few trials to be compared:"
                f" {counts[row.name]}, not {FEWEST_TRIALS}; scripts/study.py with --resume and"
                " --trials adds some"
            )


def difference(
    first: tuple[Evidence, str], second: tuple[Evidence, str], measure: str
) -> Comparison:
    """Mean of a measure in a row less that in another, of the same study or of another one.

    Trials of one number are pairs where the two rows share a source run: in one study as it
    declares, in two if they have one seed and the rows' source runs one name (the seed plan).
    """
    (one, name), (other, other_name) = first, second
    return compare(
        one.trials(name), other.trials(other_name), measure, num_pairs(first, second) > 0
    )


def num_pairs(first: tuple[Evidence, str], second: tuple[Evidence, str]) -> int:
    """How many trials of a row have a partner in another; 0 if the rows are independent."""
    (one, name), (other, other_name) = first, second
    if not _are_paired(one, name, other, other_name):
        return 0
    return len({x.trial for x in one.trials(name)} & {x.trial for x in other.trials(other_name)})


class Twins(NamedTuple):
    """One row, played in two studies on source runs that have nothing in common."""

    first: tuple[str, str]  # study and row
    second: tuple[str, str]
    saved: Comparison  # hours of the target task less in the second
    p_value: float  # adjusted over all twins


def twins(studies: Studies) -> list[Twins]:
    """Rows that start alike in two studies to one goal, but from source runs of their own.

    By how much they differ shows what the draw of source runs is worth. Studies of an earlier
    world, which have a note, are left out.
    """
    known = [(name, one) for name, one in studies.items() if not one.results.note]
    found = [
        ((name, row.name), (other_name, other_row.name), (one, row.name), (other, other_row.name))
        for (name, one), (other_name, other) in combinations(known, 2)
        if have_one_goal(one, other)
        for row in one.study.rows
        for other_row in other.study.rows
        if row.stages
        and (row.origin(), row.widths) == (other_row.origin(), other_row.widths)
        and not num_pairs((one, row.name), (other, other_row.name))
    ]
    saved = [difference(first, second, "target_hours") for *_, first, second in found]
    p_values = [float(p) for p in holm([one.p_value for one in saved])]
    return [
        Twins(first, second, comparison, p_value)
        for (first, second, *_), comparison, p_value in zip(found, saved, p_values, strict=True)
    ]


def have_one_goal(one: Evidence, other: Evidence) -> bool:
    """Are both studies' hours those of one task to one threshold?"""
    names = "target", "threshold", "window", "max_hours"
    return all(getattr(one.study, name) == getattr(other.study, name) for name in names)


def beyond_optimism(
    studies: Studies, study: str = "table2"
) -> dict[str, tuple[Comparison, Comparison, Comparison]]:
    """Every row of a study with a source against the best optimistic start by target hours.

    Returns:
        by row: target hours saved, total hours saved, seconds held longer at first.
    """
    table, optimistic = studies[study], studies["optimistic"]
    best = optimistic, optimistic.best("target")
    return {
        name: (
            difference(best, (table, name), "target_hours"),
            difference(best, (table, name), "total_hours"),
            difference((table, name), best, "initial_performance"),
        )
        for name in table.rows
        if name != table.scratch
    }


def scratch_difference(first: Evidence, second: Evidence) -> Comparison | None:
    """By how many hours the scratch rows of two studies differ; None if they are the same trials.

    Rows from scratch of one seed, one world and one learner are the same trials by the seed plan;
    of two versions, worlds or seeds they are independent.
    """
    one, other = first.trials(first.scratch), second.trials(second.scratch)
    shared = {trial.trial for trial in one} & {trial.trial for trial in other}
    hours = [
        [trial.target_hours for trial in trials if trial.trial in shared] for trials in (one, other)
    ]
    if shared and hours[0] == hours[1]:
        return None
    return compare(one, other, "target_hours", paired=False)


def _are_paired(one: Evidence, name: str, other: Evidence, other_name: str) -> bool:
    first, second = one.row(name), other.row(other_name)
    if one is other:
        return one.study.are_paired(first, second)
    if not (first.stages and second.stages) or not of_one_world(one, other):
        return False
    return one.study.source_name(first, 0) == other.study.source_name(second, 0)


def of_one_world(one: Evidence, other: Evidence) -> bool:
    """Do equal seeds give equal source runs in both studies?

    They do in equal worlds and for equal learners, where one version of the code played both, or
    versions that play alike: the trials from scratch are the same.
    """
    names = ("seed", "field", "profile", "world", "learner", "ordering", "widths", "shared_keepers")
    if any(getattr(one.study, name) != getattr(other.study, name) for name in names):
        return False
    versions = {record.code_version for each in (one, other) for record in each.results.records}
    return len(versions) == 1 or scratch_difference(one, other) is None
