"""Trials that another study has played already: runs that start alike give equal trials.

By the seed plan (`batch`) a row from scratch, say, is the same in every study of one seed, world,
learner and goal. A study takes such trials over from results that are there, and plays the first of
each row and version itself: were it another, the results would be of another world, and none is
taken.
"""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.experiment import Key
from keepaway_transfer.studies.records import Record
from keepaway_transfer.studies.results import StudyResults, StudyTrial, record_of
from keepaway_transfer.studies.study import Row, Study

NO_MATTER = ("name", "rows", "references", "shared_sources")
"""Settings of a study that decide no run by themselves; shared sources are runs of other names."""


def known_trials(study: Study, others: Sequence[StudyResults]) -> dict[Key, Record]:
    """The trials of this study that are among those of others, under this study's names of rows."""
    found: dict[Key, Record] = {}
    for other in others:
        names = _names_of_equal_rows(study, other.study)
        for record in other.records:
            if record.number < study.trials:
                for name in names.get(record.row, ()):
                    found[name, record.number] = dataclasses.replace(record, row=name)
    return found


def to_play_again(known: Mapping[Key, Record]) -> list[Key]:
    """The first trial of each row and each version of the code, which must come out the same."""
    first: dict[tuple[str, str], Key] = {}
    for key, record in sorted(known.items(), key=lambda item: item[0]):
        first.setdefault((record.row, record.code_version), key)
    return sorted(first.values())


def check_known(study: Study, played: Sequence[StudyTrial], known: Mapping[Key, Record]) -> None:
    """Refuse known trials if one of them, played again, comes out otherwise.

    Raises:
        StudyError: one does, by its row and number.
    """
    for trial in played:
        before, now = known[trial.key], record_of(trial, study)
        if _durations(before) != _durations(now):
            raise StudyError(
                f"row {trial.row!r}, trial {trial.number}: {before.hours:.4f} h in the known"
                f" results (code {before.code_version}), {now.hours:.4f} h when it is played now"
                f" (code {now.code_version}): they are of another world, leave --known out"
            )


def _names_of_equal_rows(study: Study, other: Study) -> dict[str, list[str]]:
    """By the other study's names of rows: those of this study's that start alike."""
    runs = {row.name: _run_of(study, row) for row in study.rows}
    return {
        row.name: [name for name, run in runs.items() if run == _run_of(other, row)]
        for row in other.rows
    }


def _run_of(study: Study, row: Row) -> tuple[Any, ...]:
    """All that decides what a row's trials are."""
    settings = {name: value for name, value in study.settings.items() if name not in NO_MATTER}
    sources = [study.source_name(row, stage) for stage in range(len(row.stages))]
    return settings, row.stages, row.variant, row.widths, sources


def _durations(record: Record) -> tuple[tuple[int, ...], ...]:
    return record.first, record.blocks, record.last
