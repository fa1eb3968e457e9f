"""Let a whole match run for long, with recorders and a viewer, and watch what its processes use.

    .venv/bin/python scripts/checks/endurance.py --minutes 60
    .venv/bin/python scripts/checks/endurance.py --minutes 20 --task 5v4 --recorders 2

Memory (resident), file descriptors and threads of every process are sampled. After a warm-up they
must stay where they are; the table shows the first and the last sample after it. Ends with code 1
where something grows, a process dies, or a recorder misses something.
"""

import argparse
import contextlib
import json
import os
import re
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
from pathlib import Path
from typing import NamedTuple

from keepaway_sim.cli.interrupts import restore_ctrl_c

SCRIPTS = Path(__file__).resolve().parents[1]
PERIOD = 5.0  # [s] between samples
WARM_UP = 0.25  # of the time, before growth is looked for
MOST_GROWTH = 8.0  # [MB] from then on; the counts of episodes are kept in memory
MOST_HANDLES = 2  # file descriptors and threads that may come and go
PATIENCE = 300.0  # [s] for the match to begin (a first start compiles), and for all to end
MEGABYTE = 2**20
ENDED = (0, 128 + signal.SIGINT)  # exit codes of what ends by itself, and of what Ctrl-C ends


class Sample(NamedTuple):
    """What a process uses."""

    memory: float  # [MB] resident
    handles: int  # open file descriptors
    threads: int


def main() -> int:
    """Play, watch, tell."""
    args = parse()
    restore_ctrl_c()
    os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    with tempfile.TemporaryDirectory(prefix="endurance-") as name:
        folder = Path(name)
        started = start(args, folder)
        try:
            samples, files = watch(started, 60.0 * args.minutes, folder)
        finally:
            ended = end(started)
        if killed := [name for name, code in ended.items() if code == -signal.SIGKILL]:
            for name in killed:
                said = (folder / f"{name}.err").read_text()[-2000:]
                print(f"endurance: {name} did not end and was killed: {said}", file=sys.stderr)
            return 1
        summary = json.loads((folder / "match.out").read_text().splitlines()[-1])
        written = sum(file.stat().st_size for file in folder.rglob("*.mcap")) / MEGABYTE
        reports = [file.read_text().strip()[-200:] for file in sorted(folder.glob("recorder*.err"))]
    growing = show(samples)
    print(
        f"{summary['episodes']} episodes, {summary['cycles_per_second']} cycles/s, {written:.0f} MB"
        f" recorded, files in shared memory {files[0]} -> {files[1]}, troubles"
        f" {summary['troubles'] or 'none'}"
    )
    print(*reports, sep="\n")
    print(f"growing: {', '.join(growing) or 'nothing'}; exit codes {ended}")
    return int(bool(growing) or any(code not in ENDED for code in ended.values()))


def start(args: argparse.Namespace, folder: Path) -> dict[str, "subprocess.Popen[bytes]"]:
    """Start recorders, a viewer with a browser, and the match."""
    learn = ["--keeper-policy", "learn", "--save-weights", folder / "weights", "--json"]
    waits = ["--wait-for-recorder"] * bool(args.recorders)
    waits += ["--answer-timeout", args.answer_timeout]
    commands = {
        **{f"recorder_{n}": ["record.py", folder / f"bag_{n}"] for n in range(args.recorders)},
        "viewer": ["view.py", "--live", "--port", args.port],
        "match": ["match.py", "--task", args.task, "--save-every", 20, *learn, *waits],
    }
    started = {}
    for name, command in commands.items():
        words = [sys.executable, SCRIPTS / str(command[0]), *command[1:]]
        with (folder / f"{name}.out").open("wb") as out, (folder / f"{name}.err").open("wb") as err:
            # Each a session of its own, as from terminals: by these Linux shares out its time.
            started[name] = subprocess.Popen(
                list(map(str, words)), stdout=out, stderr=err, start_new_session=True
            )
    threading.Thread(target=browse, args=(args.port,), daemon=True).start()
    return started


def browse(port: int) -> None:
    """Read the live page's events as a browser does, for as long as there are any."""
    for _ in range(60):
        with contextlib.suppress(OSError):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/events", timeout=60) as events:
                for _ in events:
                    pass
            return
        time.sleep(1.0)


def watch(
    started: dict[str, "subprocess.Popen[bytes]"], seconds: float, folder: Path
) -> tuple[dict[str, list[Sample]], tuple[int, int]]:
    """Sample every process while it plays, once the match has saved its first weights.

    Returns:
        the samples by process, and how many files were in shared memory at first and at last.

    Raises:
        RuntimeError: one of them ended, or nothing is played.
    """
    until = time.monotonic() + PATIENCE
    while not list((folder / "weights").glob("*.npz")):
        time.sleep(1.0)
        if time.monotonic() > until:
            said = (folder / "match.err").read_text() or "it said nothing"
            raise RuntimeError(f"no weights were saved within {PATIENCE:.0f} s: {said}")
    samples: dict[str, list[Sample]] = {}
    files_at_first = shared_files()
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        for name, pid in processes(started).items():
            samples.setdefault(name, []).append(sample(pid))
        for name, process in started.items():
            if process.poll() is not None:
                raise RuntimeError(f"{name} ended: {(folder / f'{name}.err').read_text()[-2000:]}")
        time.sleep(PERIOD)
    return samples, (files_at_first, shared_files())


def processes(started: dict[str, "subprocess.Popen[bytes]"]) -> dict[str, int]:
    """All processes by name: those started here and the nodes of the match."""
    found = {name: process.pid for name, process in started.items()}
    pid = found["match"]
    for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
        name = re.search(r"__node:=(\w+)", Path(f"/proc/{child}/cmdline").read_text())
        if name:
            found[name[1]] = int(child)
    return found


def sample(pid: int) -> Sample:
    """What a process uses now."""
    process = Path(f"/proc/{pid}")
    pages = int((process / "statm").read_text().split()[1])
    threads = len(list((process / "task").iterdir()))
    memory = pages * resource.getpagesize() / MEGABYTE
    return Sample(memory, len(list((process / "fd").iterdir())), threads)


def shared_files() -> int:
    """Files in shared memory on this machine, other programs' included."""
    return len(list(Path("/dev/shm").iterdir()))


def end(started: dict[str, "subprocess.Popen[bytes]"]) -> dict[str, int]:
    """End the match, then those who listen to it; their exit codes, -9 of what had to be killed."""
    codes = {}
    for name in reversed(started):
        started[name].send_signal(signal.SIGINT)
        try:
            codes[name] = started[name].wait(PATIENCE)
        except subprocess.TimeoutExpired:
            started[name].kill()  # its nodes end with it
            codes[name] = started[name].wait()
    return codes


def show(samples: dict[str, list[Sample]]) -> list[str]:
    """A table; the names of the processes that grow."""
    print(f"{'process':12} {'memory (MB)':>24} {'handles':>12} {'threads':>12} {'samples':>8}")
    growing = []
    for name, all_of_it in samples.items():
        settled = all_of_it[int(WARM_UP * len(all_of_it)) :]
        first, last = settled[0], settled[-1]
        most = max(each.memory for each in settled)
        print(
            f"{name:12} {first.memory:6.1f} -> {last.memory:6.1f} ({most:6.1f})"
            f" {first.handles:4} -> {last.handles:4} {first.threads:4} -> {last.threads:4}"
            f" {len(all_of_it):8}"
        )
        grows = last.memory - first.memory > MOST_GROWTH
        handles = last.handles - first.handles, last.threads - first.threads
        if grows or max(handles) > MOST_HANDLES:
            growing.append(name)
    return growing


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--minutes", type=float, default=60.0, help="of wall time (default 60)")
    add("--task", default="3v2", help="keepers v takers (default 3v2)")
    add("--recorders", type=int, default=1, help="that record the same match (default 1)")
    add("--answer-timeout", type=float, default=2.0, help="of the match [s] (default 2)")
    add("--port", type=int, default=8417, help="of the live page (default 8417)")
    add("--domain", type=int, default=74, help="ROS domain (default 74)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
