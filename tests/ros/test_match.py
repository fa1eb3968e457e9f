"""scripts/match.py as a person runs it: every player a process of its own."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from graph import Played, played, trained

from keepaway_agent.learning.weights import load_weights, read_weights
from keepaway_sim.bags.reader import BagReader

ROOT = Path(__file__).resolve().parents[2]
KEEPERS = ("keeper_1", "keeper_2", "keeper_3")
PATIENCE = 900.0  # [s] for a match; a first start compiles

pytestmark = pytest.mark.usefixtures("ros_domain")


def start(*arguments: str) -> "subprocess.Popen[str]":
    command = [sys.executable, str(ROOT / "scripts" / "match.py"), "--json", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def finish(match: "subprocess.Popen[str]") -> tuple[dict[str, Any], str]:
    """Its JSON object, and what it said on standard error."""
    out, err = match.communicate(timeout=PATIENCE)
    lines = out.splitlines()
    return (json.loads(lines[-1]) if lines else {}), err


def episodes(summary: dict[str, Any]) -> Played:
    return list(zip(summary["episode_cycles"], summary["episode_outcomes"], strict=True))


def wait_for(match: "subprocess.Popen[str]", condition: Callable[[], Any]) -> None:
    """Wait for something that a match brings about, which one that has ended does not."""
    until = time.monotonic() + PATIENCE
    while not condition():
        assert match.poll() is None, match.communicate()[1]
        assert time.monotonic() < until, "it never happened"
        time.sleep(0.05)


def nodes_of(match: "subprocess.Popen[str]") -> dict[str, int]:
    """The ids of the processes it started, by node name."""
    found = {}
    for child in Path(f"/proc/{match.pid}/task/{match.pid}/children").read_text().split():
        if name := re.search(r"__node:=(\w+)", Path(f"/proc/{child}/cmdline").read_text()):
            found[name[1]] = int(child)
    return found


def test_two_matches_with_one_seed_are_identical_and_what_the_trainer_plays(
    tmp_path: Path,
) -> None:
    arguments = ["--episodes", "3", "--seed", "5", "--keeper-policy", "learn"]
    summaries = [
        finish(start(*arguments, "--save-weights", str(tmp_path / run)))[0] for run in "ab"
    ]
    expected = trained(3, seed=5, policy="learn")
    assert episodes(summaries[0]) == episodes(summaries[1]) == played(expected)
    assert expected.keeper_weights is not None
    for keeper, weights in zip(KEEPERS, expected.keeper_weights, strict=True):
        for run in "ab":
            saved = load_weights(tmp_path / run / f"{keeper}.npz")
            np.testing.assert_array_equal(saved.values, weights)
    one = summaries[0]
    assert (one["task"], one["episodes"], one["seed"], one["troubles"]) == ("3v2", 3, 5, {})
    durations = [cycles / 10 for cycles in one["episode_cycles"]]
    assert one["mean_duration_s"] == pytest.approx(np.mean(durations))
    assert one["sem_duration_s"] is None  # a match of learners is one trial
    assert one["cycles_per_second"] > 0


def test_two_matches_at_once_do_not_hear_each_other() -> None:
    arguments = ["--episodes", "3", "--keeper-policy", "random"]
    first = start(*arguments, "--namespace", "/one", "--seed", "1")
    second = start(*arguments, "--namespace", "/two", "--seed", "2")
    for seed, match in ((1, first), (2, second)):
        summary, _ = finish(match)
        assert episodes(summary) == played(trained(3, seed=seed, policy="random"))


def test_ctrl_c_leaves_weights_and_bag_whole(tmp_path: Path) -> None:
    weights, bag = tmp_path / "weights", tmp_path / "bag"
    arguments = ["--keeper-policy", "learn", "--save-weights", str(weights), "--record", str(bag)]
    match = start(*arguments)
    wait_for(match, lambda: list(bag.glob("*.mcap")) and bag.stat().st_size)
    wait_for(match, lambda: any(file.stat().st_size > 100_000 for file in bag.glob("*.mcap")))
    match.send_signal(signal.SIGINT)
    summary, _ = finish(match)
    assert match.returncode == 130
    assert summary["episodes"] > 0
    for keeper in KEEPERS:
        assert load_weights(weights / f"{keeper}.npz").episodes == summary["episodes"]
    assert (bag / "metadata.yaml").is_file()
    ended = BagReader(bag).messages(["/episode"])
    assert len(list(ended)) == summary["episodes"]


def test_a_player_that_is_killed_is_named_and_the_match_goes_on() -> None:
    match = start("--episodes", "60", "--keeper-policy", "random")
    wait_for(match, lambda: "keeper_2" in nodes_of(match))
    assert match.stderr is not None
    line = match.stderr.readline()
    while "episode" not in line:
        line = match.stderr.readline()
        assert line, "it has ended"
    os.kill(nodes_of(match)["keeper_2"], signal.SIGKILL)
    summary, err = finish(match)
    assert match.returncode == 0
    assert "keeper_2 ended with code -9" in err
    assert "keeper_2 timed out" in err
    assert len(summary["episode_cycles"]) == 60
    assert summary["troubles"]["keeper_2"]["missed"] > 0


def test_a_player_that_is_killed_comes_back_with_what_it_saved(tmp_path: Path) -> None:
    weights = tmp_path / "keeper_2.npz"
    arguments = ["--keeper-policy", "learn", "--save-weights", str(tmp_path)]
    match = start(*arguments, "--save-every", "5", "--restart")
    wait_for(match, lambda: "keeper_2" in nodes_of(match) and weights.exists())
    first = nodes_of(match)["keeper_2"]
    saved = load_weights(weights).episodes
    os.kill(first, signal.SIGKILL)
    wait_for(match, lambda: nodes_of(match).get("keeper_2", first) != first)
    wait_for(match, lambda: load_weights(weights).episodes > saved)
    match.send_signal(signal.SIGINT)
    summary, err = finish(match)
    assert "keeper_2 ended with code -9" in err
    # it may be back before its team-mates have gone on without it
    assert saved < load_weights(weights).episodes <= summary["episodes"]
    assert load_weights(tmp_path / "keeper_1.npz").episodes == summary["episodes"]


def test_the_bag_of_a_simulator_that_was_started_again_carries_the_weights_of_then(
    tmp_path: Path,
) -> None:
    weights, bag = tmp_path / "weights", tmp_path / "bag"
    arguments = ["--keeper-policy", "learn", "--save-weights", str(weights), "--record", str(bag)]
    match = start(*arguments, "--save-every", "2", "--restart")
    wait_for(match, lambda: all((weights / f"{keeper}.npz").exists() for keeper in KEEPERS))
    os.kill(nodes_of(match)["simulator"], signal.SIGKILL)
    again = tmp_path / "bag_2"
    wait_for(match, lambda: any(file.stat().st_size > 100_000 for file in again.glob("*.mcap")))
    match.send_signal(signal.SIGINT)
    finish(match)
    attached = {name: read_weights(BytesIO(data)) for name, data in BagReader(again).attachments()}
    assert sorted(attached) == [f"{keeper}.npz" for keeper in KEEPERS]
    for name, known in attached.items():
        assert 0 < known.episodes < load_weights(weights / name).episodes


def test_a_player_that_does_not_come_is_named() -> None:
    match = start("--episodes", "1", "--taker-agent", f"{sys.executable} -c pass")
    summary, err = finish(match)
    assert match.returncode == 1
    assert summary == {}
    assert "taker_1 did not join: its process ended with code 0" in err or "taker_2 did not" in err


def test_an_agent_of_ones_own_plays_with_ordinary_messages() -> None:
    plain = Path(__file__).with_name("plain_keeper.py")
    patient = "--answer-timeout", "60"  # no answer is late because the machine is busy
    summary, _ = finish(start("--episodes", "2", "--keeper-agent", str(plain), *patient))
    assert summary["troubles"] == {}
    assert episodes(summary) == played(trained(2, policy="hold"))


def test_a_match_that_went_on_without_an_agent_that_failed_ends_with_code_1(tmp_path: Path) -> None:
    text = (Path(__file__).with_name("plain_keeper.py")).read_text(encoding="utf-8")
    failing = tmp_path / "failing.py"
    failing.write_text(text.replace("ActionRequest.HOLD_BALL", "ActionRequest.NO_SUCH_ACTION"))
    match = start("--episodes", "2", "--agent", f"keeper_1={failing}", "--answer-timeout", "1")
    summary, err = finish(match)
    assert match.returncode == 1
    assert len(episodes(summary)) == 2
    assert "keeper_1 ended with code 1; the match continues without it" in err


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--task", "three"], "task='three'"),
        (["--field", "1x1"], "field_length=1"),
        (["--load-weights", "/none.npz", "--keeper-policy", "greedy"], "did not join"),
    ],
)
def test_a_match_that_makes_no_sense_is_refused_in_a_line(arguments: list[str], why: str) -> None:
    match = start("--episodes", "1", *arguments)
    _, err = finish(match)
    assert match.returncode == 1
    assert why in err
    assert "Traceback" not in err


def test_nothing_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "keeper_1.npz").touch()
    for option in ("--record", "--save-weights"):
        match = start("--episodes", "1", option, str(tmp_path))
        _, err = finish(match)
        assert match.returncode == 1
        assert f"{option} {tmp_path}" in err
