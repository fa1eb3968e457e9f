"""Whatever others wrote is taken as valid or refused: a short run of scripts/checks/fuzz.py."""

import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "checks" / "fuzz.py"


def test_broken_input_is_refused_and_breaks_nothing(tmp_path: Path) -> None:
    command = [sys.executable, str(SCRIPT), "--cases", "3000"]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert done.returncode == 0, done.stderr[-2000:]
    rows = [line.rsplit(maxsplit=5) for line in done.stdout.splitlines()[1:-1]]
    assert len(rows) >= 13
    for name, _, accepted, refused, *_ in rows:
        assert int(accepted.replace(",", "")) > 0, name
        assert int(refused.replace(",", "")) > 0, name


@pytest.mark.parametrize("words", ["pickle.load", "eval(", "exec(", "shell=True", "os.system"])
def test_nothing_that_is_shipped_runs_what_it_reads(words: str) -> None:
    root = SCRIPT.parents[1]
    files = [*root.glob("src/*/keepaway_*/**/*.py"), *root.glob("scripts/**/*.py")]
    assert not [path.name for path in files if words in path.read_text()]
