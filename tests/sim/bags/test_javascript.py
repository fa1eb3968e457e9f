"""The third independent reader: JavaScript's MCAP library, the one inside Foxglove."""

import json
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from keepaway_sim.bags.reader import BagReader

PACKAGES = (
    "@mcap/core@2.2.2",
    "@foxglove/rosmsg@5.0.5",
    "@foxglove/rosmsg2-serialization@3.1.0",
    "fzstd@0.1.1",
)


@pytest.fixture(scope="module")
def modules(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the packages; npm keeps them for the next time."""
    if not shutil.which("npm") or not shutil.which("node"):
        pytest.skip("no node and npm here; to run this test: apt-get install nodejs npm")
    folder = tmp_path_factory.mktemp("javascript")
    options = ["--prefix", str(folder), "--prefer-offline", "--no-audit", "--no-fund"]
    done = subprocess.run(
        ["npm", "install", *options, "--ignore-scripts", "--no-save", *PACKAGES],
        capture_output=True,
        text=True,
        cwd=folder,
    )
    if done.returncode:
        pytest.skip(f"npm cannot install {', '.join(PACKAGES)}: {done.stderr.strip()[-200:]}")
    return folder


def test_javascript_reads_the_same_counts_and_values(modules: Path, bag_3v2: Path) -> None:
    script = Path(__file__).with_name("read_bag.mjs")
    file = next(bag_3v2.glob("*.mcap"))
    told = subprocess.run(
        ["node", str(script), str(modules), str(file)], capture_output=True, text=True, check=True
    ).stdout
    theirs, ours = json.loads(told), BagReader(bag_3v2)
    assert theirs["profile"] == "ros2"
    assert theirs["counts"] == ours.counts
    for topic, total in theirs["sums"].items():
        batches = [batch.data["positions"] for batch in ours.batches([topic])]
        assert total == pytest.approx(np.concatenate(batches).sum())
    assert len(theirs["sums"]) == 6
