"""The scripts that measure and watch: what they print is what they saw."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).resolve().parents[2]


def load(name: str) -> ModuleType:
    """A script as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / f"scripts/checks/{name}.py")
    assert spec
    assert spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def benchmark() -> ModuleType:
    return load("benchmark")


@pytest.fixture(scope="module")
def endurance() -> ModuleType:
    return load("endurance")


def test_a_short_benchmark_of_the_world_has_all_its_figures() -> None:
    command = [sys.executable, str(ROOT / "scripts/checks/benchmark.py"), "--only", "world"]
    options = ["--fields", "4", "--cycles", "400", "--json"]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout.splitlines()[-1])
    expected = {"floor_us", "world_3v2_us", "learn_3v2_us", "learn_4v3_us", "learn_5v4_us"}
    parts = {f"3v2_{part}_us" for part in ("commands", "pymunk", "perception", "decisions")}
    assert expected | parts | {"peak_rss_mb"} <= set(figures)
    assert all(value > 0 for name, value in figures.items() if name in expected | parts)


def test_a_benchmarks_table_has_ratios_to_the_floor(benchmark: ModuleType) -> None:
    lines = benchmark.table({"floor_us": 2.0, "world_us": 5.0, "compile_cold_s": 9.0}).splitlines()
    assert lines[2].split() == ["world_us", "5.00", "2.5", "x", "floor"]
    assert lines[3].split() == ["compile_cold_s", "9.00"]


def test_the_performance_page_is_written_from_what_is_kept() -> None:
    page = load("performance_page")
    kept = json.loads(page.KEPT.read_text())
    assert len(kept["runs"]) >= 3
    assert page.written(page.PAGE.read_text(), kept) == page.PAGE.read_text()


def test_a_line_of_the_performance_page_has_median_range_and_ratio() -> None:
    page = load("performance_page")
    runs = [
        {"floor_us": floor, "learn_3v2_us": value}
        for floor, value in ((1.0, 6.0), (2.0, 8.0), (1.0, 7.0))
    ]
    row = page.Row("learning", "learn_3v2_us", base="floor_us")
    assert page.line(row, runs) == "| learning | 7.0 us (6.0 us to 8.0 us) | 6.00 x the floor |"
    row = page.Row("floor", "floor_us", "{:.2f} us")
    assert page.line(row, runs[:1]) == "| floor | 1.00 us |  |"


def test_what_grows_is_named_and_what_was_warming_up_is_not(
    endurance: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    steady = [endurance.Sample(100.0 + min(k, 5), 10, 3) for k in range(40)]
    samples = {
        "steady": steady,
        "leaking": [endurance.Sample(100.0 + k, 10, 3) for k in range(40)],
        "opening": [endurance.Sample(100.0, 10 + k, 3) for k in range(40)],
    }
    assert endurance.show(samples) == ["leaking", "opening"]
    rows = capsys.readouterr().out.splitlines()
    assert rows[1].split()[:4] == ["steady", "105.0", "->", "105.0"]
    assert all(row.endswith(" 40") for row in rows[1:])


def test_a_sample_is_what_a_process_uses(endurance: ModuleType) -> None:
    before = endurance.sample(os.getpid())
    held = bytearray(64 * 2**20)
    held[::4096] = b"x" * len(held[::4096])
    with open(os.devnull) as _, open(os.devnull) as _:
        after = endurance.sample(os.getpid())
    assert after.memory - before.memory > 50
    assert after.handles == before.handles + 2
    assert before.threads >= 1


@pytest.mark.slow
def test_a_short_endurance_run_ends_with_a_table(ros_domain: int) -> None:
    command = [sys.executable, str(ROOT / "scripts/checks/endurance.py"), "--minutes", "0.2"]
    options = ["--domain", str(ros_domain), "--port", "0", "--answer-timeout", "60"]
    done = subprocess.run([*command, *options], capture_output=True, text=True, check=False)
    assert "nothing is missing" in done.stdout, done.stderr
    told = [line.split()[0] for line in done.stdout.splitlines() if "->" in line]
    assert {"recorder_0", "viewer", "match", "simulator", "keeper_1", "taker_2"} <= set(told)


def test_readers_of_small_hostile_bags_keep_to_their_limits(ros_domain: int) -> None:
    command = [sys.executable, str(ROOT / "scripts/checks/limits.py"), "--made", "1", "--domain"]
    done = subprocess.run([*command, str(ros_domain)], capture_output=True, text=True, check=False)
    rows = [line.rsplit(maxsplit=6) for line in done.stdout.splitlines()[1:]]
    assert [row[0] for row in rows] == [*load("limits").BAG_READERS]
    wrong = [line for line in done.stderr.splitlines() if not line.endswith("s of CPU")]
    assert wrong == []  # how long it takes depends on what else the machine does


def test_what_is_wrong_with_a_reader_is_said() -> None:
    faults = load("limits").faults
    assert list(faults("refused\n", [], 1, 1.0, 100.0)) == []
    page = '<script id="data" type="application/json">{"x":NaN}</script>'
    said = "Traceback (most recent call last):\n\x1b[31m"
    assert list(faults(said, [page], 139, 6.0, 501.0)) == [
        "code 139",
        "6.0 s of CPU",
        "501 MB",
        "a traceback",
        f"prints control characters: {said!a}",
        "NaN in a page",
    ]
    assert list(faults("", [], 1, 1.0, 100.0)) == ["refused without a word"]


def test_a_long_bag_gives_the_same_numbers_in_any_order_of_its_chunks() -> None:
    command = [sys.executable, str(ROOT / "scripts/checks/long_bag.py"), "--messages", "30000"]
    done = subprocess.run(
        [*command, "--episodes", "5"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("nothing is missing of") == 2
    assert done.stdout.endswith("the same numbers from both\n")
