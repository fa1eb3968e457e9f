"""An agent of one's own: the smallest one, made from its template, put into a match."""

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from graph import played, trained

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "src" / "keepaway_agent" / "examples"
CONTRACT = ROOT / "src" / "keepaway_agent" / "docs" / "agent_contract.md"

pytestmark = pytest.mark.usefixtures("ros_domain")


def run(script: str, *arguments: object, folder: Path = ROOT) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(ROOT / "scripts" / script), *map(str, arguments)]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=900)


def match(*arguments: object) -> dict[str, Any]:
    done = run("match.py", "--json", "--episodes", 2, *arguments)
    assert done.returncode == 0, done.stderr
    summary: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return summary


def test_the_agent_on_the_contract_page_plays_as_keeper_and_as_taker(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", CONTRACT.read_text(), re.DOTALL)
    assert blocks == [(EXAMPLES / "smallest_agent.py").read_text()]
    agent = tmp_path / "agent.py"
    agent.write_text(blocks[0])
    summary = match("--keeper-agent", agent, "--taker-agent", agent)
    assert summary["troubles"] == {}
    episodes = list(zip(summary["episode_cycles"], summary["episode_outcomes"], strict=True))
    assert episodes == played(trained(2, policy="hold"))


def test_a_new_agent_plays_for_one_player_beside_the_built_in_ones(tmp_path: Path) -> None:
    made = run("new_agent.py", "quick_keeper", folder=tmp_path)
    assert made.returncode == 0
    assert "class QuickKeeper(Node)" in (tmp_path / "quick_keeper.py").read_text()
    agent = f"keeper_2={tmp_path / 'quick_keeper.py'}"
    bag = tmp_path / "bag"
    summary = match("--keeper-policy", "hold", "--agent", agent, "--record", bag)
    assert summary["troubles"] == {}
    checked = run("replay.py", bag, "--check")
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_a_new_package_has_what_colcon_and_pip_want(tmp_path: Path) -> None:
    assert run("new_agent.py", "quick_keeper", "--package", folder=tmp_path).returncode == 0
    package = tmp_path / "quick_keeper"
    files = {str(path.relative_to(package)) for path in package.rglob("*") if path.is_file()}
    assert files == {
        "package.xml",
        "setup.cfg",
        "setup.py",
        "resource/quick_keeper",
        "quick_keeper/__init__.py",
        "quick_keeper/agent.py",
    }
    built = subprocess.run(
        [sys.executable, "setup.py", "--quiet", "install", "--root", tmp_path / "installed"],
        cwd=package,
        capture_output=True,
        text=True,
    )
    assert built.returncode == 0, built.stderr
    assert list((tmp_path / "installed").rglob("lib/quick_keeper/agent"))


def test_nothing_is_written_over(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text("precious")
    refused = run("new_agent.py", "mine", folder=tmp_path)
    assert refused.returncode == 1
    assert (tmp_path / "mine.py").read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["--agent", "keeper_9=agent.py"], "'keeper_9' does not play: 3v2 has keeper_1"),
        (["--agent", "keeper_1"], "--agent keeper_1: give NAME=COMMAND"),
        (["--single-process", "--agent", "keeper_1=a.py"], "our own players only"),
    ],
)
def test_an_agent_without_a_place_is_refused_in_a_line(arguments: list[str], why: str) -> None:
    refused = run("match.py", *arguments)
    assert refused.returncode == 1
    assert why in refused.stderr
    assert "Traceback" not in refused.stderr
