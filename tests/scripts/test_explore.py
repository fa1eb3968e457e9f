"""The script that a researcher starts from, as a person runs it."""

import subprocess
import sys
from pathlib import Path

from pandas import read_parquet
from PIL import Image


def explore(root: Path, *arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(root / "scripts/explore.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_a_bag_and_a_study_become_tables_and_three_plots(
    root: Path, bag_3v2: Path, tmp_path: Path
) -> None:
    study, figure = root / "src/keepaway_transfer/results/table2", tmp_path / "new/explore.png"
    done = explore(root, bag_3v2, study, "--out", figure)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert lines[-1] == f"drew {figure}"
    assert next(line for line in lines if "taker_distance" in line).split()[-2:] == [
        "passes",
        "taker_distance",
    ]
    counts = [float(line.split()[1]) for line in lines if line.startswith(("OUT_OF", "TAKEN"))]
    assert sum(counts) == 4  # episodes of the bag
    names = sorted(read_parquet(study / "trials.parquet").row.unique(), key=int)
    assert names[:2] == ["0", "10"]
    assert [line.split()[0] for line in lines[-len(names) - 2 : -1]] == ["row", *names]
    with Image.open(figure) as picture:
        assert picture.size[0] > 1000


def test_what_is_no_bag_or_no_study_is_refused_in_one_line(root: Path, bag_3v2: Path) -> None:
    for bag, study, words in (("nowhere", root, "no bag there"), (bag_3v2, root, "no results")):
        done = explore(root, bag, study)
        assert done.returncode == 1
        assert done.stderr.startswith("explore: ")
        assert words in done.stderr
        assert done.stderr.count("\n") == 1
