"""`scripts/analyze.py` as a person calls it."""

import subprocess
import sys
from pathlib import Path

from keepaway_transfer.reports.kwy import write_kwy
from keepaway_transfer.studies.results import StudyTrial, open_results
from keepaway_transfer.studies.study import load_study

SCRIPT = Path(__file__).parents[2] / "scripts/analyze.py"


def analyze(*arguments):
    return subprocess.run(
        [sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True, check=False
    )


def test_a_results_folder_gets_its_report(tmp_path):
    with open_results(
        tmp_path, load_study("tiny"), command="scripts/study.py tiny", code_version="v1"
    ) as results:
        for row in ("0", "4"):
            for number in range(2):
                results.append(
                    StudyTrial(row, number, (), (40, 50, 60, 70, 80 + number), (60,), "v1")
                )
    done = analyze(tmp_path)
    assert (done.returncode, done.stderr) == (0, "")
    assert "| row | trials | reached |" in done.stdout
    assert {path.name for path in tmp_path.iterdir()} >= {"table.md", "trials.parquet"}


def test_a_report_elsewhere_is_one_that_can_be_analysed_again(tmp_path):
    run, published, again = (tmp_path / name for name in ("run", "published", "again"))
    with open_results(
        run, load_study("tiny"), command="scripts/study.py tiny", code_version="v1"
    ) as results:
        for row in ("0", "4"):
            for number in range(2):
                cycles = (40, 50, 60, 70, 80 + number)
                results.append(StudyTrial(row, number, (), cycles, (60,), "v1"))
    assert analyze(run, "--out", published).returncode == 0
    assert analyze(published, "--out", again).returncode == 0
    names = {path.name for path in published.iterdir()}
    assert names >= {"study.json", "trials.parquet", "table.md", "learning_curves.png"}
    for name in names:
        assert (again / name).read_bytes() == (published / name).read_bytes()


def test_a_log_is_told_when_it_reached_the_threshold(tmp_path):
    log = tmp_path / "log.kwy"
    # 3,600 s of episodes of 100 s, and from there 200 s: window of two above 120 s at the first.
    cycles = [1000] * 36 + [2000] * 4
    write_kwy(log, cycles, [False] * 40, num_keepers=3, num_takers=2, field_size=(20, 20))
    done = analyze(log, "--threshold", 120, "--window", 2)
    assert done.stdout == (
        "40 episodes of 3v2 on 20 x 20 m, 1.2 simulated hours: held 110.00 s on average, 0% ended"
        " out of bounds; a mean of 120 s over 2 episodes at episode 37, 1.06 h.\n"
    )


def test_several_logs_of_a_training_are_one_in_their_order(tmp_path):
    played = [([1000] * 36, True, 3), ([2000] * 4, False, 3), ([10], False, 4)]
    for number, (cycles, out, keepers) in enumerate(played, start=1):
        write_kwy(
            tmp_path / f"{number}.kwy", cycles, [out] * len(cycles),
            num_keepers=keepers, num_takers=2, field_size=(20, 20),
        )  # fmt: skip
    logs = [tmp_path / f"{number}.kwy" for number in (1, 2, 3)]
    done = analyze(*logs[:2], "--threshold", 120, "--window", 2)
    assert "40 episodes of 3v2 on 20 x 20 m" in done.stdout
    assert "90% ended out of bounds" in done.stdout
    assert "at episode 37" in done.stdout
    assert "was never reached" in analyze(*logs[:2], "--threshold", 300).stdout
    assert "another task or field" in analyze(*logs).stderr


def test_a_plain_file_is_no_bag(tmp_path):
    (tmp_path / "notes.txt").write_text("nothing")
    done = analyze(tmp_path / "notes.txt")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.endswith("notes.txt is no MCAP file\n")


def test_a_folder_without_results_is_refused_in_one_line(tmp_path):
    done = analyze(tmp_path)
    assert done.returncode == 1
    assert done.stderr.startswith("analyze: ")
    assert done.stderr.count("\n") == 1


def test_trainings_get_their_learning_curves(tmp_path):
    train = [sys.executable, str(SCRIPT.with_name("train.py")), "--policy", "hold"]
    options = ["--episodes", "30", "--save-weights", str(tmp_path / "hold")]
    subprocess.run([*train, *options], check=True)
    done = analyze(tmp_path / "hold")
    assert (done.returncode, done.stderr) == (0, "")
    assert "| training | trials | episodes | hours |" in done.stdout
    assert (tmp_path / "hold" / "learning_curves.png").is_file()
