"""scripts/check_agent.py as a person runs it: built-in players pass, one that misbehaves fails."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from graph import Graph

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "src" / "keepaway_agent" / "examples"

pytestmark = pytest.mark.usefixtures("ros_domain")


def check(*arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(ROOT / "scripts" / "check_agent.py"), "--answer-timeout", "20"]
    return subprocess.run(
        [*command, *map(str, arguments)], cwd=ROOT, capture_output=True, text=True, timeout=900
    )


@pytest.mark.parametrize(
    ("arguments", "num_sentences"),
    [
        (["--one-size", "--", "scripts/keeper.py", "--policy", "learn"], 13),
        (["--name", "taker_2", "--", "scripts/taker.py"], 14),
        (["--name", "keeper_3", "--", EXAMPLES / "smallest_agent.py"], 14),
        (["--name", "keeper_1", "--", EXAMPLES / "rule_keeper.py"], 14),
        (["--name", "keeper_2", "--", EXAMPLES / "network_keeper.py"], 14),
        (["--name", "keeper_3", "--", EXAMPLES / "dds_keeper.py"], 14),
    ],
    ids=["keeper", "taker", "smallest", "rule", "network", "dds"],
)
def test_they_keep_to_the_contract(arguments: list[object], num_sentences: int) -> None:
    checked = check(*arguments)
    assert checked.stdout.endswith(f"{num_sentences} of {num_sentences} sentences hold\n"), (
        checked.stdout + checked.stderr
    )
    assert checked.returncode == 0


@pytest.mark.skipif(
    not (EXAMPLES / "javascript" / "node_modules" / "rclnodejs" / "build" / "Release").is_dir(),
    reason="rclnodejs is not built: src/keepaway_agent/examples/javascript/setup does it",
)
def test_the_agent_in_javascript_keeps_to_the_contract() -> None:
    checked = check("--", EXAMPLES / "javascript" / "run")
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_what_an_agent_does_wrong_is_said(tmp_path: Path) -> None:
    text = (EXAMPLES / "smallest_agent.py").read_text()
    agent = tmp_path / "rude.py"
    agent.write_text(
        text.replace("ActionRequest.GET_OPEN", "ActionRequest.MARK_KEEPER")
        .replace("index=self.index, action", "index=self.index + 1, action")
        .replace("    main()\n", "    main()\n    raise SystemExit(3)\n")
    )
    checked = check("--", agent)
    assert checked.returncode == 1
    failed = [line for line in checked.stdout.splitlines() if line.startswith("FAILS")]
    assert len(failed) == 3, checked.stdout
    assert "the first that is not: player_index 1, not 0" in failed[0]
    assert "the first that is not: action 4 target 0" in failed[1]
    assert "exit code 3" in failed[2]


ENDS_ITSELF = """
import sys
sys.path.insert(0, sys.argv[1])
import rclpy
from smallest_agent import ActionRequest, SmallestAgent, main

class Ended(SmallestAgent):
    def __init__(self):
        super().__init__()
        self.create_timer(0.01, self.answer)

    def answer(self):
        if sys.argv[2] == "stops":
            rclpy.shutdown()  # as a signal does, which may come at any moment
        self.requests.publish(ActionRequest() if sys.argv[2] == "stops" else None)

main(Ended)
"""


@pytest.mark.parametrize(("how", "code"), [("stops", 0), ("fails", 1)])
def test_who_is_ended_while_it_answers_ends_well_and_who_fails_does_not(
    ros_domain: int, how: str, code: int
) -> None:
    command = [sys.executable, "-c", ENDS_ITSELF, str(EXAMPLES), how]
    ended = subprocess.run(command, capture_output=True, text=True)
    assert ended.returncode == code, ended.stderr


def test_a_command_that_there_is_not_is_refused_in_a_line() -> None:
    checked = check("--", "no_such_agent")
    assert checked.returncode == 2
    assert "no_such_agent" in checked.stderr
    assert "Traceback" not in checked.stderr


def test_what_a_match_in_the_same_domain_is_answered_is_not_held_against_an_agent(
    graph: Graph,
) -> None:
    graph.start_simulator(task="4v3")
    command = [sys.executable, str(ROOT / "scripts" / "check_agent.py"), "--"]
    checked = subprocess.Popen(
        [*command, str(EXAMPLES / "smallest_agent.py")], stderr=subprocess.PIPE, text=True
    )
    graph.spin_until(lambda: checked.poll() is not None)
    _, said = checked.communicate()
    assert checked.returncode == 2
    assert "another simulator publishes `match` here (4v3)" in said
    assert "Traceback" not in said


def test_two_checks_at_once_do_not_hear_each_other() -> None:
    alone = {name: value for name, value in os.environ.items() if name != "ROS_DOMAIN_ID"}
    command = [sys.executable, str(ROOT / "scripts" / "check_agent.py"), "--answer-timeout", "20"]
    both = [
        subprocess.Popen(
            [*command, "--", str(EXAMPLES / "smallest_agent.py")],
            stdout=subprocess.PIPE, text=True, env=alone,
        )
        for _ in range(2)
    ]  # fmt: skip
    for each in both:
        said, _ = each.communicate(timeout=900)
        assert said.endswith("14 of 14 sentences hold\n"), said
