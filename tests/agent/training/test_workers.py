"""A training's processes may be killed: what they played is played again, nothing else changes."""

import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil  # type: ignore[import-untyped]
import pytest
from children import workers_of

from keepaway_agent.errors import AgentError
from keepaway_agent.training import workers
from keepaway_agent.training.folder import TrainingFolder
from keepaway_agent.training.processes import Worker
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import Progress
from keepaway_sim.bags.match_bag import MatchBag

SCRIPT = Path(__file__).parents[3] / "scripts/train.py"
TRAINING = Training(episodes=40, seed=11)


def test_what_a_killed_process_had_is_played_again_and_gives_the_same(caplog, tmp_path):
    alone = {r.trial.label: r for r in workers.play_trials(TRAINING, range(6))}
    killed: list[int] = []

    def kill_one(_: Progress) -> None:
        # the first may have had nothing to play when it was killed
        if len(killed) < 2 and "; trials " not in caplog.text:
            for worker in workers_of(os.getpid())[:1]:
                killed.append(worker.pid)
                worker.kill()

    recorder = TRAINING.recorder(tmp_path / "bag")
    spread = {}
    for result in workers.play_trials(TRAINING, range(6), 2, 2, kill_one, recorder):
        assert result.trial.label not in spread
        spread[result.trial.label] = result
    assert killed
    assert caplog.record_tuples[0][1] == logging.WARNING
    assert "was ended by SIGKILL (out of memory?); trials " in caplog.text
    assert sorted(spread) == list(range(6))
    for number, result in alone.items():
        np.testing.assert_array_equal(result.durations, spread[number].durations)
        np.testing.assert_array_equal(result.keeper_weights, spread[number].keeper_weights)
    bags = [MatchBag(path) for path in tmp_path.iterdir() if (path / "metadata.yaml").exists()]
    (whole,) = (bag for bag in bags if bag.reader.complete)
    assert [episode.cycles for episode in whole.episodes()] == alone[0].durations.tolist()


def test_processes_that_are_killed_again_and_again_end_the_run_in_words(monkeypatch):
    def kill_all(_: Progress) -> None:
        for worker in workers_of(os.getpid()):
            worker.kill()

    endless = Training(episodes=10**6)
    with pytest.raises(AgentError, match=r"in a row were lost, the last was ended by SIGKILL"):
        list(workers.play_trials(endless, range(2), 2, 1, kill_all))
    assert workers_of(os.getpid()) == []


def _fail(_pipe: object) -> None:
    os._exit(3)


def test_a_process_that_fails_by_itself_is_not_started_again(monkeypatch):
    monkeypatch.setattr(workers, "_work", lambda *_: None)
    monkeypatch.setattr(workers, "Worker", lambda *_: Worker(_fail))
    with pytest.raises(AgentError, match="ended with code 3"):
        list(workers.play_trials(TRAINING, range(2), 2))


def test_two_trainings_do_not_write_into_one_folder(tmp_path):
    first, second = (TrainingFolder(tmp_path, TRAINING) for _ in range(2))
    with (
        first.lock(),
        pytest.raises(AgentError, match="another process trains into it"),
        second.lock(),
    ):
        pass
    with second.lock():
        pass


@pytest.mark.parametrize(
    ("signals", "code"),
    [
        ([signal.SIGINT], 130),
        ([signal.SIGINT, signal.SIGINT], 130),
        ([signal.SIGTERM], 143),
        ([signal.SIGHUP], 129),
    ],
)
def test_a_signal_ends_a_training_with_what_is_finished_saved(tmp_path, signals, code):
    out = tmp_path / "out"
    command = [sys.executable, SCRIPT, "--episodes", "300", "--trials", "1000", "--fields", "1"]
    command += ["--processes", "2", "--save-weights", out, "--any-code"]
    with subprocess.Popen(
        [str(word) for word in command], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    ) as stopped:
        while not list(out.glob("trial_*")):
            assert stopped.poll() is None
            time.sleep(0.02)
        started = workers_of(stopped.pid)
        for number in signals:
            stopped.send_signal(number)
            time.sleep(0.05)
        _, said = stopped.communicate(timeout=900)
    assert stopped.returncode == code
    assert said.decode().splitlines()[-1:] == [
        "train: stopped; the same command continues from here"
    ], said.decode()
    assert "Traceback" not in said.decode()
    assert "resource_tracker" not in said.decode()
    assert psutil.wait_procs(started, timeout=900)[1] == []
    for trial in out.glob("trial_*"):
        assert sorted(file.name for file in trial.iterdir()) == [
            "episodes.csv",
            "keeper_1.npz",
            "keeper_2.npz",
            "keeper_3.npz",
        ]
