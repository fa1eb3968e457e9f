"""Play a recorded match again, onto the topics that it was recorded from.

    .venv/bin/python scripts/replay.py out/bag
    .venv/bin/python scripts/replay.py out/bag --rate 4 --episodes 3-5 --loop true
    .venv/bin/python scripts/replay.py out/bag --topics match,keeper_1/perception
    .venv/bin/python scripts/replay.py out/bag --check

In a terminal the space bar pauses, the right arrow or . plays one cycle, + and - change the
rate, and q ends it. With the third line a keeper's node (scripts/keeper.py) answers what it would
have done; --start-delay 10 gives it time to get ready, and with --rate 4 it keeps up. --check plays
nothing: the world and the players are made anew, and must do again what was recorded. What follows
--ros-args goes to the node: -r __ns:=/again plays in a namespace.
"""

import argparse
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import rclpy
from rclpy.exceptions import InvalidParameterTypeException
from rclpy.executors import ExternalShutdownException
from rclpy.experimental import EventsExecutor
from rclpy.signals import SignalHandlerOptions

from keepaway_agent.checks.decisions import check_decisions
from keepaway_agent.errors import AgentError
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.playback import Playback
from keepaway_sim.bags.verify import check_world
from keepaway_sim.cli.interrupts import Stopped
from keepaway_sim.cli.options import add_options, parse_node_arguments
from keepaway_sim.errors import KeepawayError
from keepaway_sim.nodes.replayer import Replayer, ReplayerSettings, stoppable
from keepaway_sim.ros.running import check_arguments, end_ros
from keepaway_sim.version import code_version
from keepaway_sim.wire.messages import SECOND


class Quit(Exception):  # noqa: N818  # nothing went wrong
    """The key that ends the replay."""


def main() -> int:
    """Play it, or check it."""
    if "--check" in sys.argv:
        options = parser().parse_args()
        return check(Path(options.path), getattr(options, "match", 0))
    arguments = parse_node_arguments(parser(), sys.argv[1:])
    check_arguments("replay", (), arguments)
    try:
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
        replayer, executor = Replayer(), EventsExecutor()
        executor.add_node(replayer)
        with stoppable(executor) as spin, keys(replayer.playback) as obey:

            def spin_and_obey(seconds: float) -> None:
                spin(seconds)
                obey()

            count = replayer.play(spin_and_obey)
            replayer.linger()
        print(f"published {count} messages")
    except (KeepawayError, InvalidParameterTypeException) as error:
        print(f"replay: {error}", file=sys.stderr)
        return 1
    except Stopped as stopped:
        return stopped.code
    except KeyboardInterrupt:  # it had not begun
        return 128 + signal.SIGINT
    except (Quit, ExternalShutdownException):
        pass
    finally:
        end_ros()
    return 0


def check(path: Path, number: int) -> int:
    """Say whether the recorded match replays."""
    differs = False
    try:
        bag = MatchBag(path, number)
        for who, what, run in (
            ("the world", "cycles", check_world),
            ("players", "decisions", check_decisions),
        ):
            checked = run(bag)
            verdict = checked.difference or "the same, all of them"
            print(f"{who}: {checked.episodes} episodes, {checked.compared} {what}: {verdict}")
            differs |= checked.difference is not None
        if differs and bag.match["code_version"] != code_version():
            print(f"recorded by version {bag.match['code_version']}, this is {code_version()}")
    except (KeepawayError, AgentError) as error:
        print(f"replay: {error}", file=sys.stderr)
        return 1
    return int(differs)


@contextmanager
def keys(playback: Playback) -> Iterator[Callable[[], None]]:
    """Let the keyboard rule a playback while the block lasts; without a terminal nothing does."""
    if not sys.stdin.isatty():
        yield lambda: None
        return
    before = termios.tcgetattr(sys.stdin)
    tty.setcbreak(sys.stdin)
    try:
        yield lambda: obey_key(playback)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)
        print()


def obey_key(playback: Playback) -> None:
    """Do what the last key asks for, and show where the playback is."""
    key = ""
    while select.select([sys.stdin], [], [], 0)[0]:
        key += sys.stdin.read(1)
    if key == " ":
        (playback.resume if playback.paused else playback.pause)()
    elif key in (".", "\x1b[C"):
        playback.step()
    elif key in ("+", "-"):
        playback.rate = playback.rate * (2.0 if key == "+" else 0.5)
    elif key == "q":
        raise Quit
    state = "paused" if playback.paused else f"x {playback.rate:g}"
    print(f"\r{playback.time / SECOND:9.1f} s  {state:8}", end="", flush=True)


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("path", metavar="BAG", help="folder of the bag")
    made.add_argument(
        "--check", action="store_true", default=argparse.SUPPRESS, help="that it replays, no ROS"
    )
    add_options(made, ReplayerSettings, without=("path",))
    return made


if __name__ == "__main__":
    sys.exit(main())
