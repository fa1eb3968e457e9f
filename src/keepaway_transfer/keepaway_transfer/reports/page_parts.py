"""Pieces of the page of results: a study's table, what its verdicts say in a sentence, pictures."""

import json
from pathlib import Path
from typing import Any

from keepaway_transfer.reports.evidence import Evidence
from keepaway_transfer.reports.report import spread
from keepaway_transfer.reports.statistics import Comparison
from keepaway_transfer.reports.summary import Against, RowSummary, verdict

ELSEWHERE_FILE = Path(__file__).with_name("elsewhere.json")

Lines = list[str]

WORDS = {
    "saves": "saved by",
    "costs": "made longer by",
    "none": "the same with",
    "open": "not decided for",
}
"""The words for rows by the first word of their verdicts."""


def elsewhere() -> dict[str, Any]:
    """What was measured on the real server, here and by others."""
    data: dict[str, Any] = json.loads(ELSEWHERE_FILE.read_text(encoding="utf-8"))
    return data


def said_of(one: Evidence, measure: str, what: str) -> Lines:
    """In a sentence which rows save, cost, or do neither against scratch.

    Args:
        one: a study.
        measure: "target" or "total".
        what: the hours are, "the time in 4v3".
    """
    groups: dict[str, list[str]] = {word: [] for word in WORDS}
    for name, row in one.rows.items():
        if (found := row.against.get(one.scratch)) is not None:
            groups[_verdict(found, measure).partition(":")[0]].append(name)
    said = [f"{WORDS[word]} {listed(names)}" for word, names in groups.items() if names]
    return [f"Against learning from scratch, {what} is {'; '.join(said)}."] if said else []


def _verdict(found: Against, measure: str) -> str:
    comparison: Comparison = getattr(found, measure)
    return verdict(comparison, getattr(found, f"{measure}_holm"))


def listed(names: list[str]) -> str:
    """Some names as part of a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def study_table(one: Evidence, reference: str, rows_are: str) -> Lines:
    """A study's rows against a reference, as Markdown."""
    lines = [
        f"| {rows_are} | reached | 4v3 hours | total hours | 4v3 hours saved | p |"
        " | total hours saved | p | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    if one.study.target != "4v3":
        lines[0] = lines[0].replace("4v3", one.study.target)
    return lines + [_table_row(row, row.against.get(reference)) for row in one.rows.values()]


def _table_row(row: RowSummary, found: Against | None) -> str:
    line = (
        f"| {row.name} | {row.reached} of {row.trials} | {spread(row.target)}"
        f" | {spread(row.total)} |"
    )
    if found is None:
        return line + " | | | | | |"
    return (
        f"{line} {spread(found.target)} | {found.target_holm:.2g} | {_verdict(found, 'target')}"
        f" | {spread(found.total)} | {found.total_holm:.2g} | {_verdict(found, 'total')} |"
    )


def not_run(*names: str) -> Lines:
    """That these studies would have to be run."""
    commands = "; ".join(f"`scripts/study.py {name} --out out/{name}`" for name in names)
    return [f"Not known yet: what would show it was not run in this world ({commands})."]


def shown_picture(title: str, study: str, figure: str = "time_to_threshold") -> str:
    """A figure of a study."""
    return f"![{title}](../results/{study}/{figure}.png)"


def own_picture(title: str, figure: str) -> str:
    """A figure of the page itself."""
    return f"![{title}](results/{figure}.png)"
