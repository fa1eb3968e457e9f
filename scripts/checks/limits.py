"""What every reader takes for small files, however hostile: at most 5 s of CPU and 500 MB.

    .venv/bin/python scripts/checks/limits.py FOLDER..          # every bag and weights file there
    .venv/bin/python scripts/checks/limits.py --made 20         # and hostile bags made here

Each reader is run as a person runs it, with its imports, on every file of less than 1 MB. It must
end by itself with 0 or 1, without a traceback, print no control characters, and write no
NaN into a page. The table shows the most that each reader took; ends with 1 where one took more, or
did otherwise.
"""

from __future__ import annotations

import argparse
import os
import random
import resource
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from bag_structures import changed, read_all, write

from keepaway_sim.bags.field_recorder import FieldRecorder, world_info
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.task import Action, Task
from keepaway_sim.world.config import Config
from keepaway_sim.world.world import World

SCRIPTS = Path(__file__).resolve().parents[1]
DATA = 'type="application/json">'
SMALL = 10**6  # [bytes]
MOST_CPU = 5.0  # [s]
MOST_MEMORY = 500.0  # [MB] resident
EPISODES = 2  # of a match that is made here
PATIENCE = 120.0  # [s] of the wall's, for a reader to end by itself

BAG_READERS: dict[str, list[str]] = {
    "analyze": ["analyze.py", "{file}", "--out", "{out}/analysis"],
    "view": ["view.py", "{file}", "--out", "{out}/page.html"],
    "view --picture": ["view.py", "{file}", "--picture", "{out}/moment.png"],
    "view --add-markers": ["view.py", "{file}", "--add-markers", "{out}/marked"],
    "replay --check": ["replay.py", "{file}", "--check"],
    "replay": ["replay.py", "{file}", "--rate", "0", "--start-delay", "0"],
    "repair": ["repair_bag.py", "{file}", "{out}/repaired"],
}
WEIGHTS_READERS = {"describe": ["describe.py", "{file}"]}


class Took(NamedTuple):
    """What a reader took for a file, and what is wrong with how it ended."""

    file: Path
    cpu: float  # [s]
    memory: float  # [MB]
    code: int
    wrong: str


def main() -> int:
    """Run every reader on every file, print the table."""
    args = parse()
    os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    wrong = []
    with tempfile.TemporaryDirectory(prefix="limits-") as name:
        folder = Path(name)
        files = [*small_files(args.folders), *made_bags(args.made, args.seed, folder / "made")]
        bags = [file for file in files if file.suffix == ".mcap"]
        weights = [file for file in files if file.suffix == ".npz"]
        print(f"{'reader':20} {'files':>6} {'refused':>8} {'most CPU':>9} {'most memory':>12}")
        for readers, chosen in ((BAG_READERS, bags), (WEIGHTS_READERS, weights)):
            for reader, command in readers.items():
                results = [run(command, file, folder) for file in chosen]
                wrong += [(reader, took) for took in results if took.wrong]
                show(reader, results)
    for reader, took in wrong:
        print(f"{reader} {took.file}: {took.wrong}", file=sys.stderr)
    return min(len(wrong), 1)


def small_files(folders: list[Path]) -> Iterator[Path]:
    """Bags and weights in some folders, of less than a megabyte."""
    for folder in folders:
        for file in sorted(folder.rglob("*")):
            if file.suffix in (".mcap", ".npz") and file.stat().st_size < SMALL:
                yield file


def made_bags(count: int, seed: int, folder: Path) -> Iterator[Path]:
    """Bags that are whole MCAP files and odd inside, of a match that is played here."""
    if not count:
        return
    folder.mkdir()
    messages = read_all(record(folder / "match"))
    for number in range(count):
        case = random.Random(seed + number)
        path = folder / f"made_{number}.mcap"
        write(path, changed(messages, case), "{}", case)
        yield path


def record(path: Path) -> Path:
    """The file of a short match: keepers hold the ball, a taker goes for it."""
    world = World(Task.parse("2v1"), Config())
    begin_match(world, 1)
    action, target = np.array([[Action.HOLD_BALL] * 2 + [Action.GO_TO_BALL]]), np.zeros((1, 3), int)
    with BagWriter(path, world_info(world, 1)) as bag:
        recorder = FieldRecorder(bag, world, 0, 1)
        while world.belief.episode[0] < EPISODES:
            recorder.moment()
            recorder.requests(action[0], target[0])
            world.step(action, target)
    return next(path.glob("*.mcap"))


def run(command: list[str], file: Path, folder: Path) -> Took:
    """One reader on one file, and what it took."""
    with tempfile.TemporaryDirectory(dir=folder) as out:
        words = [word.format(file=file, out=out) for word in command]
        output, log = Path(out) / "stdout", Path(out) / "stderr"
        with output.open("wb") as stdout, log.open("wb") as stderr:
            started = subprocess.Popen(
                [sys.executable, str(SCRIPTS / words[0]), *words[1:]],
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
            )
            code, usage = wait(started)
        said = output.read_text(errors="replace") + log.read_text(errors="replace")
        pages = [page.read_text() for page in Path(out).glob("*.html")]
    cpu, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1e3
    return Took(file, cpu, memory, code, "; ".join(faults(said, pages, code, cpu, memory)))


def wait(process: subprocess.Popen[bytes]) -> tuple[int, resource.struct_rusage]:
    """The exit code of a process and what it used; one that does not end is killed."""
    alarm = threading.Timer(PATIENCE, process.kill)
    alarm.start()
    _, status, usage = os.wait4(process.pid, 0)
    alarm.cancel()
    process.returncode = os.waitstatus_to_exitcode(status)
    return process.returncode, usage


def faults(said: str, pages: list[str], code: int, cpu: float, memory: float) -> Iterator[str]:
    """What is wrong with how a reader ended."""
    if code not in (0, 1):
        yield f"code {code}"
    if cpu > MOST_CPU:
        yield f"{cpu:.1f} s of CPU"
    if memory > MOST_MEMORY:
        yield f"{memory:.0f} MB"
    if "Traceback" in said:
        yield "a traceback"
    if not all(line.isprintable() for line in said.replace("\t", " ").split("\n")):
        yield f"prints control characters: {said[:200]!a}"
    if code == 1 and not said.strip():
        yield "refused without a word"
    if any("NaN" in page.partition(DATA)[2].partition("<")[0] for page in pages):
        yield "NaN in a page"


def show(reader: str, results: list[Took]) -> None:
    """A row of the table."""
    if not results:
        return
    cpu = max(took.cpu for took in results)
    memory = max(took.memory for took in results)
    refused = sum(took.code == 1 for took in results)
    print(f"{reader:20} {len(results):6} {refused:8} {cpu:7.1f} s {memory:9.0f} MB", flush=True)


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("folders", nargs="*", type=Path, metavar="FOLDER", help="with bags and weights")
    add("--made", type=int, default=0, help="hostile bags to make as well (default 0)")
    add("--seed", type=int, default=0, help="of those (default 0)")
    add("--domain", type=int, default=79, help="ROS domain of the replays (default 79)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
