"""Bags of millions of messages: the time and memory that it takes to read them.

    .venv/bin/python scripts/checks/long_bag.py --messages 10000000

A match of 3v2 of a hundred episodes is played and recorded, and written again and again with later
episodes and times until there are that many messages: once in order, once with its chunks in
disorder. `analyze.py` and `view.py` read both; the table has their CPU time and memory, and where a
Chromium is installed, how long it takes from its start until the page is shown. The results must be
the same for both bags; ends with 1 where they are not.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np

from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.topics import Recorded
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.task import Action, Task
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import CYCLE_NS, MATCH, SECOND
from keepaway_sim.world.config import Config
from keepaway_sim.world.world import World

SCRIPTS = Path(__file__).resolve().parents[1]
TASK = "3v2"
MATCH_ID = 7  # that all messages carry, as a simulator's do
PASS_EVERY = 8  # [cycles]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
CHUNK = 6000  # messages that are written together: a chunk of some 700 KB


class Alike(NamedTuple):
    """Messages of one type and size in a chunk."""

    at: np.ndarray  # (n,) their places in the chunk
    layout: np.dtype[np.void]
    raw: np.ndarray  # (n, size) bytes
    times: list[tuple[str, str]]  # fields of seconds, and of nanoseconds
    episode: str  # field of the episode's number; empty without one


class Chunk(NamedTuple):
    """Messages that are written together, ready to be moved to later episodes."""

    said: list[Recorded]
    alike: list[Alike]


def main() -> int:
    """Make the bags, read them, print the table."""
    args = parse()
    with tempfile.TemporaryDirectory(prefix="long-bag-", dir=args.folder) as name:
        folder = Path(name)
        base = record(folder / "base", args.episodes)
        bags = {"in order": folder / "ordered", "chunks in disorder": folder / "disordered"}
        for how, bag in bags.items():
            began = time.process_time()
            count = lengthen(base, bag, args.messages, args.episodes, how != "in order")
            size = sum(file.stat().st_size for file in bag.glob("*.mcap")) / 1e6
            seconds = time.process_time() - began
            print(f"{how}: {count:,} messages, {size:,.0f} MB, written in {seconds:.0f} s of CPU")
        results = {how: read(bag, how, folder) for how, bag in bags.items()}
    same = len(set(results.values())) == 1
    print("the same numbers from both" if same else "the numbers differ")
    return int(not same)


def record(path: Path, episodes: int) -> Path:
    """A match in which keepers pass round now and then."""
    world = World(Task.parse(TASK), Config())
    begin_match(world, 1)
    with BagWriter(path, world_info(world, 1)) as bag:
        recorder = FieldRecorder(bag, world, 0, 1)
        while world.belief.episode[0] < episodes:
            recorder.moment()
            action, target = requests(world)
            recorder.requests(action, target)
            world.step(action[None], target[None])
    return path


def requests(world: World) -> tuple[np.ndarray, np.ndarray]:
    """What every player of field 0 asks for."""
    task, seen = world.task, world.belief
    action = np.full(task.num_players, Action.GO_TO_BALL)
    target = np.zeros(task.num_players, np.int64)
    for player in range(task.num_keepers):
        if seen.ball_kickable[0, player]:
            passes = seen.cycle[0] % PASS_EVERY == 0
            action[player] = Action.PASS_BALL if passes else Action.HOLD_BALL
            target[player] = (player + 1) % task.num_keepers if passes else 0
        elif seen.cycles_to_ball[0, player, : task.num_keepers].argmin() != player:
            action[player] = Action.GET_OPEN
    return action, target


def lengthen(base: Path, path: Path, count: int, episodes: int, disorder: bool) -> int:
    """Write a match again and again; how many messages there are then."""
    reader = BagReader(base)
    match, *said = list(reader.messages())
    assert match.message_type == MATCH
    period = reader.end_time + CYCLE_NS  # [ns] from one repetition to the next
    chunks = [chunk_of(said[first : first + CHUNK]) for first in range(0, len(said), CHUNK)]
    places = [(n, c) for n in range(-(-count // len(said))) for c in range(len(chunks))]
    if disorder:
        random.Random(1).shuffle(places)
    with BagWriter(path, reader.info, flush_interval=float("inf"), chunk_size=2**30) as bag:
        told = codec(MATCH).decode(match.data) | {"match_id": MATCH_ID}
        bag.write(match.topic, MATCH, codec(MATCH).encode(told), match.log_time)
        for number, chunk in places:
            for message in later(chunks[chunk], number * period, number * episodes):
                bag.write(*message[:2], message.data, message.log_time)
            bag.flush()
        return bag.message_count


def chunk_of(said: list[Recorded]) -> Chunk:
    """Group messages by type and size."""
    groups: dict[tuple[str, int], list[int]] = {}
    for at, message in enumerate(said):
        groups.setdefault((message.message_type, len(message.data)), []).append(at)
    alike = []
    for (message_type, size), places in groups.items():
        layout = codec(message_type)
        first = said[places[0]].data
        dtype = layout.dtype(layout.lengths(layout.decode(first)), size)
        raw = np.array(bytearray(b"".join(said[at].data for at in places)), np.uint8)
        raw = raw.reshape(-1, size)
        names = dtype.names or ()
        nanosecs = [name for name in names if name.endswith("nanosec")]
        times = [(f"{name.removesuffix('nanosec')}sec", name) for name in nanosecs]
        episode = next((name for name in ("episode", "number") if name in names), "")
        if "match_id" in names:
            raw.view(dtype)[:, 0]["match_id"] = MATCH_ID
        alike.append(Alike(np.array(places), dtype, raw, times, episode))
    return Chunk(said, alike)


def later(chunk: Chunk, period: int, episodes: int) -> Iterator[Recorded]:
    """The same messages, moved to later times and episodes."""
    data = [b""] * len(chunk.said)
    for alike in chunk.alike:
        copied = alike.raw.copy()  # of a structured array, what lies between the fields is lost
        rows = copied.view(alike.layout)[:, 0]
        for sec, nanosec in alike.times:
            moved = rows[sec] * np.int64(SECOND) + rows[nanosec] + period
            rows[sec], rows[nanosec] = moved // SECOND, moved % SECOND
        if alike.episode:
            rows[alike.episode] += episodes
        raw, size = copied.tobytes(), alike.raw.shape[1]
        for number, at in enumerate(alike.at.tolist()):
            data[at] = raw[number * size : (number + 1) * size]
    for message, own in zip(chunk.said, data, strict=True):
        yield message._replace(data=own, log_time=message.log_time + period)


def read(bag: Path, how: str, folder: Path) -> str:
    """Let the tools read a bag; a digest of what they made of it."""
    out, page = folder / f"{bag.name}-analysis", folder / f"{bag.name}.html"
    run(f"analyze.py, {how}", ["analyze.py", bag, "--out", out])
    run(f"view.py, {how}", ["view.py", bag, "--out", page])
    empty = folder / "empty.html"
    empty.write_text("<!doctype html><title>empty</title>")
    size, seconds = page.stat().st_size / 1e6, [opened(each) for each in (page, empty)]
    times = [f"{each:.1f} s" for each in seconds if each is not None]
    known = f": opened in {times[0]}, an empty one in {times[1]}" if times else ""
    print(f"  its page has {size:.1f} MB{known}", flush=True)
    facts = re.sub(r"\d+ messages came", "messages came", page.read_text())
    return hashlib.sha256((out / "episodes.csv").read_bytes() + facts.encode()).hexdigest()


def opened(page: Path) -> float | None:
    """How long Chromium takes to start, open a page and tell what it shows [s]; None without one.

    Raises:
        AssertionError: the page's script did not run to its end.
    """
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    if not program:
        return None
    words = [program, "--headless", "--no-sandbox", "--disable-gpu", "--dump-dom", page.as_uri()]
    began = time.monotonic()
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    seconds = time.monotonic() - began
    assert page.name == "empty.html" or " s, " in done.stdout.split('id="summary"')[1][:200]
    return seconds


def run(what: str, words: list[object]) -> None:
    """Run a script and say what it took."""
    command = [sys.executable, str(SCRIPTS / str(words[0])), *map(str, words[1:])]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    said = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"long_bag: {what} ended with {process.returncode}: {said}")
    cpu, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3
    print(f"{what}: {cpu:.0f} s of CPU, {memory:.0f} MB; {said.splitlines()[0]}", flush=True)


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--messages", type=int, default=10_000_000, help="at least (default 10 million)")
    add("--episodes", type=int, default=100, help="that are played (default 100)")
    add("--folder", type=Path, help="for the bags; 2.5 GB (default: where TMPDIR says)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
