"""The page of results: what is true of transfer, in words and figures that follow from the data.

Every number on it is worked out of the committed trials, or read from `elsewhere.json`, which holds
what was measured on the real server. A study that was not run is named with the command to run it.
"""

from keepaway_transfer.reports.evidence import (
    Evidence,
    Studies,
    beyond_optimism,
    scratch_difference,
)
from keepaway_transfer.reports.never_hurts import best_way, never_hurts
from keepaway_transfer.reports.overtraining import overtraining
from keepaway_transfer.reports.page_elsewhere import PAPER, others, real_server
from keepaway_transfer.reports.page_parts import (
    Lines,
    elsewhere,
    not_run,
    own_picture,
    said_of,
    shown_picture,
    study_table,
)
from keepaway_transfer.reports.report import power, spread
from keepaway_transfer.reports.statistics import holm
from keepaway_transfer.reports.summary import verdict

LOWER_THRESHOLD = 8.2  # [s] at which Table 2 is measured a second time


def page(studies: Studies) -> str:
    """The page as Markdown.

    Args:
        studies: results by the name of their folder.
    """
    measured = elsewhere()
    sections = [
        ["# What transfer is worth", "", *_opening()],
        ["## What the paper claims", "", *PAPER],
        ["## What was seen here, row by row", "", *_rows(studies)],
        ["## What optimism explains", "", *_optimism(studies)],
        ["## What transfer adds beyond it", "", *_beyond(studies)],
        ["## What too much training does, and why", "", *overtraining(studies)],
        ["## What the real server showed", "", *real_server(measured["real_server"])],
        ["## What others measured", "", *others(measured["others"])],
        ["## A transfer that never hurts", "", *never_hurts(studies)],
        ["## The data", "", *_data(studies)],
        ["## How the figures changed", "", *_history(studies)],
    ]
    return "\n\n".join("\n".join(lines) for lines in sections) + "\n"


EARLIER_WORLD = [
    "The world of version e3f9ad8 differed from the real server in learned play: keepers chose"
    " again in every cycle of a pass, rewards counted from the decision, and who marks skipped the"
    " ball holder. Now these are the real players' rules, and Table 2 was played anew. In the world"
    " before, much 3v2 made 4v3 slower than from scratch.",
]  # fmt: skip


def _opening() -> Lines:
    return [
        "This page is written by `scripts/analyze.py src/keepaway_transfer/results --page` from the"
        " trials in that folder. Hours are simulated; intervals, in brackets, are of 95 %; errors"
        " are by trial. Saved hours are positive. Rows are compared as pairs where their trials"
        " share a source run, else by Welch's test, and p-values are adjusted by Holm over the rows"
        " of a table.",
    ]


def _rows(studies: Studies) -> Lines:
    if (table2 := studies.get("table2")) is None:
        return not_run("table2")
    lines = [
        *said_of(table2, "target", "the time in 4v3"),
        *said_of(table2, "total", "the time in all"),
        "",
        *study_table(table2, table2.scratch, "episodes of 3v2"),
        "",
        power(table2.measures, table2.study),
        "",
        shown_picture("Hours to 9.0 s by episodes of 3v2", "table2"),
    ]
    lines += _at_lower_threshold(studies)
    for name, words, figure in (
        ("figure3", "Figure 3: learning for a fixed time", "learning_curves"),
        ("fivevfour", "5v4", "time_to_threshold"),
    ):
        if (found := studies.get(name)) is not None:
            lines += ["", f"### {words}", "", *_note(found)]
            lines += study_table(found, found.scratch, "row")
            lines += ["", shown_picture(words, name, figure)]
    if (variants := studies.get("variants_1000")) is not None:
        lines += ["", "### Other ways than rho (`variants_1000`)", "", *_parts_of_rho(variants)]
        lines += _variants(variants)
        picture = shown_picture("Hours to 9.0 s by the way of transfer", "variants_1000")
        lines += ["", picture]
    return lines


def _note(one: Evidence) -> Lines:
    """What must be known of a study's trials, such as that they are of an earlier world."""
    return [one.results.note, ""] if one.results.note else []


def _at_lower_threshold(studies: Studies) -> Lines:
    """Table 2 again, where the trials are known well enough."""
    lower, table2 = studies.get("table2_at_8.2"), studies["table2"]
    if lower is None and all(record.has_episodes for record in table2.results.records):
        lower = Evidence(table2.results, LOWER_THRESHOLD)
    if lower is None:
        return []
    title = f"### The same trials to {LOWER_THRESHOLD:g} s"
    return ["", title, "", *study_table(lower, lower.scratch, "episodes of 3v2")]


def _parts_of_rho(variants: Evidence) -> Lines:
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
        "At a level of 5 s, shape and preferences save"
        f" {spread(at_5.target)} h of 4v3 against the constant 5 s, and {spread(at_5.total)} h in"
        " all, where the hours of 3v2 count.",
        "",
    ]


def _variants(variants: Evidence) -> Lines:
    lines: Lines = []
    for reference in variants.study.references:
        lines += [f"Against {reference}:", "", *study_table(variants, reference, "way"), ""]
    return lines[:-1]


def _optimism(studies: Studies) -> Lines:
    if (optimistic := studies.get("optimistic")) is None:
        return not_run("optimistic")
    best = optimistic.best("target")
    hours = optimistic.rows[best].target
    lines = [
        "No 3v2 at all, and every action of every state worth a constant number of seconds at"
        " first. The best"
        f" level is {best}: {spread(hours)} h of 4v3"
        f" ({spread(optimistic.rows[optimistic.scratch].target)} from scratch).",
        *said_of(optimistic, "target", "the time in 4v3"),
        "",
        *study_table(optimistic, optimistic.scratch, "level"),
        "",
        shown_picture("Hours to 9.0 s by the level of the start", "optimistic"),
    ]
    if (table2 := studies.get("table2")) is not None:
        lines += ["", _of_transfers_gain(table2, optimistic, best)]
    return lines


def _of_transfers_gain(table2: Evidence, optimistic: Evidence, best: str) -> str:
    transfer = table2.best("target")
    by_transfer = table2.rows[transfer].against[table2.scratch].target
    by_optimism = optimistic.rows[best].against[optimistic.scratch].target
    share = by_optimism.difference / by_transfer.difference
    return (
        f"Transfer after {transfer} episodes saves {spread(by_transfer)} h of 4v3 against scratch,"
        f" the optimistic start {spread(by_optimism)} h: {share:.0%} of it, without a source."
    )


def _beyond(studies: Studies) -> Lines:
    missing = [name for name in ("table2", "optimistic") if name not in studies]
    lines = not_run(*missing) if missing else _beyond_table(studies)
    for name in ("jumpstart", "jumpstart_framework"):
        if (jumpstart := studies.get(name)) is not None:
            lines += ["", f"### The first episodes (`{name}`)", "", *_jumpstart(jumpstart)]
            lines += ["", shown_picture("Learning in the first hours", name, "learning_curves")]
    return lines


def _beyond_table(studies: Studies) -> Lines:
    transfer = studies["table2"].best("total")
    _, of_total, at_first = beyond_optimism(studies)[transfer]
    title = "What transfer saves against an optimistic start"
    lines = [
        f"The row of Table 2 with the least hours in all is {transfer}: against the best optimistic"
        f" start it saves {spread(of_total)} h in all, and its keepers hold the ball for"
        f" {spread(at_first)} s longer at first. (Both were chosen as the best on these trials.)",
        "",
        *_against_optimism(studies, "table2"),
        "",
        own_picture(title, "beyond_optimism"),
    ]
    if (best := best_way(studies)) != "table2":
        lines += ["", f"The way of carrying with the least hours of 4v3 is that of `{best}`.", ""]
        lines += _against_optimism(studies, best)
    return lines


def _against_optimism(studies: Studies, study: str) -> Lines:
    """Every row of a study against the best optimistic start."""
    found = beyond_optimism(studies, study)
    adjusted = [holm([three[k].p_value for three in found.values()]) for k in range(3)]
    lines = [
        f"Every row of `{study}` against the best optimistic start,"
        f" {studies['optimistic'].best('target')}:",
        "",
        "| episodes of 3v2 | 4v3 hours saved | p | | total hours saved | p | | longer at first (s)"
        " | p |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for i, (name, (target, total, start)) in enumerate(found.items()):
        p_target, p_total, p_start = (float(p[i]) for p in adjusted)
        lines.append(
            f"| {name} | {spread(target)} | {p_target:.2g} | {verdict(target, p_target)}"
            f" | {spread(total)} | {p_total:.2g} | {verdict(total, p_total)}"
            f" | {spread(start)} | {p_start:.2g} |"
        )
    return lines


def _jumpstart(jumpstart: Evidence) -> Lines:
    """The first episodes against each reference that needs no source."""
    lines = _note(jumpstart)
    for reference in jumpstart.study.references:
        if jumpstart.row(reference).stages:
            continue
        lines += [
            f"Seconds held longer than `{reference}` over the first 100 episodes:",
            "",
            "| row | trials | longer at first (s) | p |",
            "|---|---|---|---|",
            *_longer_at_first(jumpstart, reference),
            "",
        ]
    return lines[:-1]


def _longer_at_first(jumpstart: Evidence, reference: str) -> Lines:
    return [
        f"| {row.name} | {row.trials} | {spread(found.jumpstart)} | {found.jumpstart_holm:.2g} |"
        for row in jumpstart.rows.values()
        if (found := row.against.get(reference)) is not None
    ]


def _data(studies: Studies) -> Lines:
    lines = ["| study | trials | seed | code | |", "|---|---|---|---|---|"]
    for name, one in studies.items():
        versions = ", ".join(sorted({record.code_version for record in one.results.records}))
        lines.append(
            f"| [`{name}`](../results/{name}/table.md) | {len(one.results.records)}"
            f" | {one.study.seed} | {versions} | {one.results.note} |"
        )
    return [*lines, "", *_scratch_rows(studies)]


def _scratch_rows(studies: Studies) -> Lines:
    """By how much the scratch rows of studies differ from Table 2's."""
    if (table2 := studies.get("table2")) is None:
        return []
    lines = [
        "Rows from scratch that are to the same threshold, against Table 2's (hours of 4v3 more):",
        "",
    ]
    for name, other in studies.items():
        if other is table2 or not _same_goal(table2, other):
            continue
        found = scratch_difference(other, table2)
        lines.append(f"- `{name}`: " + ("the same trials" if found is None else spread(found)))
    return lines if len(lines) > 2 else []


def _history(studies: Studies) -> Lines:
    """What Table 2 was before the world's rules were mended."""
    if (before := studies.get("table2_before")) is None:
        return EARLIER_WORLD
    return [
        *EARLIER_WORLD,
        "",
        *_note(before),
        *said_of(before, "target", "the time in 4v3"),
        *said_of(before, "total", "the time in all"),
        "",
        *study_table(before, before.scratch, "episodes of 3v2"),
    ]


def _same_goal(one: Evidence, other: Evidence) -> bool:
    names = "target", "threshold", "window", "max_hours"
    return all(getattr(one.study, name) == getattr(other.study, name) for name in names)
