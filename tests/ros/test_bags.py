"""Recorder and replayer as processes over DDS: what is said is recorded, and said again."""

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from recorded import record_match

from keepaway_sim.recording import BagReader

ROOT = Path(__file__).resolve().parents[2]
START_TIMEOUT = 60.0  # [s]


@pytest.fixture(scope="session")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_match(tmp_path_factory.mktemp("bags") / "match", "3v2", seed=3, episodes=3)


@contextmanager
def recording(path: Path, *arguments: str) -> Iterator[subprocess.Popen[bytes]]:
    """scripts/record.py at work; told to end (SIGINT) when the block is left."""
    command = [sys.executable, str(ROOT / "scripts/record.py"), str(path), *arguments]
    process = subprocess.Popen(command)
    until = time.monotonic() + START_TIMEOUT
    while not list(path.glob("*.mcap")) and time.monotonic() < until:
        assert process.poll() is None
        time.sleep(0.05)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGINT)
        process.wait(30)


def replay(bag: Path, *arguments: str) -> str:
    """scripts/replay.py, to its end."""
    return subprocess.run(
        [sys.executable, str(ROOT / "scripts/replay.py"), str(bag), *arguments],
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout


def by_topic(bag: Path, prefix: str = "") -> dict[str, list[bytes]]:
    said: dict[str, list[bytes]] = {}
    for message in BagReader(bag).messages():
        name = message.topic.removeprefix(prefix)
        said.setdefault(name, []).append(message.data)
    return said


@pytest.mark.usefixtures("ros_domain")
@pytest.mark.parametrize("rate", ["0", "20"])
def test_a_replay_says_byte_for_byte_what_was_recorded(
    bag: Path, tmp_path: Path, rate: str
) -> None:
    with recording(tmp_path / "again") as recorder:
        said = replay(bag, "--rate", rate, "--wait-for-subscribers", "14", "--start-delay", "1")
    assert recorder.returncode == 0
    assert said == f"said {BagReader(bag).message_count} messages\n"
    assert by_topic(tmp_path / "again") == by_topic(bag)
    info = BagReader(tmp_path / "again").info
    assert info["gaps"].startswith("nothing is missing")
    assert not any(json.loads(info["missing"]).values())
