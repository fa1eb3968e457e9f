"""A study's results for people: its table and its figures."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from keepaway_transfer import metrics
from keepaway_transfer.reports import plotting, statistics
from keepaway_transfer.reports.statistics import Comparison, Interval
from keepaway_transfer.reports.summary import (
    EQUIVALENT_HOURS,
    Against,
    RowSummary,
    TrialMeasures,
    checked_threshold,
    measure_trials,
    seconds,
    summarise,
    values,
    verdict,
)
from keepaway_transfer.studies.records import Record
from keepaway_transfer.studies.results import StudyResults
from keepaway_transfer.studies.study import Row, Study

RESOLVED_HOURS = 2.0  # the difference that rows of 100 trials were planned to show
SHOWN_TRIALS = 5  # single learning curves a row, as in the paper's Figure 3
CURVE_POINTS = 400
SMALLEST_P = 1e-4  # that is shown


def table(study: Study, rows: Sequence[RowSummary], threshold: float) -> str:
    """The rows as Markdown: first what they gave, then how they compare with each reference."""
    lines = [
        "| row | trials | reached | source hours | level (s) | target hours | total hours"
        " | first episodes (s) | at the end (s) | greedy (s) | transfer ratio |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row.name} | {row.trials} | {row.reached} | {row.source_hours:.2f}"
            f" | {_number(row.start_level, '.1f')}"
            f" | {spread(row.target)} | {spread(row.total)} | {spread(row.initial)}"
            f" | {spread(row.asymptotic)} | {spread(row.greedy)}"
            f" | {_number(row.transfer_ratio, '+.3f')} |"
        )
    lines += [
        "",
        f"Hours to a mean duration of {threshold:g} s over {study.window:,} episodes of"
        f" {study.target}; trials that did not reach it within {study.max_hours:g} h count with"
        " that time (restricted mean). In brackets: Student's intervals of 95 % over trials. Level:"
        " what actions were worth on average when the target task began. First episodes: the first"
        f" {metrics.FIRST_EPISODES}. At the end: the last {study.window:,}, where trials do not"
        " stop at the threshold. Transfer ratio: of the total rewards up to the hour where the"
        " shortest trial of the study ends, so it compares rows of one study alone.",
    ]
    for reference in study.references:
        if any(reference in row.against for row in rows):
            lines += ["", *_comparison_table(rows, reference)]
    return "\n".join(lines) + "\n"


def write_report(
    results: StudyResults,
    folder: Path | str,
    *,
    threshold: float | None = None,
    curves: Sequence[str] = (),
) -> str:
    """Write `table.md` and the figures into a folder; files there are replaced.

    Figures that need episodes are left out where the records have none, those of hours where
    hardly any trial reached the threshold.

    Args:
        results: that were read.
        folder: made if it does not exist.
        threshold: another than the study's [s].
        curves: rows whose learning curves are drawn beside those from scratch; by default the
            study's other references and the rows with the shortest target and total times.

    Returns:
        the table.
    """
    folder, study = Path(folder), results.study
    threshold = checked_threshold(results, threshold)
    measures = measure_trials(results, threshold)
    rows = summarise(study, measures)
    made_by = _made_by(results)
    folder.mkdir(parents=True, exist_ok=True)
    text = f"{table(study, rows, threshold)}\n{power(measures, study)}\n\n{made_by}\n"
    (folder / "table.md").write_text(text, encoding="utf-8")
    chosen = curves or [*study.references[1:], *_best(rows, study.references[0])]
    drawn = list(dict.fromkeys([study.references[0], *chosen]))
    for name, figure in _figures(results, measures, rows, drawn, threshold).items():
        plotting.save_figure(figure, folder / f"{name}.png", made_by)
    return text


def spread(estimate: Interval | Comparison) -> str:
    """An estimate with its interval in brackets; a dash if it is not known."""
    if np.isnan(estimate[0]):
        return "-"
    return f"{estimate[0]:.2f} [{estimate[1]:.2f}, {estimate[2]:.2f}]"


def shown_p(p_value: float) -> str:
    """A p-value for people, who need no more of a small one than that it is small.

    >>> shown_p(0.0312), shown_p(3e-9)
    ('0.031', '< 0.0001')
    """
    return "< 0.0001" if p_value < SMALLEST_P else f"{p_value:.2g}"


def power(measures: Sequence[TrialMeasures], study: Study) -> str:
    """What the trials at hand could have shown, from the spread of the scratch row."""
    scratch = [one for one in measures if one.row == study.references[0]]
    hours = values(scratch, "target_hours")
    if not any(one.reached for one in scratch):
        return (
            "No trial from scratch reached the threshold: nothing is known of what the trials show"
            " in hours."
        )
    if len(hours) < 2 or np.ptp(hours) == 0:
        return "The times from scratch have no spread: nothing is known of what the trials show."
    deviation = float(np.std(hours, ddof=1))
    seen = statistics.detectable_effect(len(hours), deviation)
    needed = statistics.trials_needed(RESOLVED_HOURS, deviation)
    return (
        f"Power: the {len(hours)} times from scratch have a standard deviation of {deviation:.2f}"
        f" h; two independent rows of {len(hours)} trials show a difference of {seen:.1f} h with"
        f" 80 % power at 5 % (before any adjustment), and one of {RESOLVED_HOURS:g} h takes"
        f" {needed} trials a row."
    )


def _number(value: float, form: str) -> str:
    return "-" if np.isnan(value) else format(value, form)


def hours_tell(rows: Sequence[RowSummary]) -> bool:
    """Did half the trials of some row reach the threshold? Else hours are but the limit."""
    return any(2 * row.reached >= row.trials for row in rows)


def _comparison_table(rows: Sequence[RowSummary], reference: str) -> list[str]:
    """Every row against a reference."""
    with_hours = hours_tell(rows)
    hours = (
        " target hours saved | p | p (log-rank) | | total hours saved | p | |" if with_hours else ""
    )
    return [
        f"Against row {reference} (p by the paired t-test where trials are pairs, else by Welch's;"
        " adjusted by Holm over the rows; intervals are not). `none` is said of intervals that"
        f" hold zero and lie within {EQUIVALENT_HOURS:g} h on both sides.",
        "",
        f"| row | pairs |{hours} longer at first (s) | p |",
        "|---|---|" + "---|" * hours.count("|") + "---|---|",
        *(
            _comparison_row(row.name, found, with_hours)
            for row in rows
            if (found := row.against.get(reference)) is not None
        ),
    ]


def _comparison_row(name: str, found: Against, with_hours: bool) -> str:
    cells = [name, f"{found.pairs or '-'}"]
    if with_hours:
        cells += [
            spread(found.target),
            shown_p(found.target_holm),
            shown_p(found.logrank_holm),
            verdict(found.target, found.target_holm),
            spread(found.total),
            shown_p(found.total_holm),
            verdict(found.total, found.total_holm),
        ]
    return f"| {' | '.join([*cells, spread(found.jumpstart), shown_p(found.jumpstart_holm)])} |"


def _made_by(results: StudyResults) -> str:
    study = results.study
    versions = ", ".join(sorted({one.code_version for one in results.records}))
    made_by = (
        f"Made by `{results.command}`: study {study.name}, seed {study.seed}, code {versions},"
        f" {len(results.records)} trials."
    )
    return f"{made_by} {results.note}" if results.note else made_by


def _best(rows: Sequence[RowSummary], scratch: str) -> list[str]:
    """The rows with the shortest total time and with the shortest time in the target task."""
    others = [row for row in rows if row.name != scratch]
    if not others or not hours_tell(rows):
        return []
    return [
        min(others, key=lambda row: row.total.estimate).name,
        min(others, key=lambda row: row.target.estimate).name,
    ]


def _figures(
    results: StudyResults,
    measures: Sequence[TrialMeasures],
    rows: Sequence[RowSummary],
    drawn: Sequence[str],
    threshold: float,
) -> dict[str, Figure]:
    study = results.study
    records = {name: [one for one in results.records if one.row == name] for name in drawn}
    figures = _time_figures(study, measures, rows, drawn, threshold) if hours_tell(rows) else {}
    if all(one.has_episodes for row in records.values() for one in row):
        figures |= _episode_figures(study, records, threshold)
    return figures


def _time_figures(
    study: Study,
    measures: Sequence[TrialMeasures],
    rows: Sequence[RowSummary],
    drawn: Sequence[str],
    threshold: float,
) -> dict[str, Figure]:
    goal = f"Time to a mean of {threshold:g} s in {study.target}"
    amount = _amount_of(study)
    times = (
        [row.name for row in rows],
        [row.target for row in rows],
        [row.total for row in rows],
        next(row.target for row in rows if row.name == study.references[0]),
    )
    beside = _label(next(row for row in study.rows if row.name == study.references[0]))
    many = not amount and len(rows) > len(plotting.ROW_COLOURS)
    shown = [row for row in rows if row.name in drawn] if many else rows
    return {
        "time_to_threshold": plotting.times_by_amount(
            *times, title=goal, amount=amount, beside=beside
        )
        if amount
        else plotting.times_by_way(*times, title=goal, beside=beside),
        "share_reached": plotting.share_reached(_reached(measures, shown), study.max_hours, goal),
    }


def _episode_figures(
    study: Study, records: dict[str, list[Record]], threshold: float
) -> dict[str, Figure]:
    by_name = {row.name: row for row in study.rows}
    labels = {name: _label(by_name[name]) for name in records}
    longest = max(one.hours for row in records.values() for one in row)
    hours = np.linspace(0, longest, CURVE_POINTS + 1)[1:]
    return {
        "learning_curves": plotting.learning_curves(
            hours,
            {labels[name]: _curves(row, hours, study.window) for name, row in records.items()},
            threshold,
            f"Learning {study.target}",
        ),
        "durations": plotting.durations(
            {
                labels[name]: (
                    seconds([cycles for one in row for cycles in one.first]),
                    seconds([cycles for one in row for cycles in one.last]),
                )
                for name, row in records.items()
            },
            f"Episodes of {study.target}: first (dotted) and last {metrics.FIRST_EPISODES} of each"
            " trial",
        ),
    }


def _reached(
    measures: Sequence[TrialMeasures], rows: Sequence[RowSummary]
) -> dict[str, statistics.SurvivalCurve]:
    return {
        row.name: statistics.kaplan_meier(
            [one.target_hours for one in measures if one.row == row.name],
            [one.reached for one in measures if one.row == row.name],
        )
        for row in rows
    }


def _label(row: Row) -> str:
    if not row.stages:
        return "from scratch" if row.is_scratch else f"from a constant ({row.variant})"
    before = ", ".join(f"{stage.episodes:,} episodes of {stage.task}" for stage in row.stages)
    return f"after {before}" + (f" ({row.variant})" if row.variant != "rho" else "")


def _amount_of(study: Study) -> str:
    """What the rows have more and more of, in words; empty if they differ otherwise."""
    if not any(row.stages for row in study.rows):
        return "Value of every action at the start" if len(study.rows) > 2 else ""
    ways = {
        (row.variant, *(stage.task for stage in row.stages)) for row in study.rows if row.stages
    }
    if len(ways) == 1 and len({row.source_episodes for row in study.rows}) > 2:
        return f"Episodes of {next(iter(ways))[1]} before transfer"
    return ""


def _curves(records: Sequence[Record], hours: metrics.Floats, window: int) -> plotting.CurveGroup:
    """All trials' mean curve, and a few trials evenly spread from the fastest to the slowest."""
    ordered = sorted(records, key=lambda one: one.hours)
    curves = np.array(
        [
            metrics.learning_curve(
                seconds(one.blocks), hours, window, metrics.FIRST_EPISODES, one.block
            )
            for one in ordered
        ]
    )
    shown = np.linspace(0, len(ordered) - 1, min(SHOWN_TRIALS, len(ordered))).round().astype(int)
    return plotting.CurveGroup(curves[shown], statistics.mean_curve(curves))
