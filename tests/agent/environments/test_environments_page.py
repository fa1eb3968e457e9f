"""docs/environments.md: its snippets run as written, its figures are those that are kept."""

import re
from pathlib import Path
from typing import Any

import pytest
from environment_page import KEPT, PAGE, PARTS, kept, learners, planner, written

SNIPPETS = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(), re.M | re.S)


@pytest.mark.parametrize("number", range(len(SNIPPETS)))
@pytest.mark.filterwarnings("error")
def test_a_snippet_runs_as_written(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    exec(compile(SNIPPETS[number], f"snippet {number}", "exec"), {})
    made = {path.name for path in tmp_path.rglob("*.mp4")}
    assert made == ({"rl-video-episode-0.mp4"} if "RecordVideo" in SNIPPETS[number] else set())


def test_a_student_meets_videos_and_statistics_first() -> None:
    assert "RecordVideo" in SNIPPETS[0]
    assert "RecordEpisodeStatistics" in SNIPPETS[0]
    assert len(SNIPPETS) >= 5


def test_every_part_of_the_page_is_written_from_what_is_kept() -> None:
    assert KEPT.exists()
    assert set(kept()) == set(PARTS)
    assert written(PAGE.read_text(), kept()) == PAGE.read_text()


def test_tables_are_hand_worked_means_and_intervals() -> None:
    settings: dict[str, Any] = {"longest": 9.0, "episodes": 2, "hours": 4.0, "trials": 2}
    rows = planner({"settings": settings, "durations": {"a": [3.0, 5.0]}}).splitlines()
    assert rows[0] == "| keepers | mean duration (s), cut off at 9 s | 95 %, 2 episodes |"
    assert rows[2] == "| a | 4.0 | 3.0 to 5.0 |"
    curves = {"b": [[1.0, 4.0, 6.0], [1.0, 6.0, 8.0]]}  # the last two: 5 and 7
    rows = learners({"settings": settings, "curves": curves}).splitlines()
    assert rows[0] == "| learner | last 0.4 of 4 hours (s) | 95 %, 2 trials |"
    assert rows[2] == "| b | 6.0 | -6.7 to 18.7 |"  # 6 -+ 12.706 * 1
