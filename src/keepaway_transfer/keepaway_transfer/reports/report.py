"""A study's results for people: its table, its figures and a line of numbers for every trial."""

import csv
import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from keepaway_transfer.reports import metrics, plotting, statistics
from keepaway_transfer.reports.statistics import Interval
from keepaway_transfer.reports.summary import (
    RowSummary,
    TrialMeasures,
    checked_threshold,
    measure_trials,
    seconds,
    summarise,
    values,
)
from keepaway_transfer.studies.results import Results, Trial
from keepaway_transfer.studies.study import Row, Study

SHOWN_TRIALS = 5  # single learning curves a row, as in the paper's Figure 3
CURVE_POINTS = 400


def table(study: Study, rows: Sequence[RowSummary], threshold: float) -> str:
    """The rows as Markdown: first what they gave, then how they compare with each reference."""
    lines = [
        "| row | trials | reached | source hours | target hours | total hours | jumpstart (s)"
        " | asymptotic (s) | greedy (s) | transfer ratio |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        lines.append(
            f"| {row.name} | {row.trials} | {row.reached} | {row.source_hours:.2f}"
            f" | {_spread(row.target)} | {_spread(row.total)} | {_spread(row.jumpstart)}"
            f" | {_spread(row.asymptotic)} | {_spread(row.greedy)} | {row.transfer_ratio:+.3f} |"
        )
    lines += [
        "",
        f"Hours to a mean duration of {threshold:g} s over {study.window:,} episodes of"
        f" {study.target}; trials that did not reach it within {study.max_hours:g} h count with"
        " that time (restricted mean). In brackets: 95 % intervals (target hours from the"
        " Kaplan-Meier curve, the others by bootstrap).",
    ]
    for reference in study.references:
        if any(reference in row.against for row in rows):
            lines += ["", *_comparison_table(rows, reference)]
    return "\n".join(lines) + "\n"


def write_report(
    results: Results,
    folder: Path | str,
    *,
    threshold: float | None = None,
    curves: Sequence[str] = (),
) -> str:
    """Write `trials.csv`, `table.md` and the figures into a folder; files there are replaced.

    Args:
        results: that were read.
        folder: made if it does not exist.
        threshold: another than the study's [s].
        curves: rows whose learning curves are drawn beside those from scratch; by default the one
            with the shortest total time.

    Returns:
        the table.
    """
    folder, study = Path(folder), results.study
    threshold = checked_threshold(study, threshold)
    measures = measure_trials(results, threshold)
    rows = summarise(study, measures)
    made_by = _made_by(results, measures)
    folder.mkdir(parents=True, exist_ok=True)
    _write_csv(folder / "trials.csv", measures)
    text = f"{table(study, rows, threshold)}\n{_power(measures, study)}\n\n{made_by}\n"
    (folder / "table.md").write_text(text, encoding="utf-8")
    drawn = [study.references[0], *(curves or _best(rows, study.references[0]))]
    for name, figure in _figures(results, measures, rows, drawn, threshold).items():
        plotting.save(figure, folder / f"{name}.png", made_by)
    return text


def _spread(interval: Interval) -> str:
    if np.isnan(interval.estimate):
        return "-"
    return f"{interval.estimate:.2f} [{interval.low:.2f}, {interval.high:.2f}]"


def _comparison_table(rows: Sequence[RowSummary], reference: str) -> list[str]:
    lines = [
        f"Against row {reference} (p adjusted by Holm over the rows):",
        "",
        "| row | target hours saved | p (Welch) | p (log-rank) | total hours saved | p (Welch) |",
        "|---|---|---|---|---|---|",
    ]
    for row in rows:
        if (found := row.against.get(reference)) is not None:
            target, total = Interval(*found.target[:3]), Interval(*found.total[:3])
            lines.append(
                f"| {row.name} | {_spread(target)} | {found.target_holm:.2g}"
                f" | {found.logrank_holm:.2g} | {_spread(total)} | {found.total_holm:.2g} |"
            )
    return lines


def _power(measures: Sequence[TrialMeasures], study: Study) -> str:
    """What the trials at hand could have shown, from the spread of the scratch row."""
    hours = values([one for one in measures if one.row == study.references[0]], "target_hours")
    variation = float(np.std(hours) / np.mean(hours))
    if variation == 0:
        return "The trials from scratch all took the same time: nothing is known of their spread."
    needed = statistics.trials_needed(0.1, variation)
    text = (
        f"Power: the times from scratch have a coefficient of variation of {variation:.2f}; to see"
        f" a difference of 10 % with 80 % power at 5 % takes {needed} trials a row"
    )
    if len(hours) < 2:
        return f"{text}."
    seen = statistics.detectable_effect(len(hours), variation)
    return f"{text}, and {len(hours)} show one of {100 * seen:.0f} %."


def _made_by(results: Results, measures: Sequence[TrialMeasures]) -> str:
    study = results.study
    versions = ", ".join(sorted({one.code_version for one in measures}))
    return (
        f"Made by `{results.command}`: study {study.name}, seed {study.seed}, code {versions},"
        f" {len(measures)} trials."
    )


def _write_csv(path: Path, measures: Sequence[TrialMeasures]) -> None:
    with open(path, "w", newline="", encoding="utf-8") as file:
        names = [entry.name for entry in dataclasses.fields(TrialMeasures)]
        writer = csv.DictWriter(file, names, lineterminator="\n")
        writer.writeheader()
        writer.writerows(map(_csv_row, measures))


def _csv_row(measures: TrialMeasures) -> dict[str, object]:
    return {
        name: f"{value:.4f}" if isinstance(value, float) else value
        for name, value in dataclasses.asdict(measures).items()
    }


def _best(rows: Sequence[RowSummary], scratch: str) -> list[str]:
    """The row with the shortest total time."""
    others = [row for row in rows if row.name != scratch]
    return [min(others, key=lambda row: row.total.estimate).name] if others else []


def _figures(
    results: Results,
    measures: Sequence[TrialMeasures],
    rows: Sequence[RowSummary],
    drawn: Sequence[str],
    threshold: float,
) -> dict[str, Figure]:
    study = results.study
    by_name = {row.name: row for row in study.rows}
    trials = {name: [one for one in results.trials if one.row == name] for name in drawn}
    labels = {name: _label(by_name[name]) for name in drawn}
    reached = {
        row.name: statistics.kaplan_meier(
            [one.target_hours for one in measures if one.row == row.name],
            [one.reached for one in measures if one.row == row.name],
        )
        for row in rows
    }
    hours = np.linspace(0, max(_hours_run(trials)), CURVE_POINTS + 1)[1:]
    goal = f"Time to a mean of {threshold:g} s in {study.target}"
    scratch = next(row.target for row in rows if row.name == study.references[0])
    return {
        "learning_curves": plotting.learning_curves(
            hours,
            {labels[name]: _curves(trials[name], hours, study.window) for name in drawn},
            threshold,
            f"Learning {study.target}",
        ),
        "time_to_threshold": plotting.time_to_threshold(
            [row.name for row in rows],
            [row.target for row in rows],
            [row.total for row in rows],
            scratch,
            title=goal,
            rows_are=_amount_of(study) or "Way of transfer",
            connected=bool(_amount_of(study)),
        ),
        "share_reached": plotting.share_reached(reached, study.max_hours, goal),
        "durations": plotting.durations(
            {
                labels[name]: (
                    _pooled(trials[name], slice(0, metrics.FIRST_EPISODES)),
                    _pooled(trials[name], slice(-metrics.FIRST_EPISODES, None)),
                )
                for name in drawn
            },
            f"Episodes of {study.target}: first (dotted) and last {metrics.FIRST_EPISODES} of each"
            " trial",
        ),
    }


def _label(row: Row) -> str:
    if not row.stages:
        return "from scratch"
    before = ", ".join(f"{stage.episodes:,} episodes of {stage.task}" for stage in row.stages)
    return f"after {before}" + (f" ({row.variant})" if row.variant != "rho" else "")


def _amount_of(study: Study) -> str:
    """What the rows have more and more of, in words; empty if they differ otherwise."""
    ways = {
        (row.variant, *(stage.task for stage in row.stages)) for row in study.rows if row.stages
    }
    if len(ways) == 1 and len({row.source_episodes for row in study.rows}) > 2:
        return f"Episodes of {next(iter(ways))[1]} before transfer"
    return ""


def _hours_run(trials: dict[str, list[Trial]]) -> list[float]:
    return [metrics.hours(seconds(trial.cycles)) for row in trials.values() for trial in row]


def _curves(trials: Sequence[Trial], hours: metrics.Floats, window: int) -> plotting.CurveGroup:
    """All trials' mean curve, and a few trials evenly spread from the fastest to the slowest."""
    ordered = sorted(trials, key=lambda trial: sum(trial.cycles))
    curves = np.array(
        [
            metrics.learning_curve(seconds(trial.cycles), hours, window, metrics.FIRST_EPISODES)
            for trial in ordered
        ]
    )
    shown = np.linspace(0, len(ordered) - 1, min(SHOWN_TRIALS, len(ordered))).round().astype(int)
    return plotting.CurveGroup(curves[shown], statistics.mean_curve(curves))


def _pooled(trials: Sequence[Trial], episodes: slice) -> metrics.Floats:
    return np.concatenate([seconds(trial.cycles[episodes]) for trial in trials])
