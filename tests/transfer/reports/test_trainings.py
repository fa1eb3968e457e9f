"""Learning curves of trainings, from the folders that scripts/train.py writes."""

import json

import numpy as np
import pytest
from matplotlib.image import imread

from keepaway_agent.errors import AgentError
from keepaway_agent.settings import flat
from keepaway_agent.training.training import Training
from keepaway_transfer.errors import LogError
from keepaway_transfer.reports.trainings import window_of, write_trainings


def training_of(folder, durations, task="3v2"):
    """A training's folder with a trial for each list of durations [cycles]."""
    record = {"settings": flat(Training(task=task)), "code_version": "v1", "command": "train"}
    folder.mkdir()
    (folder / "training.json").write_text(json.dumps(record))
    for number, cycles in enumerate(durations):
        lines = [f"{k},{each},taken_away" for k, each in enumerate(cycles)]
        (folder / f"trial_{number:04}").mkdir()
        text = "\n".join(["episode,cycles,outcome", *lines, ""])
        (folder / f"trial_{number:04}" / "episodes.csv").write_text(text)
    return folder


def test_a_table_has_what_was_held_at_first_and_in_the_end(tmp_path):
    rising = [[50] * 100 + [70] * 100, [60] * 100 + [90] * 100]
    first = training_of(tmp_path / "scratch", rising)
    other = training_of(tmp_path / "transfer", [[100] * 200])
    table = write_trainings([first, other], tmp_path)
    # 200 episodes each, so the last 40 count; 5 and 6 s, 7 and 9 s: half their difference.
    assert f"| {first} | 2 | 400 | 0.8 | 5.50 +- 0.50 | 8.00 +- 1.00 |" in table
    assert f"| {other} | 1 | 200 | 0.6 | 10.00 | 10.00 |" in table
    assert "last 40 episodes (s)" in table
    assert imread(tmp_path / "learning_curves.png").ndim == 3


def test_curves_average_over_a_fifth_of_a_trial_and_at_most_over_the_papers_window():
    assert window_of({"a": [np.ones(600)], "b": [np.ones(400)]}) == 80
    assert window_of({"a": [np.ones(50)]}) == 20
    assert window_of({"a": [np.ones(9000)]}) == 1000


def test_trainings_that_are_none_or_of_two_tasks_are_refused(tmp_path):
    three, four = (training_of(tmp_path / t, [[50] * 60], t) for t in ("3v2", "4v3"))
    with pytest.raises(LogError, match="trainings of 3v2 and 4v3: name those of one task"):
        write_trainings([three, four], tmp_path)
    with pytest.raises(LogError, match="no trial of this training is finished"):
        write_trainings([training_of(tmp_path / "begun", [])], tmp_path)
    with pytest.raises(AgentError, match=r"training\.json cannot be read"):
        write_trainings([tmp_path / "none"], tmp_path)
