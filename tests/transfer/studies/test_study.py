"""Studies are data, and data that make no study are refused by name."""

import math
import re
import tomllib

import pytest

from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.study import FOLDER, Row, Stage, load_study, study_from
from keepaway_transfer.variants import VARIANTS, variant_of

PLAIN = {
    "name": "mine",
    "target": "4v3",
    "threshold": 9.0,
    "seed": 1,
    "references": ["scratch"],
    "rows": [
        {"name": "scratch"},
        {"name": "1000", "stages": [{"task": "3v2", "episodes": 1000}]},
    ],
}


def test_table2_has_the_papers_rows_threshold_and_window():
    study = load_study("table2")
    amounts = [row.source_episodes for row in study.rows]
    assert amounts == [0, 10, 50, 100, 250, 500, 1000, 3000, 6000, 9000]
    assert (study.target, study.threshold, study.window, study.trials) == ("4v3", 9.0, 1000, 100)
    assert {row.variant for row in study.rows} == {"rho"}


@pytest.mark.parametrize("episodes", [1000, 6000])
def test_the_variants_compare_with_scratch_with_rho_and_with_an_optimistic_start(episodes):
    study = load_study(f"variants_{episodes}")
    assert study.references == ("scratch", "rho", "optimistic at 5 s")
    assert study.shared_sources
    assert {row.source_episodes for row in study.rows} == {0, episodes}
    used = {row.variant.partition("@")[0] for row in study.rows}
    assert used >= set(VARIANTS) - {"averaged_shape", "averaged_preferences"}


def test_the_optimistic_study_learns_from_no_source():
    study = load_study("optimistic")
    assert not any(row.stages for row in study.rows)
    levels = [variant_of(row.variant).level for row in study.rows]
    assert levels == [None, 2, 5, 8, 12, 20]


@pytest.mark.parametrize(
    "name",
    [
        "table2_averaged",
        "table2_rescaled",
        "table2_at_5",
        "table2_scaled",
        "table2_averaged_scaled",
    ],
)
def test_tables_of_other_ways_have_the_sources_of_table2(name):
    table2, other = load_study("table2"), load_study(name)
    assert other.rows[0] == table2.rows[0]
    for mine, papers in zip(other.rows[1:], table2.rows[1:], strict=True):
        assert other.source_name(mine, 0) == table2.source_name(papers, 0)
    assert len({row.variant for row in other.rows[1:]} - {"rho"}) == 1


def test_the_readme_names_every_study_with_its_rows_and_trials():
    readme = (FOLDER.parents[1] / "README.md").read_text(encoding="utf-8")
    section = readme.split("## Studies")[1].split("\nA study of")[0]
    found: dict[str, str] = {}
    for names, sizes in re.findall(r"^\| ((?:`\w+`(?:, )?)+) \| ([^|]*) \|", section, re.MULTILINE):
        listed = re.findall(r"`(\w+)`", names)
        each = re.findall(r"\d+ x \d+", sizes)
        found |= dict(zip(listed, each * (len(listed) if len(each) == 1 else 1), strict=True))
    expected = {
        path.stem: f"{len(study.rows)} x {study.trials}"
        for path in FOLDER.glob("*.toml")
        if (study := load_study(path.stem)).name != "tiny"
    }
    assert found == expected


def test_all_studies_of_the_package_have_one_seed_but_those_on_new_trials():
    seeds = {path.stem: load_study(path.stem).seed for path in FOLDER.glob("*.toml")}
    assert seeds.pop("confirmation") == seeds.pop("constants") == 2006
    del seeds["tiny"]
    assert set(seeds.values()) == {2005}


def test_fivevfour_goes_through_4v3_and_through_3v2_and_4v3():
    study = load_study("fivevfour")
    assert (study.target, study.threshold, study.trials) == ("5v4", 7.5, 50)
    chains = [[stage.task for stage in row.stages] for row in study.rows]
    assert ["4v3"] in chains
    assert ["3v2", "4v3"] in chains


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.toml")), ids=lambda path: path.stem)
def test_every_study_of_the_package_loads_under_its_own_name(path):
    assert load_study(path.stem).name == path.stem


def test_a_study_of_ones_own_is_a_path(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text((FOLDER / "tiny.toml").read_text().replace('"tiny"', '"mine"'))
    assert load_study(path).name == "mine"


def test_plain_data_become_a_study():
    study = study_from(PLAIN)
    assert study.rows == (Row("scratch"), Row("1000", (Stage("3v2", 1000),)))
    assert study.task("4v3").field_length == 25.0


def test_the_number_of_trials_is_no_setting_that_decides_what_a_trial_gives():
    assert study_from(PLAIN).settings == study_from({**PLAIN, "trials": 7}).settings
    assert study_from(PLAIN).settings != study_from({**PLAIN, "threshold": 8.0}).settings


SCRATCH, OTHER = Row("0"), Row("1", variant="optimistic@5")
AFTER_10, SAME = Row("2", (Stage("3v2", 10),)), Row("3", (Stage("3v2", 10),), "rescaled")
AFTER_20 = Row("4", (Stage("3v2", 20),))


@pytest.mark.parametrize(
    ("settings", "first", "second", "expected"),
    [
        ({}, SCRATCH, OTHER, False),
        ({}, SCRATCH, AFTER_10, False),
        ({}, AFTER_10, SAME, True),
        ({}, AFTER_10, AFTER_20, False),
        ({"shared_sources": True}, AFTER_10, AFTER_20, True),
        ({"shared_sources": True}, SCRATCH, AFTER_10, False),
        ({"shared_seeds": True}, SCRATCH, OTHER, True),
    ],
)
def test_rows_are_paired_where_trials_of_one_number_share_a_source_or_a_seed(
    settings, first, second, expected
):
    study = study_from({**PLAIN, **settings})
    assert study.are_paired(first, second) == study.are_paired(second, first) == expected


def test_constants_of_world_and_learner_are_changed_by_name():
    study = study_from({**PLAIN, "world": {"kick_rand": 0.1}, "learner": {"lambda_": 0.5}})
    assert study.world_settings.physics.kick_rand == 0.1
    assert study.learner_config.lambda_ == 0.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": 7}, "name=7: give a text"),
        ({"target": 4}, "target=4: give a text"),
        ({"threshold": 0}, "threshold=0.0: give a number above 0 and up to 1000000 [s]"),
        ({"threshold": math.nan}, "threshold=nan: give a number above 0"),
        ({"threshold": "9"}, "threshold='9': give a number above 0"),
        ({"seed": -1}, "seed=-1: give a whole number from 0"),
        ({"seed": 1.5}, "seed=1.5: give a whole number from 0"),
        ({"trials": 0}, "trials=0: give a whole number from 1"),
        ({"window": 0}, "window=0: give a whole number from 1"),
        ({"min_hours": -1}, "min_hours=-1.0: give a number from 0"),
        ({"max_hours": 0}, "max_hours=0.0: give a number from 0.0001"),
        ({"min_hours": 50, "max_hours": 40}, "min_hours=50.0: give 0 to max_hours=40.0"),
        ({"greedy_episodes": -1}, "greedy_episodes=-1: give a whole number from 0"),
        ({"shared_sources": 2}, "shared_sources=2: give true or false"),
        ({"shared_seeds": "yes"}, "shared_seeds='yes': give true or false"),
        ({"shared_keepers": "yes"}, "shared_keepers='yes': give true or false"),
        ({"field": "25"}, "25"),
        ({"profile": "2006"}, "profile='2006': give 2005 or v19"),
        ({"ordering": "far"}, "ordering='far': give ball or k1"),
        ({"widths": "broad"}, "widths='broad': give default"),
        ({"references": ["none"]}, "reference 'none' is not one of the rows scratch, 1000"),
        ({"references": []}, "references=[]"),
        ({"rows": [{"name": "scratch"}] * 2}, "two rows of one name"),
        ({"rows": [{"name": "scratch", "variant": "rho3"}]}, "variant='rho3'"),
        ({"rows": [{"name": "scratch", "variant": "optimistic"}]},
         "row scratch: variant='optimistic' carries what was learned before"),
        ({"rows": [{"name": "scratch", "variant": "rho@5"}]}, "variant='rho@5' carries"),
        ({"rows": [{"name": "scratch", "widths": "broad"}]},
         "row scratch: widths='broad': give \"\" or default"),
        ({"rows": [{"name": 0}]}, "row 0: name=0: give a text"),
        ({"rows": [{"name": "scratch", "stages": [{"task": "5v4", "episodes": 1}]}]},
         "5v4 is no source for 4v3"),
        ({"rows": [{"name": "scratch", "stages": [{"task": "3v2", "episodes": 0}]}]},
         "row scratch: episodes=0: give a whole number from 1"),
        ({"rows": [{"name": "scratch", "stages": [{"task": 3, "episodes": 1}]}]},
         "row scratch: task=3: give a text"),
        ({"treshold": 9}, "treshold"),
        ({"world": {"kick_random": 1}}, "kick_random"),
        ({"learner": {"alfa": 1}}, "alfa"),
        ({"target": "4 to 3"}, "4 to 3"),
    ],
)  # fmt: skip
def test_what_makes_no_study_is_refused_by_name(change, message):
    with pytest.raises(StudyError, match=re.escape(message)):
        study_from({**PLAIN, **change})


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"treshold": 3.0}, "treshold: no such setting; did you mean threshold?"),
        ({"rows": [{"name": "0", "varient": "rho"}]}, "row 0: varient: no such .* mean variant?"),
        ({"rows": [{"name": "0", "stages": [{"taks": "3v2"}]}]}, "taks: no such .* mean task?"),
    ],
)
def test_a_misspelled_entry_is_named_with_the_nearest(change, words):
    with pytest.raises(StudyError, match=words):
        study_from({"name": "mine", "target": "4v3", **change})


def test_the_study_in_the_readme_is_one():
    readme = (FOLDER.parents[1] / "README.md").read_text(encoding="utf-8")
    text = readme.split("```toml\n")[1].split("```")[0]
    study = study_from(tomllib.loads(text))
    assert [row.name for row in study.rows] == ["scratch", "300"]


def test_a_missing_entry_is_named():
    with pytest.raises(StudyError, match="seed"):
        study_from({key: value for key, value in PLAIN.items() if key != "seed"})


def test_an_unknown_study_is_refused_with_those_there_are():
    with pytest.raises(StudyError, match=r"table3.*table2"):
        load_study("table3")


def test_a_broken_file_is_refused_with_its_path(tmp_path):
    path = tmp_path / "broken.toml"
    path.write_text("name = ")
    with pytest.raises(StudyError, match=re.escape("broken.toml")):
        load_study(path)
