"""The page of results and the committed trials say the same, and a second route says so too.

The second route reads the Parquet files with pandas, pairs by number, and tests with scipy alone.
"""

import json
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from keepaway_transfer.reports.evidence import read_evidence
from keepaway_transfer.reports.never_hurts import NEVER_WORSE_AT, TABLES
from keepaway_transfer.reports.overtraining import WAYS
from keepaway_transfer.reports.page import page

PACKAGE = Path(__file__).parents[3] / "src/keepaway_transfer"
RESULTS, PAGE = PACKAGE / "results", PACKAGE / "docs/results.md"
STUDIES = sorted(path.parent.name for path in RESULTS.glob("*/study.json"))
MEGABYTE = 1_000_000


@pytest.fixture(scope="module")
def studies():
    return read_evidence(RESULTS)


def test_the_page_is_what_the_trials_give(studies):
    assert PAGE.read_text(encoding="utf-8") == page(studies), (
        "run scripts/analyze.py src/keepaway_transfer/results --page"
    )


def test_every_picture_of_the_page_is_there():
    pictures = re.findall(r"!\[[^]]*\]\(([^)]*)\)", PAGE.read_text(encoding="utf-8"))
    assert pictures
    assert [one for one in pictures if not (PAGE.parent / one).is_file()] == []


def test_sentences_hold_no_p_values():
    sentences = [line for line in PAGE.read_text("utf-8").splitlines() if not line.startswith("|")]
    assert [line for line in sentences if re.search(r"\bp ?[=<]", line)] == []


@pytest.mark.parametrize("name", STUDIES)
def test_a_studys_trials_take_less_than_a_megabyte(name):
    assert (RESULTS / name / "trials.parquet").stat().st_size < MEGABYTE


def hours_of(name):
    """Every trial's hours, by pandas."""
    head = json.loads((RESULTS / name / "study.json").read_text())["study"]
    trials = pd.read_parquet(RESULTS / name / "trials.parquet")
    reached = trials.crossed & (trials.crossing_hours <= head["max_hours"])
    trials["target"] = trials.crossing_hours.where(reached, head["max_hours"])
    trials["total"] = trials.source_hours + trials.target
    return head, trials.set_index(["row", "number"]).sort_index()


def are_pairs(head, first, second):
    """Do trials of one number share their source run, by what study.json declares?"""
    if head.get("shared_seeds"):
        return True
    stages = [
        next(row for row in head["rows"] if row["name"] == name)["stages"]
        for name in (first, second)
    ]
    if not all(stages):
        return False
    if head["shared_sources"]:
        return stages[0][0]["task"] == stages[1][0]["task"]
    return stages[0][0] == stages[1][0]


def by_hand(head, trials, reference, row, measure):
    """Hours saved, interval and p, by scipy."""
    before, after = trials.loc[reference][measure], trials.loc[row][measure]
    if are_pairs(head, reference, row):
        both = pd.concat([before, after], axis=1, join="inner").to_numpy()
        test = stats.ttest_rel(both[:, 0], both[:, 1])
    else:
        test = stats.ttest_ind(before, after, equal_var=False)
    interval = test.confidence_interval()
    return before.mean() - after.mean(), interval.low, interval.high, test.pvalue


def holm_by_hand(p_values):
    """Holm's step-down procedure as it is written down, on one table's p-values."""
    order, adjusted, largest = np.argsort(p_values), np.empty(len(p_values)), 0.0
    for rank, place in enumerate(order):
        largest = max(largest, min(1.0, (len(p_values) - rank) * p_values[place]))
        adjusted[place] = largest
    return adjusted


def verdict_by_hand(difference, low, high, p_value):
    if p_value < 0.05:
        return "saves" if difference > 0 else "costs"
    furthest = max(abs(low), abs(high))
    return f"none: within {furthest:.1f} h" if low <= 0 <= high and furthest <= 1 else "open"


def shown(p_value):
    return f"{p_value:.2g}" if p_value >= 0.0001 else "< 0.0001"


def compared():
    """Every study with every reference that other rows can be compared with."""
    for name in STUDIES:
        head = json.loads((RESULTS / name / "study.json").read_text())["study"]
        if "jumpstart" not in name:  # hardly anybody reaches the threshold there
            yield from ((name, reference) for reference in head["references"])


@pytest.mark.filterwarnings("ignore:Precision loss")  # scipy's, where all trials ended at the limit
@pytest.mark.parametrize(("name", "reference"), list(compared()))
def test_each_verdict_comes_out_again_by_scipy_alone(name, reference):
    head, trials = hours_of(name)
    names = [row["name"] for row in head["rows"] if row["name"] != reference]
    cells: dict[str, list[str]] = {row: [] for row in names}
    for measure in ("target", "total"):
        found = [by_hand(head, trials, reference, row, measure) for row in names]
        for row, one, p in zip(
            names, found, holm_by_hand([each[3] for each in found]), strict=True
        ):
            difference, low, high, _ = one
            cells[row] += [
                f"{difference:.2f} [{low:.2f}, {high:.2f}]",
                shown(p),
                verdict_by_hand(difference, low, high, p),
            ]
    text = PAGE.read_text(encoding="utf-8")
    lines = [f"| {' | '.join(cells[row])} |" for row in names]
    for row, ending in zip(names, lines, strict=True):
        pattern = rf"^\| {re.escape(row)} \|.*{re.escape(ending)}$"
        assert re.search(pattern, text, re.MULTILINE), f"{row}: {ending}"


@pytest.mark.parametrize("name", [name for name in STUDIES if name in TABLES])
@pytest.mark.parametrize("measure", ["target", "total"])
def test_the_best_row_against_the_best_optimistic_start_comes_out_again_by_scipy(name, measure):
    _, starts = hours_of("optimistic")
    _, trials = hours_of(name)
    level = starts["target"].groupby("row").mean().idxmin()
    means = trials.drop("0")[measure].groupby("row").mean()
    found = {
        row: stats.ttest_ind(starts.loc[level][measure], trials.loc[row][measure], equal_var=False)
        for row in means.index
    }
    p_values = dict(zip(found, holm_by_hand([one.pvalue for one in found.values()]), strict=True))
    best = means.idxmin()
    interval = found[best].confidence_interval()
    saved = starts.loc[level][measure].mean() - means[best]
    verdict = verdict_by_hand(saved, interval.low, interval.high, p_values[best])
    cells = f"after {best}: {saved:.2f} [{interval.low:.2f}, {interval.high:.2f}]"
    line = re.search(rf"^\| `{name}` \| .*$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    assert line
    assert f"| {cells} | {shown(p_values[best])} | {verdict} |" in line[0]


def test_other_ways_to_carry_table2s_source_runs_come_out_again_by_scipy():
    """As pairs, where the trials from scratch are the same: else the source runs are others."""
    _, rho = hours_of("table2")
    cells = [(name, row) for name in WAYS if name in STUDIES for row in NEVER_WORSE_AT]
    found = []
    for name, row in cells:
        _, trials = hours_of(name)
        one, other = rho.loc[row]["target"], trials.loc[row]["target"]
        scratch = pd.concat(
            [rho.loc["0"]["target"], trials.loc["0"]["target"]], axis=1, join="inner"
        )
        if (scratch.iloc[:, 0] == scratch.iloc[:, 1]).all():
            both = pd.concat([one, other], axis=1, join="inner")
            one, other = both.iloc[:, 0], both.iloc[:, 1]
            test = stats.ttest_rel(one, other)
        else:
            test = stats.ttest_ind(one, other, equal_var=False)
        interval = test.confidence_interval()
        found.append((one.mean() - other.mean(), interval.low, interval.high, test.pvalue))
    text = PAGE.read_text(encoding="utf-8")
    p_values = holm_by_hand([one[3] for one in found])
    for (name, row), (saved, low, high, _), p_value in zip(cells, found, p_values, strict=True):
        judged = verdict_by_hand(saved, low, high, p_value)
        ending = f"| {saved:.2f} [{low:.2f}, {high:.2f}] | {shown(p_value)} | {judged} |"
        pattern = rf"^\| {re.escape(WAYS[name])} \| {row} \|.*{re.escape(ending)}$"
        assert re.search(pattern, text, re.MULTILINE), f"{name} {row}: {ending}"


def test_as_many_trials_as_the_page_says_resolve_two_hours_at_80_percent_power():
    """By simulation: rows drawn from the scratch row's own times, two hours apart."""
    said = re.search(r"one of 2 h takes (\d+) trials a row", PAGE.read_text(encoding="utf-8"))
    assert said
    _, trials = hours_of("table2")
    scratch = trials.loc["0"]["target"].to_numpy()
    generator = np.random.default_rng(1)
    first, second = generator.choice(scratch, size=(2, 4000, int(said[1])))
    p_values = stats.ttest_ind(first, second + 2.0, axis=1, equal_var=False).pvalue
    assert np.mean(p_values < 0.05) == pytest.approx(0.8, abs=0.04)
