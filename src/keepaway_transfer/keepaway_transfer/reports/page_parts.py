"""Pieces of the page of results: a study's table, what its verdicts say in a sentence, pictures."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from keepaway_transfer.reports.evidence import Evidence
from keepaway_transfer.reports.report import shown_p, spread
from keepaway_transfer.reports.statistics import Comparison
from keepaway_transfer.reports.summary import Against, RowSummary, verdict

ELSEWHERE_FILE = Path(__file__).with_name("elsewhere.json")

Lines = list[str]

AFTER_EPISODES = "after {} episodes of 3v2"
"""What rows of Table 2 are, in a sentence."""
WORDS = {
    "saves": "shorter",
    "costs": "longer",
    "none": "the same (within an hour)",
    "open": "not decided",
}
"""What the target task's hours are, by the first word of a verdict."""


def elsewhere() -> dict[str, Any]:
    """What was measured on the real server, here and by others."""
    data: dict[str, Any] = json.loads(ELSEWHERE_FILE.read_text(encoding="utf-8"))
    return data


def said_of(
    one: Evidence, measure: str, what: str, rows: str, reference: str | None = None
) -> Lines:
    """In a sentence which rows save, cost, or do neither against a reference.

    Args:
        one: a study.
        measure: "target" or "total".
        what: the hours are, "the time in 4v3".
        rows: what their names are, "after {} episodes of 3v2".
        reference: the row; by default learning from scratch.
    """
    verdicts = {
        name: _verdict(found, measure)
        for name, row in one.rows.items()
        if (found := row.against.get(reference or one.scratch)) is not None
    }
    if not verdicts:
        return []
    against = reference or "learning from scratch"
    return [f"Against {against}, {what} is {by_verdict(verdicts, rows)}."]


def by_verdict(verdicts: Mapping[str, str], rows: str) -> str:
    """Names of rows grouped by what was found of them, as a part of a sentence.

    >>> by_verdict({"10": "open", "50": "saves", "100": "saves"}, "after {} episodes")
    'shorter after 50 and 100 episodes; not decided after 10 episodes'
    """
    groups: dict[str, list[str]] = {word: [] for word in WORDS}
    for name, found in verdicts.items():
        groups[found.partition(":")[0]].append(name)
    return "; ".join(
        f"{WORDS[word]} {rows.format(listed(names))}" for word, names in groups.items() if names
    )


def _verdict(found: Against, measure: str) -> str:
    comparison: Comparison = getattr(found, measure)
    return verdict(comparison, getattr(found, f"{measure}_holm"))


def less(saved: Comparison, unit: str = "h") -> str:
    """Hours saved in words that fit their sign.

    >>> less(Comparison(-2.0, -3.0, -1.0, 0.01))
    '2.00 [1.00, 3.00] h more'
    """
    if saved.difference >= 0:
        return f"{spread(saved)} {unit} less"
    turned = Comparison(-saved.difference, -saved.high, -saved.low, saved.p_value)
    return f"{spread(turned)} {unit} more"


def listed(names: Sequence[str]) -> str:
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


def folded(title: str, table: Lines) -> Lines:
    """A table that backs what was said elsewhere: a click on its title opens it."""
    return ["", "<details>", f"<summary>{title}</summary>", "", *table, "", "</details>"]


def tables_of_references(one: Evidence, name: str, rows_are: str) -> Lines:
    """A study's rows against scratch, and, folded, against its other references."""
    first, *others = one.study.references
    lines = [f"`{name}`, against {first}:", "", *study_table(one, first, rows_are)]
    for reference in others:
        lines += folded(f"{name}, against {reference}", study_table(one, reference, rows_are))
    return lines


def _table_row(row: RowSummary, found: Against | None) -> str:
    line = (
        f"| {row.name} | {row.reached} of {row.trials} | {spread(row.target)}"
        f" | {spread(row.total)} |"
    )
    if found is None:
        return line + " | | | | | |"
    return (
        f"{line} {spread(found.target)} | {shown_p(found.target_holm)}"
        f" | {_verdict(found, 'target')} | {spread(found.total)} | {shown_p(found.total_holm)}"
        f" | {_verdict(found, 'total')} |"
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


def note(one: Evidence) -> Lines:
    """What must be known of a study's trials, such as that they are of an earlier world."""
    return [one.results.note, ""] if one.results.note else []


def parts_of_rho(variants: Evidence) -> Lines:
    """What each part of what rho carries saves by itself."""
    gain = {
        name: spread(row.against[variants.scratch].target)
        for name, row in variants.rows.items()
        if name != variants.scratch
    }
    at_5 = variants.rows["shape, preferences at 5 s"].against["optimistic at 5 s"]
    return [
        f"Hours of 4v3 saved against scratch: by rho {gain['rho']}. What rho carries is a level"
        " (the mean value of an action), a shape (differences between states) and preferences"
        f" (differences between actions). The level alone saves {gain['level']}, the shape alone"
        f" {gain['shape']}, preferences alone {gain['preferences']}, shape and preferences without"
        f" the level {gain['shape, preferences']}. A mapping that is shuffled saves"
        f" {gain['shuffled']}.",
        "",
        f"At a level of 5 s, shape and preferences take {less(at_5.target)} of 4v3 than the"
        f" constant 5 s, and {less(at_5.total)} in all, where the hours of 3v2 count.",
        "",
    ]
