"""The page of results: what is true of transfer, in words and figures that follow from the data.

Every number on it is worked out of the committed trials, or read from `elsewhere.json`, which holds
what was measured on the real server. A study that was not run is named with the command to run it.
"""

from statistics import median

from keepaway_transfer.metrics import SECONDS_PER_HOUR
from keepaway_transfer.reports.evidence import (
    Evidence,
    Studies,
    beyond_optimism,
    difference,
)
from keepaway_transfer.reports.never_hurts import best_way, never_hurts
from keepaway_transfer.reports.overtraining import overtraining
from keepaway_transfer.reports.page_claims import claims
from keepaway_transfer.reports.page_data import data, history
from keepaway_transfer.reports.page_elsewhere import PAPER, others, real_server
from keepaway_transfer.reports.page_parts import (
    AFTER_EPISODES,
    Lines,
    elsewhere,
    less,
    listed,
    not_run,
    note,
    own_picture,
    parts_of_rho,
    said_of,
    shown_picture,
    study_table,
    tables_of_references,
)
from keepaway_transfer.reports.report import power, shown_p, spread
from keepaway_transfer.reports.statistics import holm
from keepaway_transfer.reports.summary import values, verdict

LOWER_THRESHOLD = 8.2  # [s] at which Table 2 is measured a second time


def page(studies: Studies) -> str:
    """The page as Markdown.

    Args:
        studies: results by the name of their folder.
    """
    measured = elsewhere()
    sections = [
        ["# What transfer is worth", "", *_opening(studies)],
        ["## What the paper claims", "", *PAPER],
        ["## What was seen here, row by row", "", *_rows(studies)],
        ["## What optimism explains", "", *_optimism(studies)],
        ["## What transfer adds beyond it", "", *_beyond(studies)],
        ["## What too much training does, and why", "", *overtraining(studies)],
        [
            "## What the real server showed",
            "",
            *real_server(measured["real_server"], studies.get("table2")),
        ],
        ["## What others measured", "", *others(measured["others"])],
        ["## A transfer that never hurts", "", *never_hurts(studies)],
        ["## The data", "", *data(studies)],
        ["## How the figures changed", "", *history(studies)],
    ]
    return "\n\n".join("\n".join(lines) for lines in sections) + "\n"


def _opening(studies: Studies) -> Lines:
    return [
        "This page is written by `scripts/analyze.py src/keepaway_transfer/results --page` from the"
        " trials in that folder.",
        "",
        "How to read it:",
        "",
        "- **Hours** are of simulated play, while learning and exploring, until keepers hold the"
        " ball for the threshold on average over the last 1,000 episodes: 9.0 s in 4v3, 7.5 s in"
        " 5v4. **Total hours** are these and the hours of the source tasks before. Hours of looking"
        " for a good level or way are in no total.",
        *_limits(studies),
        "- **Intervals**, in brackets, are Student's, of 95 %, over trials, each for itself.",
        "- **Comparisons**: positive hours are saved ones. Trials that share a source run are"
        " compared as pairs, others by Welch's test. p-values alone are adjusted (by Holm, over the"
        " rows of a table, for each measure by itself), so an interval may leave out zero where the"
        " verdict is `open`. `none` says that the interval holds zero and lies within an hour.",
        "- **A constant start** (also called optimistic, though 2 s is not) has no source: all"
        " actions of all states are worth the same number of seconds at first. Their mean worth is"
        " the **level** of any start.",
    ]


def _limits(studies: Studies) -> Lines:
    """Between which hours Table 2's trials can lie."""
    if (table2 := studies.get("table2")) is None:
        return []
    study = table2.study
    least = study.window * study.threshold / SECONDS_PER_HOUR
    return [
        f"- A trial of Table 2 takes {least:.1f} h at least, for {study.window:,} episodes of"
        f" {study.threshold:g} s, so short times are pressed together. It ends after"
        f" {study.max_hours:g} h of 4v3, and counts with these if it did not reach the threshold.",
    ]


def _rows(studies: Studies) -> Lines:
    if (table2 := studies.get("table2")) is None:
        return not_run("table2")
    lines = [
        *claims(studies),
        "",
        "### Table 2",
        "",
        *said_of(table2, "target", "the time in 4v3", AFTER_EPISODES),
        *said_of(table2, "total", "the time in all", AFTER_EPISODES),
        "",
        *study_table(table2, table2.scratch, "episodes of 3v2"),
        "",
        power(table2.measures, table2.study),
        "",
        shown_picture("Hours to 9.0 s by episodes of 3v2", "table2"),
    ]
    lines += _at_lower_threshold(studies)
    if (figure3 := studies.get("figure3")) is not None:
        lines += ["", "### Figure 3: learning for a fixed time", "", *note(figure3)]
        lines += [*study_table(figure3, figure3.scratch, "episodes of 3v2"), ""]
        lines += [*_at_the_end(figure3), ""]
        lines += [
            shown_picture("Figure 3: learning for a fixed time", "figure3", "learning_curves")
        ]
    if (fivevfour := studies.get("fivevfour")) is not None:
        lines += ["", "### 5v4", "", *note(fivevfour), *_fivevfour(fivevfour)]
    if (variants := studies.get("variants_1000")) is not None:
        lines += ["", "### Other ways than rho (`variants_1000`)", "", *parts_of_rho(variants)]
        lines += tables_of_references(variants, "variants_1000", "way")
        picture = shown_picture("Hours to 9.0 s by the way of transfer", "variants_1000")
        lines += ["", picture]
    return lines


def _at_the_end(figure3: Evidence) -> Lines:
    """What both rows of Figure 3 hold when the time is over."""
    before = {figure3.scratch: "from scratch"}
    held = [
        f"{spread(row.asymptotic)} s {before.get(name, f'after {name} episodes of 3v2')}"
        for name, row in figure3.rows.items()
    ]
    return [
        f"In their last {figure3.study.window:,} episodes, after {figure3.study.max_hours:g} h of"
        f" 4v3, keepers hold the ball for {listed(held)}."
    ]


def _fivevfour(one: Evidence) -> Lines:
    """5v4 against scratch, and against its best constant start where it has any."""
    lines = [
        f"Hours of 5v4 to {one.study.threshold:g} s, after 1,000 episodes of each task before, or"
        " from a constant.",
        "",
    ]
    for reference in one.study.references:
        lines += [
            *said_of(one, "target", "the time in 5v4", "with {}", reference),
            *said_of(one, "total", "the time in all", "with {}", reference),
            "",
            *study_table(one, reference, "before"),
            "",
        ]
    return [*lines, shown_picture("5v4", "fivevfour")]


def _at_lower_threshold(studies: Studies) -> Lines:
    """Table 2 again, where the trials are known well enough."""
    lower, table2 = studies.get("table2_at_8.2"), studies["table2"]
    if lower is None and all(record.has_episodes for record in table2.results.records):
        lower = Evidence(table2.results, LOWER_THRESHOLD)
    if lower is None:
        return []
    words = (
        "How much depends on the threshold. The end of a trial is known here to"
        f" {table2.results.records[0].block} episodes."
    )
    title = f"### The same trials to {LOWER_THRESHOLD:g} s"
    return ["", title, "", words, "", *study_table(lower, lower.scratch, "episodes of 3v2")]


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
        *said_of(optimistic, "target", "the time in 4v3", "from {}"),
        "",
        *study_table(optimistic, optimistic.scratch, "level"),
        "",
        shown_picture("Hours to 9.0 s by the level of the start", "optimistic"),
    ]
    if (table2 := studies.get("table2")) is not None:
        lines += ["", _of_transfers_gain(table2, optimistic, best)]
    if (fivevfour := studies.get("fivevfour")) is not None:
        lines += ["", *_in_5v4(fivevfour)]
    return lines


def _in_5v4(one: Evidence) -> Lines:
    """The best constant of 5v4 beside the best start that has a source."""
    best = {
        with_source: min(names, key=lambda name: one.rows[name].target.estimate)
        for with_source in (True, False)
        if (names := [row.name for row in one.study.rows if bool(row.stages) == with_source])
    }
    if len(best) < 2:
        return []
    hours, total = (
        less(difference((one, best[False]), (one, best[True]), measure))
        for measure in ("target_hours", "total_hours")
    )
    return [
        f"In 5v4 the best constant, {best[False]}, takes"
        f" {spread(one.rows[best[False]].target)} h. The best start with a source, {best[True]},"
        f" takes {hours} of 5v4 than it, and {total} in all. (Both were chosen as the best on these"
        " trials.)"
    ]


def _of_transfers_gain(table2: Evidence, optimistic: Evidence, best: str) -> str:
    transfer = table2.best("target")
    by_transfer = table2.rows[transfer].against[table2.scratch].target
    by_optimism = optimistic.rows[best].against[optimistic.scratch].target
    apart = difference((optimistic, best), (table2, transfer), "target_hours")
    middle = [
        f"{median(values(one.trials(name), 'target_hours')):.1f} h"
        for one, name in ((table2, transfer), (optimistic, best))
    ]
    return (
        f"rho's best row, after {transfer} episodes, saves {spread(by_transfer)} h of 4v3 against"
        f" scratch, the best constant, without a source, {spread(by_optimism)} h: rho takes"
        f" {less(apart)} of 4v3 than the constant. The middle trials take {middle[0]} and"
        f" {middle[1]}."
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
        f"The row of Table 2 with the least hours in all is that after {transfer} episodes: it"
        f" takes {less(of_total)} in all than the best constant start, and its keepers hold the"
        f" ball for {spread(at_first)} s longer over their first 100 episodes. (Both were chosen as"
        " the best on these trials.)",
        "",
        *_against_optimism(studies, "table2"),
        "",
        own_picture(title, "beyond_optimism"),
    ]
    if (best := best_way(studies)) != "table2":
        lines += ["", f"The way of carrying with the least mean of 4v3 hours is `{best}`.", ""]
        lines += _against_optimism(studies, best)
    return lines


def _against_optimism(studies: Studies, study: str) -> Lines:
    """Every row of a study against the best constant start."""
    found = beyond_optimism(studies, study)
    adjusted = [holm([three[k].p_value for three in found.values()]) for k in range(3)]
    optimistic = studies["optimistic"]
    lines = [
        f"Every row of `{study}` ({studies[study].origin}) against the best constant start,"
        f" {optimistic.best('target')} ({optimistic.origin}):",
        "",
        "| episodes of 3v2 | 4v3 hours saved | p | | total hours saved | p | | longer at first (s)"
        " | p |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for i, (name, (target, total, start)) in enumerate(found.items()):
        p_target, p_total, p_start = (float(p[i]) for p in adjusted)
        lines.append(
            f"| {name} | {spread(target)} | {shown_p(p_target)} | {verdict(target, p_target)}"
            f" | {spread(total)} | {shown_p(p_total)} | {verdict(total, p_total)}"
            f" | {spread(start)} | {shown_p(p_start)} |"
        )
    return lines


def _jumpstart(jumpstart: Evidence) -> Lines:
    """The first episodes against each reference that needs no source and has the same tiles."""
    lines = note(jumpstart)
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
        f"| {row.name} | {row.trials} | {spread(found.jumpstart)}"
        f" | {shown_p(found.jumpstart_holm)} |"
        for row in jumpstart.rows.values()
        if (found := row.against.get(reference)) is not None
        and jumpstart.row(row.name).widths == jumpstart.row(reference).widths
    ]
