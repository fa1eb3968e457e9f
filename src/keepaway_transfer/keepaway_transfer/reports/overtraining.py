"""The section of the page on too much training: in which way the same weights help, and why."""

from typing import NamedTuple

from keepaway_transfer.reports.evidence import (
    Evidence,
    Studies,
    difference,
    num_pairs,
    of_one_world,
)
from keepaway_transfer.reports.never_hurts import NEVER_WORSE_AT
from keepaway_transfer.reports.page_parts import (
    Lines,
    by_verdict,
    less,
    listed,
    not_run,
    parts_of_rho,
    shown_picture,
    tables_of_references,
)
from keepaway_transfer.reports.report import shown_p, spread
from keepaway_transfer.reports.statistics import Comparison, holm
from keepaway_transfer.reports.summary import verdict

WAYS = {
    "table2_at_5": "the level alone is set to 5 s",
    "table2_rescaled": "all weights times 13/19",
    "table2_scaled": "all weights multiplied to a level of 5 s",
    "table2_averaged": "weights never learned take the mean of the others",
    "table2_averaged_scaled": "averaged and then multiplied to a level of 5 s",
}
"""Studies that carry Table 2's source runs over in another way than rho."""
SMALLER = ("table2_rescaled", "table2_scaled", "table2_averaged_scaled")
"""Those that make everything smaller that much training left too large."""
MUCH = ("6000", "9000")


_OTHER_WORLD = (
    "Played by a version that plays otherwise than Table 2's, on source runs of its own, so that"
    " its rows are compared as independent ones:"
)


class Carried(NamedTuple):
    """A row of Table 2 whose source runs were carried over in another way, too."""

    study: str
    row: str
    pairs: int  # that the comparison is of; 0: the rows are independent
    saved: Comparison  # hours of 4v3 less than by rho
    p_value: float  # adjusted over all rows and ways
    verdict: str


def overtraining(studies: Studies) -> Lines:
    """The section's lines."""
    missing = [name for name in ("table2", "table2_at_5") if name not in studies]
    lines = [
        "An action's value is a sum over state variables, 13 in 3v2 and 19 in 4v3: copied weights"
        " expect half as much again as 3v2 gave, and late 3v2 gives far more than 4v3 can. Three"
        " explanations, which do not exclude one another: if the mean value is too high, the same"
        " weights at a lower level must be learned from faster; if differences between states and"
        " actions are too large as well, it helps to make all weights smaller; if the skills are"
        " too special for 3v2, neither helps.",
        "",
        *(not_run(*missing) if missing else by_other_ways(studies)),
    ]
    if (variants := studies.get("variants_6000")) is not None:
        lines += ["", *_best_way(variants), "", *parts_of_rho(variants)]
        lines += tables_of_references(variants, "variants_6000", "way")
        lines += ["", shown_picture("Hours to 9.0 s", "variants_6000")]
    return lines


def by_other_ways(studies: Studies) -> Lines:
    """Rows of Table 2 beside the same source runs carried over in other ways."""
    rho, found = studies["table2"], carried(studies)
    lines = [
        "| way | episodes of 3v2 | level that rho carries (s) | 4v3 hours by rho | so carried"
        " | pairs | 4v3 hours saved | p | |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for one in found:
        before, after = rho.rows[one.row], studies[one.study].rows[one.row]
        lines.append(
            f"| {WAYS[one.study]} | {one.row} | {before.start_level:.1f} | {spread(before.target)}"
            f" | {spread(after.target)} | {one.pairs or '-'} | {spread(one.saved)}"
            f" | {shown_p(one.p_value)} | {one.verdict} |"
        )
    ways = list(dict.fromkeys(one.study for one in found))
    if others := [name for name in ways if not of_one_world(rho, studies[name])]:
        lines += ["", f"{_OTHER_WORLD} {listed([f'`{name}`' for name in others])}."]
    lines += ["", *(_said(name, [one for one in found if one.study == name]) for name in ways)]
    if (why := _why(found)) is not None:
        lines.append(why)
    for name in ways:
        lines += ["", shown_picture(f"Hours to 9.0 s: {WAYS[name]}", name)]
    return lines


def carried(studies: Studies) -> list[Carried]:
    """What every other way saves against rho, as pairs where both have the same source runs."""
    rho = studies["table2"]
    cells = [
        (
            name,
            row,
            num_pairs((rho, row), (studies[name], row)),
            difference((rho, row), (studies[name], row), "target_hours"),
        )
        for name in WAYS
        if name in studies
        for row in NEVER_WORSE_AT
        if row in rho.rows and row in studies[name].rows
    ]
    p_values = [float(p) for p in holm([saved.p_value for *_, saved in cells])]
    return [
        Carried(*cell, p_value, verdict(cell[-1], p_value))
        for cell, p_value in zip(cells, p_values, strict=True)
    ]


def _said(name: str, found: list[Carried]) -> str:
    """What a way gives after each number of episodes, in words."""
    what = f"{WAYS[name][0].upper()}{WAYS[name][1:]} (`{name}`)"
    verdicts = by_verdict({one.row: one.verdict for one in found}, "after {} episodes")
    return f"{what}: the time in 4v3 is, beside rho's, {verdicts}."


def _why(found: list[Carried]) -> str | None:
    """What slows learning after much 3v2, where the ways tell."""
    saves = {(one.study, one.row): one.verdict == "saves" for one in found}
    if not all(("table2_at_5", row) in saves for row in MUCH):
        return None
    if any(saves["table2_at_5", row] for row in MUCH):
        return "So after much 3v2 too high a mean value slows learning."
    smaller = [name for name in SMALLER if all(saves.get((name, row), False) for row in MUCH)]
    if smaller:
        return (
            "So it is not the mean value alone that slows learning after much 3v2: to lower every"
            " value by the same is not shown to help there, to make all weights smaller is. Which"
            " of the differences between states and actions are too large, this does not tell."
        )
    return "So it is not shown that over-estimation slows learning after much 3v2."


def _best_way(one: Evidence) -> Lines:
    """What the most trained row gives as rho carries it, and the best way to carry the same."""
    most = max(row.source_episodes for row in one.study.rows)
    names = [name for name in one.rows if one.row(name).source_episodes == most]
    plain = next(name for name in names if one.row(name).variant == "rho")
    best = min(names, key=lambda name: one.rows[name].target.estimate)
    saved = difference((one, plain), (one, best), "target_hours")
    gain = one.rows[best].against[one.scratch].target
    return [
        f"After {most:,} episodes 4v3 takes {spread(one.rows[plain].target)} h as rho carries them"
        f" and {spread(one.rows[best].target)} h as `{one.row(best).variant}` does:"
        f" the way of carrying alone takes {less(saved)}, and {less(gain)} than scratch.",
    ]
