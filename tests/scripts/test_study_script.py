"""`scripts/study.py` as a person calls it: run, kill, go on, and on a cluster."""

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil  # type: ignore[import-untyped]  # comes with distributed
import pytest
from children import workers_of
from distributed import LocalCluster

from keepaway_transfer.studies.results import read_results, read_trials
from keepaway_transfer.studies.study import load_study

SCRIPT = Path(__file__).parents[2] / "scripts/study.py"
TINY = load_study("tiny")
pytestmark = [
    pytest.mark.timeout(1200),  # the first trial on a machine waits for the compiler
    pytest.mark.xdist_group("study"),  # whole runs are played once, for all that are compared
]


def command(*arguments):
    return [sys.executable, str(SCRIPT), "tiny", "--workers", "1", *map(str, arguments)]


def study(*arguments):
    return subprocess.run(command(*arguments), capture_output=True, text=True, check=False)


def trials_in(folder):
    return sorted(read_trials(folder), key=lambda trial: trial.key)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that nothing interrupted, and what it said."""
    folder = tmp_path_factory.mktemp("study") / "whole"
    return folder, study("--out", folder)


@pytest.fixture(scope="module")
def whole_of_20(tmp_path_factory):
    """The folder of a run of 20 trials a row that nothing interrupted."""
    folder = tmp_path_factory.mktemp("study") / "whole"
    study("--out", folder, "--trials", 20)
    return folder


def test_a_study_runs_to_its_end_and_tells_how_far_it_is(whole):
    folder, done = whole
    assert done.returncode == 0, done.stderr
    assert len(trials_in(folder)) == 12
    lines = [line for line in done.stderr.splitlines() if "time left" in line]
    assert lines[0] == "study: 0/12 trials, time left unknown"  # nothing is waited for in silence
    assert lines[-1] == "study: 12/12 trials, time left 0 min"
    assert (folder / "trials.parquet").exists()
    assert len(read_results(folder).records) == 12
    head = json.loads((folder / "study.json").read_text())
    assert head["command"].startswith("scripts/study.py tiny")
    assert head["study"]["seed"] == TINY.seed


@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ([signal.SIGKILL], -9),
        ([signal.SIGINT, signal.SIGINT], 130),
        ([signal.SIGTERM], 143),
        ([signal.SIGHUP], 129),
    ],
)
def test_a_run_that_was_stopped_goes_on_to_the_same_results(whole_of_20, tmp_path, signals, code):
    log = tmp_path / "cut" / "trials.jsonl"
    arguments = ("--out", log.parent, "--batch", 1, "--trials", 20)
    with subprocess.Popen(command(*arguments), stderr=subprocess.PIPE, text=True) as running:
        while not log.exists() or log.read_bytes().count(b"\n") < 2:
            assert running.poll() is None
            time.sleep(0.01)
        workers = psutil.Process(running.pid).children()
        for number in signals:
            running.send_signal(number)
            time.sleep(0.05)
        _, said = running.communicate(timeout=900)
    assert running.returncode == code
    assert "Traceback" not in said
    assert "resource_tracker" not in said
    if code > 0:
        last = said.splitlines()[-1]
        assert last == f"study: stopped; continue with --resume --out {log.parent}"
    assert psutil.wait_procs(workers, timeout=900)[1] == []  # none is left behind
    before = len(trials_in(log.parent))
    done = study(*arguments, "--resume")
    assert done.returncode == 0, done.stderr
    assert f"study: {before + 1}/60 trials" in done.stderr
    assert trials_in(log.parent) == trials_in(whole_of_20)


def test_a_worker_that_is_killed_is_replaced_and_the_study_ends_with_the_same(whole, tmp_path):
    arguments = ("--out", tmp_path / "out", "--workers", 2, "--batch", 1)
    with subprocess.Popen(command(*arguments), stderr=subprocess.PIPE, text=True) as running:
        while not (workers := workers_of(running.pid)):
            assert running.poll() is None
            time.sleep(0.01)
        workers[0].kill()
        _, said = running.communicate(timeout=900)
    assert running.returncode == 0, said
    assert "was ended by SIGKILL (out of memory?); what it played is played again" in said
    assert "Traceback" not in said
    assert trials_in(tmp_path / "out") == trials_in(whole[0])


def test_results_in_the_way_are_refused_in_one_line(whole):
    done = study("--out", whole[0])
    assert done.returncode == 1
    assert "add --resume to continue, or name another folder" in done.stderr


def test_two_processes_give_the_same_results(whole, tmp_path):
    done = study("--out", tmp_path / "two", "--workers", 2, "--batch", 3)
    assert done.returncode == 0, done.stderr
    assert trials_in(tmp_path / "two") == trials_in(whole[0])


def test_a_cluster_of_two_workers_gives_the_same_results(whole, tmp_path):
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        done = study(
            "--out", tmp_path / "x", "--scheduler", cluster.scheduler_address, "--batch", 2
        )
    assert done.returncode == 0, done.stderr
    assert trials_in(tmp_path / "x") == trials_in(whole[0])


def test_trials_that_are_known_are_not_played_again(whole, tmp_path):
    done = study("--out", tmp_path / "more", "--trials", 5, "--known", whole[0])
    assert done.returncode == 0, done.stderr
    assert "study: 12 trials are known; playing 3 of them again" in done.stdout
    assert len(trials_in(tmp_path / "more")) == 3  # the fifth of each row
    records = read_results(tmp_path / "more").records
    assert len(records) == 15
    assert set(read_results(whole[0]).records) < set(records)


def test_known_results_that_are_not_there_are_refused_in_one_line(tmp_path):
    done = study("--out", tmp_path / "out", "--known", tmp_path / "none")
    assert done.returncode == 1
    assert (
        done.stderr.strip() == f"study: {tmp_path / 'none'} holds no results: it has no study.json"
    )
