"""What the page says of studies with known answers."""

import dataclasses

import attrs
import numpy as np
import pytest

from keepaway_transfer.errors import StudyError
from keepaway_transfer.reports.evidence import (
    Evidence,
    beyond_optimism,
    difference,
    read_evidence,
    scratch_difference,
    twins,
)
from keepaway_transfer.reports.page import page
from keepaway_transfer.reports.page_figures import page_figures
from keepaway_transfer.studies.records import Record
from keepaway_transfer.studies.results import StudyResults, StudyTrial, open_results
from keepaway_transfer.studies.study import load_study

OVER = {0: 30.0, 1000: 16.0, 6000: 45.0, 9000: 55.0}
HOURS = {"0": 30.0, "0 s": 30.0, "2 s": 21.0, "5 s": 18.0, "8 s": 20.0, "12 s": 26.0, "20 s": 58.0}


def record(row, number, target, source=0.0, initial=5.0):
    return Record(
        row=row, number=number, source_episodes=int(source > 0), source_hours=source,
        start_level=None, crossed=target < 60, crossing_episodes=100, crossing_hours=target,
        episodes=100, hours=target, initial=initial, final=9.0, greedy=None, block=50, blocks=(),
        first=(), last=(), code_version="v1",
    )  # fmt: skip


def study_of(name, mean_of, trials=12, shift=0.0, code_version="v1"):
    """StudyResults in which trials lie one hour apart around their row's mean."""
    study = load_study(name)
    spread = np.arange(trials) - (trials - 1) / 2 + shift
    records = [
        record(row.name, k, mean_of(row) + spread[k], source=0.002 * row.source_episodes)
        for row in study.rows
        for k in range(trials)
    ]
    records = [dataclasses.replace(one, code_version=code_version) for one in records]
    return Evidence(StudyResults(study, f"scripts/study.py {name}", code_version, tuple(records)))


def table(name, best, **how):
    return study_of(name, lambda row: best.get(row.source_episodes, 25.0), **how)


@pytest.fixture
def studies():
    never = {0: 30.0, 1000: 12.0, 3000: 15.0, 6000: 18.0, 9000: 18.0}
    return {
        "table2": table("table2", OVER),
        "table2_at_5": table("table2_at_5", never),
        "optimistic": study_of("optimistic", lambda row: HOURS[row.name]),
    }


def test_transfer_is_compared_with_the_best_optimistic_start(studies):
    target, total, start = beyond_optimism(studies)["1000"]
    assert target.difference == pytest.approx(18.0 - 16.0)
    assert total.difference == pytest.approx(18.0 - 16.0 - 2.0)
    assert start.difference == 0.0


def test_the_page_says_what_optimism_explains(studies):
    text = page(studies)
    assert "The best level is 5 s: 18.00 [" in text
    assert "the best constant, without a source, 12.00 [" in text
    assert "h: rho takes 2.00 [-1.05, 5.05] h less of 4v3 than the constant." in text
    assert "The middle trials take 16.0 h and 18.0 h." in text


def test_table2_is_measured_at_a_lower_threshold_where_its_episodes_are_known(studies):
    assert "### The same trials to 8.2 s" not in page(studies)
    results = studies["table2"].results
    known = [
        dataclasses.replace(one, blocks=(50 * 85,) * 30, first=(85,), last=(85,))
        for one in results.records
    ]
    studies["table2"] = Evidence(dataclasses.replace(results, records=tuple(known)))
    text = page(studies).split("### The same trials to 8.2 s")[1]
    assert "| 1000 | 12 of 12 | 2.36 [2.36, 2.36] |" in text  # 1,000 episodes of 8.5 s


def test_a_way_that_never_hurts_is_told_from_one_that_does(studies):
    lines = {line.split("|")[1].strip(): line for line in page(studies).splitlines() if "|" in line}
    rho, at_5 = lines["`table2`"], lines["`table2_at_5`"]
    assert "| after 6000, 9000 (at most 28.0 h) | after 3000, 6000, 9000 (at most 40.0 h) |" in rho
    assert "| no | not shown (at most 3.1 h) | after 1000: 6.00 [" in at_5
    assert at_5.count("| saves | after 1000: 4.00 [") == 1
    assert "In 4v3 hours the best constant start is beaten by `table2_at_5`" in page(studies)
    assert "than from scratch or from the best constant start: `table2_at_5`." in page(studies)


def test_the_page_says_what_the_best_row_adds_to_the_best_optimistic_start(studies):
    text = page(studies)
    assert "with the least hours in all is that after 1000 episodes" in text
    assert "it takes 0.00 [-3.05, 3.05] h less in all than the best constant start" in text


def test_what_the_way_of_carrying_alone_saves_after_too_much_training_is_told(studies):
    hours = {"rho": 45.0, "rescaled": 20.0}
    studies["variants_6000"] = study_of(
        "variants_6000", lambda row: hours.get(row.variant, 40.0) if row.stages else 30.0
    )
    text = page(studies)
    assert "After 6,000 episodes 4v3 takes 45.00 [" in text
    assert "h as `rescaled` does: the way of carrying alone takes 25.00 [25.00, 25.00] h" in text
    assert "<summary>variants_6000, against optimistic at 5 s</summary>" in text


@pytest.mark.parametrize(
    ("at_5", "rescaled", "said"),
    [
        (0.0, 9.0, "to lower every value by the same is not shown to help there, to make all"),
        (9.0, 0.0, "So after much 3v2 too high a mean value slows learning."),
        (0.0, 0.0, "So it is not shown that over-estimation slows learning after much 3v2."),
    ],
)
def test_what_slows_learning_after_much_source_is_told_by_which_way_helps(
    studies, at_5, rescaled, said
):
    for name, hours in (("table2_at_5", at_5), ("table2_rescaled", rescaled)):
        studies[name] = table(name, {row: OVER.get(row, 25.0) - hours for row in (6000, 9000)})
    assert said in page(studies)


def test_studies_that_were_not_run_are_named_with_their_command(studies):
    del studies["optimistic"]
    text = page(studies)
    assert text.count("`scripts/study.py optimistic --out out/optimistic`") == 3
    assert "beyond_optimism" not in page_figures(studies)


def test_equal_scratch_rows_are_the_same_trials(studies):
    assert scratch_difference(studies["optimistic"], studies["table2"]) is None
    assert "- `table2_at_5` and `optimistic`: Table 2's trials" in page(studies)


def test_scratch_rows_of_other_trials_differ_by_a_number_of_hours(studies):
    other = study_of("optimistic", lambda row: HOURS[row.name], shift=0.5)
    found = scratch_difference(other, studies["table2"])
    assert found is not None
    assert found.difference == pytest.approx(0.5)


def test_rows_of_two_studies_are_pairs_where_they_share_their_source_runs(studies):
    table2, at_5 = studies["table2"], studies["table2_at_5"]
    # Every trial is four hours faster: as pairs that is certain.
    assert difference((table2, "1000"), (at_5, "1000"), "target_hours") == (4.0, 4.0, 4.0, 0.0)
    other = Evidence(
        dataclasses.replace(at_5.results, study=attrs.evolve(at_5.results.study, seed=1))
    )
    assert difference((table2, "1000"), (other, "1000"), "target_hours").low < 4.0


@pytest.mark.parametrize(("shift", "are_pairs"), [(0.0, True), (0.01, False)])
def test_studies_of_two_versions_have_pairs_where_their_trials_from_scratch_are_the_same(
    studies, shift, are_pairs
):
    later = table("table2_at_5", OVER, shift=shift, code_version="v2")
    saved = difference((studies["table2"], "1000"), (later, "1000"), "target_hours")
    assert (saved.low == saved.high) == are_pairs


def test_a_row_that_two_studies_played_from_sources_of_their_own_is_shown_beside_itself(studies):
    assert twins(studies) == []
    studies["variants_1000"] = study_of(
        "variants_1000", lambda row: 20.0 if row.name == "rho" else 30.0
    )
    (found,) = (one for one in twins(studies) if one.first == ("table2", "1000"))
    assert found.second == ("variants_1000", "rho")
    assert found.saved.difference == pytest.approx(16.0 - 20.0)
    assert "| `table2`, 1000 | 16.00 [" in page(studies)


def test_what_was_chosen_on_some_trials_is_confirmed_on_others(studies):
    hours = {0: 18.0, 10: 30.0, 50: 18.0, 100: 8.0}
    studies["confirmation"] = study_of("confirmation", lambda row: hours[row.source_episodes])
    said = "of 5 s the time in all is shorter after 100 episodes; longer after 10 episodes; not"
    assert said in page(studies)


def test_the_papers_claims_stand_beside_what_was_seen(studies):
    lines = {line.split(" | ")[0]: line for line in page(studies).splitlines()}
    every = lines["| every amount of 3v2 shortens the time in 4v3"]
    assert "shorter after 10, 50, 100, 250, 500, 1000 and 3000 episodes | not seen |" in every
    more = lines["| after 9,000 episodes 4v3 takes longer than after 1,000"]
    assert "| 38.96 [35.93, 41.98] h more | seen |" in more
    assert lines["| keepers begin hardly better than new ones"].endswith("| seen |")


def test_a_folder_without_studies_is_refused(tmp_path):
    with pytest.raises(ValueError, match="holds no studies' results"):
        read_evidence(tmp_path)


def test_a_row_of_one_trial_is_refused_by_name(tmp_path):
    study = attrs.evolve(load_study("tiny"), trials=1)
    with open_results(tmp_path / "tiny", study, command="x", code_version="v1") as results:
        for row in study.rows:
            results.append(StudyTrial(row.name, 0, (), (50,) * 60, (), "v1"))
    with pytest.raises(StudyError, match=r"tiny: row '0' has too few trials .*: 1, not 2"):
        read_evidence(tmp_path)
