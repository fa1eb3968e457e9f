"""The soccer server's keepaway log is read and written, and the measures work on it."""

from pathlib import Path

import numpy as np
import pytest

from keepaway_transfer.errors import LogError
from keepaway_transfer.metrics import time_to_threshold
from keepaway_transfer.reports.kwy import read_kwy, write_kwy

HERE = Path(__file__).parent
REFERENCE = Path(__file__).parents[4] / "shared/reference/ut_learning_trial_3v2_20x20.kwy"


def test_a_log_of_the_server_is_read():
    log = read_kwy(HERE / "three_episodes.kwy")
    assert (log.num_keepers, log.num_takers, log.field_size) == (3, 2, (20.0, 25.5))
    assert log.cycles.tolist() == [2, 26, 65]
    assert log.durations == pytest.approx([0.2, 2.6, 6.5])
    assert log.out_of_bounds.tolist() == [True, True, False]


def test_what_is_written_is_read_again_to_the_byte(tmp_path):
    log = read_kwy(HERE / "three_episodes.kwy")
    copy = tmp_path / "copy.kwy"
    write_kwy(
        copy, log.cycles, log.out_of_bounds, num_keepers=3, num_takers=2, field_size=log.field_size
    )
    assert copy.read_bytes() == (HERE / "three_episodes.kwy").read_bytes()


def test_a_log_is_not_overwritten(tmp_path):
    path = tmp_path / "log.kwy"
    path.touch()
    with pytest.raises(FileExistsError):
        write_kwy(path, [], [], num_keepers=3, num_takers=2, field_size=(25, 25))


@pytest.mark.parametrize("line", ["1\t0\t2\t3\to", "1\t0\t2\t2\tx", "1\t0\t2", "1\t5\t2\t-3\to"])
def test_a_line_that_is_no_episode_is_refused_with_its_number(tmp_path, line):
    path = tmp_path / "bad.kwy"
    text = (HERE / "three_episodes.kwy").read_text()
    path.write_text(text + line + "\n")
    with pytest.raises(LogError, match="line 15"):
        read_kwy(path)


def test_a_file_without_the_header_is_refused(tmp_path):
    path = tmp_path / "bare.kwy"
    path.write_text("1\t0\t2\t2\to\n")
    with pytest.raises(LogError, match="Keepers"):
        read_kwy(path)


@pytest.mark.skipif(
    not REFERENCE.exists(), reason=f"needs {REFERENCE}, which is not in this repository"
)
def test_a_learning_run_of_the_real_server_reaches_nine_seconds_when_it_is_known_to():
    log = read_kwy(REFERENCE)
    assert len(log.cycles) == 13_749
    assert np.sum(log.durations) / 3600 == pytest.approx(41.5, abs=0.05)
    crossing = time_to_threshold(log.durations, threshold=9.0, window=1000)
    assert (crossing.reached, crossing.episodes) == (True, 2887)
    assert crossing.hours == pytest.approx(6.60, abs=0.005)
