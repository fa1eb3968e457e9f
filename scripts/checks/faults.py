"""Kill and freeze a match's nodes at random moments; check that it continues and nothing is lost.

    .venv/bin/python scripts/checks/faults.py --faults 300

Every process of a recorded, learning match may be hit: SIGKILL ends it, SIGSTOP freezes it for a
while. `match.py --restart` starts again what was killed. A second simulator (by force) and a node
that publishes episodes of no match are there all the while. What must hold all the time:

- episodes are counted without a gap, and none twice;
- every weights file can be read, and never knows fewer episodes than before;
- every bag can be read, and holds only episodes that were played;
- every player that lives plays again within a minute.

Ends with code 1 and the reason where one of these does not hold.
"""

import argparse
import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Self

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import Executor
from rclpy.experimental import EventsExecutor
from rclpy.node import Node

from keepaway_agent.learning.weights import load_weights
from keepaway_msgs.msg import Episode
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.repair import repair
from keepaway_sim.cli.interrupts import restore_ctrl_c
from keepaway_sim.ros.publishing import ALL, QUEUE

SCRIPTS = Path(__file__).resolve().parents[1]
PATIENCE = 300.0  # [s] for the match to begin, to continue after a fault, and to end
RETURN = 60.0  # [s] in which a player that lives answers again, or started again
LONGEST_FREEZE = 3.0  # [s]
FAULTS_AN_EPISODE = 5  # at most: where no player ever gets to play, nothing is tried
FAULTS_A_PAUSE = 25  # after this many, every player must come back


class LossError(RuntimeError):
    """Something that must hold does not."""


class Witness(Node):
    """Counts what a match says of itself.

    Attributes:
        numbers: of the episodes that ended, as they were received.
        missing: how often each player was newly declared missing.
        absent: who is missing, as last received; None before that.
    """

    def __init__(self) -> None:
        super().__init__("witness")
        self.match_id = 0
        self.numbers: list[int] = []
        self.missing: Counter[str] = Counter()
        self.absent: set[str] | None = None
        self.create_subscription(Episode, "episode", self._on_episode, ALL)
        self.create_subscription(DiagnosticArray, "/diagnostics", self._on_diagnostics, QUEUE)

    def _on_episode(self, message: Episode) -> None:
        self.match_id = self.match_id or message.match_id
        if message.match_id == self.match_id:
            self.numbers.append(message.number)

    def _on_diagnostics(self, message: DiagnosticArray) -> None:
        if message.status[0].hardware_id != str(self.match_id):
            return
        absent = {s.name for s in message.status if s.level == DiagnosticStatus.ERROR}
        self.missing.update(absent - (self.absent or set()))
        self.absent = absent


class Match:
    """A recorded, learning match of processes, in a folder of its own.

    Attributes:
        weights, bag: folders; the bags of restarted simulators are bag_2, bag_3.
        known: how many episodes each keeper's weights know.
    """

    def __init__(self, folder: Path, task: str, seed: int) -> None:
        """Start it."""
        self.weights, self.bag = folder / "weights", folder / "bag"
        self.known: dict[str, int] = {}
        learning = ["--keeper-policy", "learn", "--save-weights", self.weights, "--save-every", "1"]
        play = ["--task", task, "--seed", seed, "--restart", "--answer-timeout", 0.5, "--json"]
        options = [SCRIPTS / "match.py", *play, *learning, "--record", self.bag]
        self._process = subprocess.Popen(
            [sys.executable, *map(str, options)],
            stdout=subprocess.PIPE,
            stderr=(folder / "stderr.txt").open("wb"),
            text=True,
        )

    def nodes(self) -> dict[str, int]:
        """The ids of its running processes by node name."""
        pid, found = self._process.pid, {}
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            with contextlib.suppress(OSError):  # it has just ended
                command = Path(f"/proc/{child}/cmdline").read_text()
                if name := re.search(r"__node:=(\w+)", command):
                    found[name[1]] = int(child)
        return found

    def check_weights(self) -> None:
        """Every file is whole, and no file knows less than it knew.

        Raises:
            LossError: which does not, and why.
            WeightsError: a file that cannot be read.
        """
        for path in sorted(self.weights.glob("*.npz")):
            episodes = load_weights(path).episodes
            if episodes < self.known.get(path.stem, 0):
                raise LossError(f"{path} knew {self.known[path.stem]} episodes, now {episodes}")
            self.known[path.stem] = episodes

    def check_bags(self, folder: Path, played: set[int]) -> tuple[int, int]:
        """Every bag can be read or repaired and holds only episodes that were played, each once.

        One whose simulator was killed before it wrote a message is empty.

        Returns:
            how many bags there are, and how many episodes are in them.

        Raises:
            LossError: one that is not so.
            KeepawayError: one that cannot be read.
        """
        recorded: list[int] = []
        bags = sorted(self.bag.parent.glob("bag*"))
        for number, bag in enumerate(bags):
            reader = BagReader(bag)
            if not reader.complete and reader.message_count:
                reader = repair(bag, folder / f"repaired_{number}")
            for message in reader.messages(["/episode"]):
                recorded.append(int(reader.codec(message.topic).decode(message.data)["number"]))
        if len(set(recorded)) != len(recorded) or not set(recorded) <= played:
            raise LossError(f"the bags hold episodes {recorded}")
        return len(bags), len(recorded)

    def end(self) -> dict[str, object]:
        """End it as Ctrl-C does; its own account of how it went.

        Raises:
            LossError: it was over already.
        """
        if self._process.poll() is not None:
            raise LossError(f"the match ended by itself with code {self._process.returncode}")
        self._process.send_signal(signal.SIGINT)
        out, _ = self._process.communicate(timeout=PATIENCE)
        return dict(json.loads(out.splitlines()[-1]))

    def kill(self) -> None:
        """End it whatever happened."""
        self._process.kill()
        self._process.wait()


class Intruders:
    """A second simulator, started by force, and a node that publishes episodes of no match."""

    def __init__(self, node: Node, folder: Path) -> None:
        """Start the simulator; its words go into a file in the folder."""
        self._episodes = node.create_publisher(Episode, "episode", ALL)
        forced = ["--ros-args", "-p", "force:=true", "-p", "seed:=99"]
        self._process = subprocess.Popen(
            [sys.executable, str(SCRIPTS / "simulator.py"), *forced],
            stdout=subprocess.DEVNULL,
            stderr=(folder / "intruder.txt").open("wb"),
        )

    def disturb(self, number: int) -> None:
        """Publish an episode that was never played."""
        self._episodes.publish(Episode(number=number, cycles=10_000, duration=1000.0))

    def check(self) -> None:
        """The simulator is there.

        Raises:
            LossError: it has ended.
        """
        if self._process.poll() is not None:
            raise LossError(f"the second simulator ended with code {self._process.returncode}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def main() -> int:
    """Play, inject faults, check, report."""
    args = parse()
    restore_ctrl_c()
    os.environ["ROS_DOMAIN_ID"] = str(args.domain)
    rclpy.init()
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        match = Match(Path(folder), args.task, args.seed)
        try:
            report = inject_faults(match, args, Path(folder))
        except LossError as loss:
            print(f"faults: LOST: {loss}", file=sys.stderr)
            print(Path(folder, "stderr.txt").read_text()[-3000:], file=sys.stderr)
            return 1
        finally:
            match.kill()
            rclpy.try_shutdown()
    show(report)
    if args.json:
        print(json.dumps(report, allow_nan=False))
    return 0


def inject_faults(match: Match, args: argparse.Namespace, folder: Path) -> dict[str, object]:
    """One fault after the other, everything checked after each; then the end of the match."""
    witness, executor = Witness(), EventsExecutor()
    executor.add_node(witness)
    wait_for_episodes(executor, witness, 1)
    started = time.monotonic()
    with Intruders(witness, folder) as intruders:
        faults = one_by_one(match, executor, witness, intruders, args)
        wait_for_everybody(executor, witness)
        wait_for_episodes(executor, witness, 3)
        summary = match.end()
        intruders.check()
    listen(executor, 0.5)
    check_numbers(witness.numbers)
    match.check_weights()
    bags, recorded = match.check_bags(folder, set(witness.numbers))
    if summary["episodes"] != len(witness.numbers):
        raise LossError(f"{len(witness.numbers)} episodes received, {summary['episodes']} reported")
    return {
        "faults": dict(sorted(faults.items())),
        "intruders": ["a second simulator", f"{args.faults} stray episodes"],
        "seconds": round(time.monotonic() - started),
        "episodes": len(witness.numbers),
        "declared_missing": dict(sorted(witness.missing.items())),
        "bags": bags,
        "episodes_in_bags": recorded,
        "weights_episodes": match.known,
    }


def one_by_one(
    match: Match,
    executor: Executor,
    witness: Witness,
    intruders: Intruders,
    args: argparse.Namespace,
) -> Counter[str]:
    """Inject the faults, with what must hold checked after each; how many there were of a kind."""
    random, faults = np.random.default_rng(args.seed), Counter[str]()
    for number in range(args.faults):
        intruders.disturb(number)
        listen(executor, float(random.exponential(args.period)))
        fault = inject_fault(match, random, executor, args)
        faults[fault] += 1
        if fault == "simulator killed" or number % FAULTS_AN_EPISODE == 0:
            wait_for_episodes(executor, witness, 1)
        if number % FAULTS_A_PAUSE == FAULTS_A_PAUSE - 1:
            wait_for_everybody(executor, witness)
        match.check_weights()
        check_numbers(witness.numbers)
    return faults


def inject_fault(
    match: Match, random: np.random.Generator, executor: Executor, args: argparse.Namespace
) -> str:
    """Kill or freeze one node; what was done, in words."""
    nodes = match.nodes()
    players = sorted(set(nodes) - {"simulator"})
    hits_simulator = not players or random.random() < args.simulator_share
    name = "simulator" if hits_simulator else str(random.choice(players))
    team = name.partition("_")[0]
    is_kill = random.random() < args.kill_share
    with contextlib.suppress(ProcessLookupError, KeyError):  # between its end and its new start
        os.kill(nodes[name], signal.SIGKILL if is_kill else signal.SIGSTOP)
        if not is_kill:
            listen(executor, float(random.uniform(0.0, LONGEST_FREEZE)))
            os.kill(nodes[name], signal.SIGCONT)
        return f"{team} {'killed' if is_kill else 'frozen'}"
    return "nobody there"


def wait_for_episodes(executor: Executor, witness: Witness, more: int) -> None:
    """Wait until `count` more have ended.

    Raises:
        LossError: the match does not continue.
    """
    wanted, until = len(witness.numbers) + more, time.monotonic() + PATIENCE
    while len(witness.numbers) < wanted:
        executor.spin_once(0.1)
        if time.monotonic() > until:
            raise LossError(f"no episode ended within {PATIENCE:.0f} s")


def wait_for_everybody(executor: Executor, witness: Witness) -> None:
    """Wait until no player is missing.

    Raises:
        LossError: a player does not come back.
    """
    witness.absent, until = None, time.monotonic() + RETURN
    while witness.absent is None or witness.absent:
        executor.spin_once(0.1)
        if time.monotonic() > until:
            raise LossError(f"not back within {RETURN:.0f} s: {witness.absent or 'all'}")


def listen(executor: Executor, seconds: float) -> None:
    """Let so much time pass."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        executor.spin_once(max(0.0, until - time.monotonic()))


def check_numbers(numbers: list[int]) -> None:
    """Episodes are counted from 0, without a gap, each once.

    Raises:
        LossError: they are not.
    """
    if numbers != list(range(len(numbers))):
        raise LossError(f"episodes came as {numbers}")


def show(report: dict[str, object]) -> None:
    """The report as a table."""
    faults = dict(report["faults"])  # type: ignore[call-overload]
    rows = {**faults, **report, "faults": sum(faults.values()), "lost": "nothing"}
    for name, value in rows.items():
        print(f"{name:20} {value}")


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--faults", type=int, default=300, help="how many (default 300)")
    add("--period", type=float, default=0.5, help="[s] between two, on average (default 0.5)")
    add("--simulator-share", type=float, default=0.1, help="of all faults (default 0.1)")
    add("--kill-share", type=float, default=0.4, help="the rest freezes (default 0.4)")
    add("--task", default="3v2", help="keepers v takers (default 3v2)")
    add("--seed", type=int, default=0, help="of the match and of the faults (default 0)")
    add("--domain", type=int, default=73, help="ROS domain (default 73)")
    add("--json", action="store_true", help="end with one JSON object")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
