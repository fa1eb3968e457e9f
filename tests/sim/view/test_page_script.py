"""The page's script: checked by eslint, and what it works out tested without a browser."""

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[3]
WEB = ROOT / "src/keepaway_sim/keepaway_sim/view/web"
NODE = shutil.which("node")
ESLINT = ROOT / "node_modules/.bin/eslint"

needs_node = pytest.mark.skipif(NODE is None, reason="no node here")


def value(expression: str) -> Any:
    """What an expression of pure.js is."""
    assert NODE
    script = f"{(WEB / 'pure.js').read_text()}; console.log(JSON.stringify({expression}))"
    done = subprocess.run([NODE, "-e", script], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.skipif(not ESLINT.is_file(), reason="no eslint here: npm install")
def test_scripts_pass_eslint() -> None:
    done = subprocess.run([ESLINT, "src", "tests"], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


@needs_node
def test_a_cycle_beyond_16_bits_is_put_together() -> None:
    assert value("[cycleNumber(7, 0), cycleNumber(0, 1), cycleNumber(32767, 3)]") == [
        7, 32768, 4 * 32768 - 1,
    ]  # fmt: skip


@needs_node
def test_keepers_are_ranked_as_the_learner_ranked_them() -> None:
    """K1 at 0, the ball at 10; keeper 1 is nearer to K1, keeper 2 to the ball."""
    places = [[0, 0], [3, 0], [8, 0], [-5, 0], [10, 0]]
    for player, ordering, expected in (
        (0, "ball", [2, 1]), (0, "k1", [1, 2]), (3, "ball", [1, 0]), (3, "k1", [1, 0]),
    ):  # fmt: skip
        assert value(f"ranked({places}, 3, {player}, '{ordering}')") == expected


@needs_node
def test_the_chart_shows_the_longest_of_few_episodes() -> None:
    assert value("chartTop([5, 6, 100])") == pytest.approx(110)
    assert value("chartTop([...Array(999).fill(10), 500])") == pytest.approx(11)


@needs_node
def test_a_moving_mean_is_of_the_last_values() -> None:
    assert value("movingMean([2, 4, 6, 8], 2)") == [2, 3, 5, 7]


@needs_node
def test_frames_are_unpacked_when_they_are_asked_for_first() -> None:
    made = "(() => { let n = 0; const e = {}; whenAskedFor(e, 'f', () => { n += 1; return [n]; });"
    assert value(f"{made} return [n, e.f, e.f, n]; }})()") == [0, [1], [1], 1]
    assert value("framesOf(btoa('\\x01\\x00\\xff\\xff'), 1).map((f) => f[0])") == [1, -1]
