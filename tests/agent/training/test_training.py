"""Trainings: the same in any number of processes, and gone on with after any interruption."""

import json
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

from keepaway_agent.actions import Outcome, Role
from keepaway_agent.errors import AgentError, WeightsError
from keepaway_agent.learning.config import LearnerConfig
from keepaway_agent.learning.weights import load_weights
from keepaway_agent.settings import build, changed
from keepaway_agent.training.folder import TrainingFolder
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import Progress
from keepaway_agent.training.workers import play_trials
from keepaway_sim.errors import KeepawayError

SCRIPT = Path(__file__).parents[3] / "scripts/train.py"
SHORT = Training(episodes=4, seed=11, learner=LearnerConfig(lambda_=0.2))


def train(*arguments):
    return subprocess.run(
        [sys.executable, SCRIPT, *map(str, arguments)], capture_output=True, text=True, check=False
    )


def by_number(results):
    return {result.trial.label: result for result in results}


def test_the_number_of_processes_and_fields_changes_nothing():
    told: list[Progress] = []
    alone = by_number(play_trials(SHORT, [0, 1, 2, 5], processes=1, num_fields=3))
    spread = by_number(
        play_trials(SHORT, [0, 1, 2, 5], processes=2, num_fields=1, watch=told.append)
    )
    assert sorted(alone) == sorted(spread) == [0, 1, 2, 5]
    for number, result in alone.items():
        np.testing.assert_array_equal(result.durations, spread[number].durations)
        np.testing.assert_array_equal(result.outcomes, spread[number].outcomes)
        np.testing.assert_array_equal(result.keeper_weights, spread[number].keeper_weights)
    assert told


def test_an_error_in_a_process_is_raised_here(tmp_path):
    lost = changed(SHORT, {"load_weights": str(tmp_path / "none.npz")})
    with pytest.raises(ValueError, match=r"none\.npz cannot be read"):
        list(play_trials(lost, [0, 1], processes=2))


def test_a_folder_holds_what_was_trained(tmp_path):
    training = changed(SHORT, {"taker_policy": "learn"})
    folder = TrainingFolder(tmp_path / "out", training, "scripts/train.py --episodes 4")
    (result,) = play_trials(training, [3])
    folder.save(result)
    assert folder.done == [3]
    durations, outcomes = folder.episodes(3)
    np.testing.assert_array_equal(durations, result.durations)
    np.testing.assert_array_equal(outcomes, result.outcomes)
    assert (tmp_path / "out/trial_0003/episodes.csv").read_text().splitlines()[0] == (
        "episode,cycles,outcome"
    )
    keeper = load_weights(tmp_path / "out/trial_0003/keeper_2.npz")
    taker = load_weights(tmp_path / "out/trial_0003/taker_1.npz")
    assert result.keeper_weights is not None
    assert result.taker_weights is not None
    np.testing.assert_array_equal(keeper.values, result.keeper_weights[1])
    np.testing.assert_array_equal(taker.values, result.taker_weights[0])
    assert (keeper.player, keeper.episodes, keeper.seed) == ("keeper_2", 4, 11)
    assert keeper.hours == pytest.approx(durations.sum() / 36000)
    assert keeper.sarsa.lambda_ == 0.2
    assert keeper.created_by == "scripts/train.py --episodes 4"
    assert taker.role == Role.TAKER
    assert not list((tmp_path / "out").glob(".*"))
    assert not list((tmp_path / "out").glob("*.npz"))  # those of the first trial only


@pytest.mark.parametrize(
    "row", [b"1,2", b"1,two,taken", b"1,2,lost", b"1,%d,taken" % 10**12, b"\x80"]
)
def test_episodes_that_something_else_changed_are_refused_with_their_path(row, tmp_path):
    folder = TrainingFolder(tmp_path / "out", SHORT)
    for result in play_trials(SHORT, [0]):
        folder.save(result)
    with open(tmp_path / "out/trial_0000/episodes.csv", "ab") as file:
        file.write(row + b"\n")
    with pytest.raises(AgentError, match=r"trial_0000/episodes\.csv: not a trial's episodes"):
        folder.episodes(0)


def test_the_first_trials_team_lies_in_the_folder_itself_and_can_be_trained_on(tmp_path):
    first = TrainingFolder(tmp_path / "first", SHORT)
    for result in play_trials(SHORT, [0]):
        first.save(result)
    names = sorted(file.name for file in first.path.glob("*.npz"))
    assert names == ["keeper_1.npz", "keeper_2.npz", "keeper_3.npz"]
    more = changed(SHORT, {"load_weights": str(first.path)})
    second = TrainingFolder(tmp_path / "second", more)
    for result in play_trials(more, [0]):
        second.save(result)
    earlier, later = (load_weights(f.path / "keeper_3.npz") for f in (first, second))
    assert later.episodes == 8
    assert later.hours > earlier.hours
    one = changed(SHORT, {"load_weights": str(first.path / "keeper_3.npz")})
    for weights in one.start():
        np.testing.assert_array_equal(weights.values, earlier.values)


def test_a_folder_is_gone_on_with_only_by_the_same_training(tmp_path):
    TrainingFolder(tmp_path, SHORT)
    assert TrainingFolder(tmp_path, SHORT).done == []
    with pytest.raises(AgentError, match=r"alpha=0\.125, not 0\.5: use the same settings, or name"):
        TrainingFolder(tmp_path, changed(SHORT, {"alpha": 0.5}))
    record = json.loads((tmp_path / "training.json").read_text())
    (tmp_path / "training.json").write_text(json.dumps(record | {"code_version": "0.0.1"}))
    with pytest.raises(AgentError, match=r"begun by version 0\.0\.1"):
        TrainingFolder(tmp_path, SHORT)
    assert TrainingFolder(tmp_path, SHORT, any_code=True).done == []
    (tmp_path / "training.json").write_text("{")
    with pytest.raises(AgentError, match=r"training\.json is no training's"):
        TrainingFolder(tmp_path, SHORT)


def test_a_folder_of_something_else_is_left_alone(tmp_path):
    (tmp_path / "letter.txt").write_text("Dear Sir")
    with pytest.raises(AgentError, match="holds something else"):
        TrainingFolder(tmp_path, SHORT)
    with pytest.raises(AgentError, match="cannot be used"):
        TrainingFolder(tmp_path / "letter.txt", SHORT)
    assert [file.name for file in tmp_path.iterdir()] == ["letter.txt"]


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"task": "1v2"}, "num_keepers=1"),
        ({"profile": "1999"}, "profile='1999'"),
        ({"epsilon": 2.0}, "epsilon=2.0"),
        ({"ordering": "size"}, "ordering='size'"),
        ({"tile_widths": "wide"}, "tile_widths='wide'"),
        ({"policy": "best"}, "keeper policy 'best'"),
        ({"taker_policy": "hold"}, "taker policy 'hold'"),
        ({"decision_interval": 0}, "interval=0"),
        ({"episodes": 0}, "episodes=0"),
        ({"hours": -1.0}, "hours=-1.0"),
        ({"seed": -1}, "seed=-1"),
    ],
)
def test_settings_with_which_nothing_can_be_trained_are_refused(settings, words):
    with pytest.raises((AgentError, KeepawayError), match=words):
        build(Training, settings)


def test_weights_of_another_task_are_refused(tmp_path):
    folder = TrainingFolder(tmp_path / "3v2", SHORT)
    for result in play_trials(SHORT, [0]):
        folder.save(result)
    larger = Training(task="4v3", load_weights=str(folder.path / "keeper_1.npz"))
    with pytest.raises(WeightsError, match=r"keeper in 3v2, not of a keeper in 4v3"):
        larger.start()
    team = Training(task="4v3", load_weights=str(folder.path))
    with pytest.raises(
        WeightsError, match=r"has no keeper_4.npz, and 4v3 has 4 keepers: .*transfer"
    ):
        team.start()


def test_the_script_says_how_it_went(tmp_path):
    done = train("--episodes", 5, "--trials", 2, "--policy", "hold", "--seed", 4, "--json")
    assert done.returncode == 0
    numbers = json.loads(done.stdout.splitlines()[-1])
    results = by_number(play_trials(Training(episodes=5, policy="hold", seed=4), [0, 1]))
    durations = np.concatenate([results[0].durations, results[1].durations]) * 0.1
    outcomes = np.concatenate([results[0].outcomes, results[1].outcomes])
    assert numbers["task"] == "3v2"
    assert (numbers["episodes"], numbers["trials"], numbers["seed"]) == (10, 2, 4)
    assert numbers["mean_duration_s"] == pytest.approx(durations.mean())
    first, second = (results[k].durations.mean() * 0.1 for k in (0, 1))
    assert numbers["sem_duration_s"] == pytest.approx(abs(first - second) / 2)  # by trial
    assert numbers["out_of_bounds_share"] == (outcomes == Outcome.OUT_OF_BOUNDS).mean()
    assert numbers["simulated_hours"] == pytest.approx(durations.sum() / 3600)


@pytest.mark.parametrize(("policy", "is_known"), [("hold", True), ("learn", False)])
def test_one_trial_has_an_error_only_where_nobody_learns(policy, is_known):
    done = train("--episodes", 5, "--policy", policy, "--json")
    error = json.loads(done.stdout.splitlines()[-1])["sem_duration_s"]
    assert (error is not None) == is_known


def test_a_seed_gives_one_hash_of_the_weights_in_every_run_on_any_number_of_processes(tmp_path):
    hashes = []
    for processes, fields, seed in ((1, 2, 7), (2, 1, 7), (2, 1, 8)):
        folder = tmp_path / f"{processes}_{seed}"
        spread = ["--processes", processes, "--fields", fields, "--save-weights", folder]
        done = train("--episodes", 20, "--trials", 2, "--seed", seed, *spread, "--json")
        assert done.returncode == 0, done.stderr
        assert len(list(folder.glob("trial_*/keeper_*.npz"))) == 6
        hashes.append(json.loads(done.stdout.splitlines()[-1])["weights_sha256"])
    assert hashes[0] == hashes[1] != hashes[2]


def test_a_refusal_is_one_line():
    done = train("--task", "3v0")
    assert done.returncode == 1
    assert done.stderr.startswith("train: num_takers=0")
    assert len(done.stderr.splitlines()) == 1


def test_a_training_that_was_killed_leaves_no_process_behind(tmp_path):
    options = ["--episodes", "100000", "--trials", "2", "--processes", "2"]
    with subprocess.Popen([sys.executable, str(SCRIPT), *options]) as killed:
        workers: list[psutil.Process] = []
        while len(workers) < 2:
            time.sleep(0.1)
            workers = workers_of(killed.pid)
        killed.kill()
    assert psutil.wait_procs(workers, timeout=900)[1] == []


def test_a_training_stopped_by_ctrl_c_goes_on_where_it_was(tmp_path):
    out = tmp_path / "out"
    options = ["--episodes", "300", "--trials", "6", "--fields", "1", "--processes", "2"]
    command = [
        sys.executable,
        str(SCRIPT),
        *options,
        "--save-weights",
        str(out),
        "--any-code",
        "--json",
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as stopped:
        deadline = time.monotonic() + 900
        while not list(out.glob("trial_*")) and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(stopped.pid, signal.SIGINT)
        _, said = stopped.communicate(timeout=900)
    assert stopped.returncode == 130
    assert b"the same command continues" in said
    finished = {path: path.stat().st_mtime_ns for path in out.glob("trial_*")}
    assert 1 <= len(finished) < 6
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(again.stdout)["trials"] == 6
    assert {path: path.stat().st_mtime_ns for path in finished} == finished
    whole = by_number(play_trials(Training(episodes=300), range(6)))
    folder = TrainingFolder(out, Training(episodes=300), any_code=True)
    for number in range(6):
        np.testing.assert_array_equal(folder.episodes(number)[0], whole[number].durations)
