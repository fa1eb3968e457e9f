"""The page's search for a transfer that never hurts, in 4v3 hours and in all hours.

Looked for is a way that is nowhere worse than learning from scratch, and than the best optimistic
start: a constant that every action is worth at the beginning, without any source.
"""

from typing import NamedTuple

from keepaway_transfer.reports.evidence import Evidence, Studies, difference
from keepaway_transfer.reports.page_parts import (
    Lines,
    by_verdict,
    folded,
    less,
    listed,
    not_run,
    study_table,
)
from keepaway_transfer.reports.report import shown_p, spread
from keepaway_transfer.reports.statistics import Comparison, holm
from keepaway_transfer.reports.summary import verdict

TABLES = (
    "table2",
    "table2_averaged",
    "table2_rescaled",
    "table2_at_5",
    "table2_scaled",
    "table2_averaged_scaled",
)
NEVER_WORSE_AT = ("1000", "3000", "6000", "9000")


class Best(NamedTuple):
    """A study's best row, beside the best constant start."""

    study: str
    row: str
    saved: Comparison  # hours
    p_value: float  # adjusted over all rows of the study
    verdict: str


def never_hurts(studies: Studies) -> Lines:
    """The section's lines."""
    tables = [name for name in TABLES if name in studies]
    if "optimistic" not in studies or len(tables) < 2:
        wanted = ("optimistic", *TABLES[1:])
        return [
            "Looked for is a way whose 4v3 hours after 1,000, 3,000, 6,000 and 9,000 episodes are"
            " nowhere worse than from scratch and than from the best constant start, and whose"
            " best total beats that start.",
            *not_run(*(name for name in wanted if name not in studies)),
        ]
    best = {
        measure: [best_row(studies, name, measure) for name in tables]
        for measure in ("target", "total")
    }
    hurts = {name: worse(studies, name) for name in tables}
    lines = [
        _said_of_all(hurts),
        "That nothing is shown is no proof: in brackets is by how many hours a way may still be"
        " worse, by the interval of the row where this is most.",
        _said("4v3 hours", best["target"]),
        _said("hours in all", best["total"]),
        "The best row of each study was chosen on these trials; p is adjusted over all its rows.",
        "",
        "| study | trials a row, version | worse than scratch in 4v3 hours"
        " | worse than the best constant start"
        " | best 4v3 hours against that start (saved) | p over all rows |"
        " | best total against it (hours saved) | p over all rows | |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, target, total in zip(tables, best["target"], best["total"], strict=True):
        against = " | ".join(map(str, hurts[name]))
        lines.append(f"| `{name}` | {studies[name].origin} | {against} | {_cells(target, total)} |")
    lines += _confirmation(studies)
    for name in tables:
        if (table := studies[name]) is not studies["table2"]:
            rows = study_table(table, table.scratch, "episodes of 3v2")
            lines += folded(f"{name}, against scratch", rows)
    return lines


def best_way(studies: Studies) -> str:
    """The study of those with the least hours of 4v3 at its best row."""
    hours = {
        name: min(row.target.estimate for row in studies[name].rows.values())
        for name in TABLES
        if name in studies
    }
    return min(hours, key=hours.__getitem__)


def best_row(studies: Studies, name: str, measure: str) -> Best:
    """The row of a study with the least hours, against the best constant start."""
    table, start = studies[name], _best_start(studies)
    sources = [row for row in table.rows if row != table.scratch]
    saved = [difference(start, (table, row), f"{measure}_hours") for row in sources]
    at = sources.index(table.best(measure))
    p_value = float(holm([one.p_value for one in saved])[at])
    return Best(name, sources[at], saved[at], p_value, verdict(saved[at], p_value))


class Worse(NamedTuple):
    """Where a way takes more hours than a reference."""

    rows: tuple[str, ...]  # that are shown to
    at_most: float  # hours more, by the interval of the row where this is most

    def __str__(self) -> str:
        shown = f"after {', '.join(self.rows)}" if self.rows else "not shown"
        return f"{shown} (at most {self.at_most:.1f} h)" if self.at_most > 0 else "no"


def worse(studies: Studies, name: str) -> list[Worse]:
    """After how much 3v2 a way takes more 4v3 hours than scratch, and than the best constant."""
    table = studies[name]
    names = [row for row in NEVER_WORSE_AT if row in table.rows]
    found = []
    for reference in ((table, table.scratch), _best_start(studies)):
        saved = [difference(reference, (table, row), "target_hours") for row in names]
        p_values = holm([one.p_value for one in saved])
        judged = zip(names, saved, p_values, strict=True)
        costs = [row for row, one, p in judged if verdict(one, float(p)) == "costs"]
        found.append(Worse(tuple(costs), max(-one.low for one in saved)))
    return found


def _said_of_all(hurts: dict[str, list[Worse]]) -> str:
    """Which ways are nowhere worse, in words."""
    safe = [f"`{name}`" for name, found in hurts.items() if not any(one.rows for one in found)]
    after = f"after {listed([f'{int(row):,}' for row in NEVER_WORSE_AT])} episodes"
    start = "from scratch or from the best constant start"
    if not safe:
        return f"Every way is somewhere worse {after}, in 4v3 hours, than {start}."
    return f"Nowhere shown to be worse {after}, in 4v3 hours, than {start}: {listed(safe)}."


def _said(what: str, best: list[Best]) -> str:
    """Which ways beat the best constant start at their best, in words."""
    beats = [one for one in best if one.verdict == "saves"]
    if not beats:
        nearest = max(best, key=lambda one: one.saved.difference)
        return (
            f"In {what} no way of the table is shown to beat the best constant start; nearest to it"
            f" is `{nearest.study}` after {int(nearest.row):,} episodes, with"
            f" {less(nearest.saved)}."
        )
    ways = [f"`{one.study}` after {int(one.row):,} episodes ({less(one.saved)})" for one in beats]
    return f"In {what} the best constant start is beaten by {listed(ways)}."


def _confirmation(studies: Studies) -> Lines:
    """What new trials say of the rows that came nearest in all hours."""
    if (one := studies.get("confirmation")) is None:
        return []
    start = one.study.references[0]
    totals = {name: row.against[start] for name, row in one.rows.items() if name != start}
    verdicts = {name: verdict(found.total, found.total_holm) for name, found in totals.items()}
    return [
        "",
        f"Rows of `table2_at_5` after few episodes were chosen for their totals, so they were"
        f" played again on new trials (`confirmation`, {one.origin}, seed {one.study.seed}). Beside"
        f" a constant start of {start} the time in all is"
        f" {by_verdict(verdicts, 'after {} episodes')}:",
        "",
        *study_table(one, start, "episodes of 3v2, at 5 s"),
        *_other_constants(studies),
    ]


class Nearest(NamedTuple):
    """The confirmation's best row beside the best constant of its seed; both chosen as such."""

    constant: str
    row: str
    saved: Comparison  # hours in all
    p_value: float  # adjusted over the confirmation's rows


def nearest_constant(studies: Studies) -> Nearest:
    """How far few episodes of 3v2 are ahead of the best of `constants`."""
    early, one = studies["confirmation"], studies["constants"]
    constants = [name for name in one.rows if not one.row(name).stages]
    best = min(constants, key=lambda name: float(one.rows[name].total.estimate))
    rows = [name for name in early.rows if early.row(name).stages]
    saved = [difference((one, best), (early, row), "total_hours") for row in rows]
    at = rows.index(early.best("total"))
    return Nearest(best, rows[at], saved[at], float(holm([each.p_value for each in saved])[at]))


def _other_constants(studies: Studies) -> Lines:
    """Constants near the best one, and a shuffled mapping, on the seed of the confirmation."""
    if (one := studies.get("constants")) is None:
        return []
    found = nearest_constant(studies)
    is_decided = verdict(found.saved, found.p_value) in ("saves", "costs")
    decided = "decided" if is_decided else "not decided"
    return [
        "",
        f"Other constants of the same seed, and a mapping that is shuffled (`constants`,"
        f" {one.origin}). The best of these constants is {found.constant}; {found.row} episodes of"
        f" 3v2 take {less(found.saved)} in all than it ({decided}, after adjustment over the rows"
        " of `confirmation`; constant and row were chosen on these trials):",
        "",
        *study_table(one, one.study.references[0], "start"),
    ]


def _cells(*best: Best) -> str:
    """Cells of the table: the row, hours saved, p and verdict of each."""
    return " | ".join(
        f"after {one.row}: {spread(one.saved)} | {shown_p(one.p_value)} | {one.verdict}"
        for one in best
    )


def _best_start(studies: Studies) -> tuple[Evidence, str]:
    optimistic = studies["optimistic"]
    return optimistic, optimistic.best("target")
