"""The demo removes what a demo made, and nothing that is anybody else's."""

import subprocess
import sys
from pathlib import Path

import pytest

from keepaway_agent.learning.weights import load_weights, save_weights

SCRIPT = Path(__file__).parents[2] / "scripts/demo.py"


def demo(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(SCRIPT), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def begin(out: Path) -> subprocess.CompletedProcess[str]:
    code = "import sys, demo, pathlib; demo.begin(pathlib.Path(sys.argv[1]))"
    command = [sys.executable, "-c", code, str(out)]
    return subprocess.run(command, capture_output=True, text=True, check=False, cwd=SCRIPT.parent)


def test_a_folder_that_no_demo_made_is_refused_and_left_as_it_was(tmp_path: Path) -> None:
    letter = tmp_path / "letter.txt"
    letter.write_text("Dear Sir")
    done = demo("--out", tmp_path)
    assert done.returncode == 1
    assert done.stderr == (
        f"demo: {tmp_path} holds something that no demo made: name another folder (--out)\n"
    )
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]
    assert letter.read_text() == "Dear Sir"


def test_of_an_earlier_demo_only_what_it_made_is_removed(tmp_path: Path) -> None:
    out = tmp_path / "demo"
    assert begin(out).returncode == 0
    (out / "3v2_bag").mkdir()
    (out / "3v2_bag" / "bag.mcap").touch()
    (out / "notes.txt").write_text("mine")
    elsewhere = tmp_path / "weights"
    elsewhere.mkdir()
    (elsewhere / "keeper_1.npz").touch()
    (out / "3v2_nodes").symlink_to(elsewhere)
    done = begin(out)
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in out.iterdir()) == ["made_by_the_demo.txt", "notes.txt"]
    assert (elsewhere / "keeper_1.npz").exists()


def test_a_place_that_is_no_folder_is_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    done = demo("--out", tmp_path / "file")
    assert done.returncode == 1
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.usefixtures("ros_domain")
def test_weights_are_carried_over_in_any_folder(tmp_path: Path) -> None:
    from graph import weights_of  # it imports rclpy

    source, target = (
        tmp_path / "a: b" / "trial_0000" / "keeper_1.npz",
        tmp_path / "a: b" / "4v3.npz",
    )
    source.parent.mkdir(parents=True)
    save_weights(source, weights_of())
    code = "import demo, pathlib, sys; demo.transfer_by_node(*map(pathlib.Path, sys.argv[1:]))"
    command = [sys.executable, "-c", code, str(source), str(target)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=SCRIPT.parent)
    assert done.returncode == 0, done.stderr
    assert load_weights(target).task == "4v3"


def test_the_tables_errors_are_by_trial() -> None:
    code = """
import demo, numpy as np
trials = [np.full(400, 4.0), np.full(400, 6.0)]
print(demo.table({"from scratch": trials}))
"""
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, text=True, check=True, cwd=SCRIPT.parent)
    _, first, last = done.stdout.splitlines()
    assert first.split()[-2:] == last.split()[-2:] == ["5.00", "1.00"]
