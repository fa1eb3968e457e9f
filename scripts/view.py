"""Watch a match in a browser, recorded or live, or take a picture of a moment.

    .venv/bin/python scripts/view.py out/bag                      # writes out/bag/replay.html
    .venv/bin/python scripts/view.py out/bag --episodes 0,90-99 --out match.html
    .venv/bin/python scripts/view.py out/bag --picture pass.png --episodes 3 --time 2.4
    .venv/bin/python scripts/view.py out/bag --add-markers out/for_foxglove
    .venv/bin/python scripts/view.py --live                       # the match that is on
    .venv/bin/python scripts/view.py --live --port 8080 --ros-args -r __ns:=/match_2

The page of a recording is one file and needs no network. That of a live match is served to this
machine only; --host 0.0.0.0 lets the whole network watch. What follows --ros-args goes to the node.
"""

import argparse
import math
import sys
import time
from pathlib import Path

import rclpy
from rclpy.signals import SignalHandlerOptions

from keepaway_sim.bags.marked import with_markers
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.cli.interrupts import Interruption, Stopped
from keepaway_sim.cli.options import numbers_in
from keepaway_sim.errors import KeepawayError
from keepaway_sim.nodes.spectator import DRAIN_PERIOD, Spectator
from keepaway_sim.ros.running import check_arguments, end_ros
from keepaway_sim.view.page import replay_page
from keepaway_sim.view.server import Server
from keepaway_sim.world.config import CYCLE_TIME

LAYOUT = Path(__file__).resolve().parents[1] / "src/keepaway_sim/foxglove/keepaway.json"


def main() -> int:
    """Write the page or the picture."""
    args, ros = parse()
    if args.live:
        return watch(args.host, args.port, ros)
    try:
        numbers = numbers_in(args.episodes) if args.episodes else None
        if args.add_markers:
            made = with_markers(args.bag, args.add_markers, args.match)
            print(f"{made.path}: {made.message_count} messages; open it in Foxglove with {LAYOUT}")
            return 0
        if args.picture:
            return take_picture(args, min(numbers) if numbers else None)
        text, said = replay_page(args.bag, numbers, number=args.match)
    except KeepawayError as error:
        print(f"view: {error}", file=sys.stderr)
        return 1
    out = args.out or (args.bag if args.bag.is_dir() else args.bag.parent) / "replay.html"
    out.write_text(text, encoding="utf-8")
    print(said)
    print(f"{out} ({len(text) / 1e6:.1f} MB): open it in a browser")
    return 0


def watch(host: str, port: int, ros: list[str]) -> int:
    """Serve the page of the match that is on, until a signal ends it; the exit code."""
    check_arguments("view", (), ros)
    try:
        server = Server(host, port)
    except (OSError, OverflowError) as error:
        print(f"view: {host}:{port}: {error}; --port takes another one", file=sys.stderr)
        return 1
    rclpy.init(args=ros, signal_handler_options=SignalHandlerOptions.NO)
    try:
        with Interruption():
            spectator = Spectator(server.match)
            print(f"open {server.url} in a browser; Ctrl-C ends it", flush=True)
            while True:
                spectator.poll()
                time.sleep(DRAIN_PERIOD)
    except Stopped as stopped:
        return stopped.code
    finally:
        server.close()
        end_ros()


def take_picture(args: argparse.Namespace, number: int | None) -> int:
    """Write a PNG of one moment, of the bag's first episode if no other is chosen."""
    from keepaway_sim.view.picture import picture  # matplotlib: half of what this script imports

    bag = MatchBag(args.bag, args.match)
    episodes = {episode.number: episode for episode in bag.episodes()}
    number = min(episodes, default=0) if number is None else number
    if number not in episodes:
        there = f"{min(episodes)}..{max(episodes)}" if episodes else "none that ended"
        raise KeepawayError(f"episode {number} is not in {args.bag}: it has {there}")
    episode = episodes[number]
    track = bag.track(episode)
    if not 0 <= args.time < math.inf:
        raise KeepawayError(f"--time {args.time}: give seconds since the episode's kick-off")
    row = min(round(args.time / CYCLE_TIME), len(track.time) - 1)
    names = bag.task.player_names
    if args.player not in (None, *names):
        raise KeepawayError(f"player {args.player!r}: the match has {', '.join(names)}")
    player = names.index(args.player) if args.player else -1
    angle = bag.match["visible_angle"]
    picture(track, row, bag.task, angle, player).savefig(args.picture)
    print(f"{args.picture}: episode {number} at {math.floor(10 * args.time) / 10} s")
    return 0


def parse() -> tuple[argparse.Namespace, list[str]]:
    """The command line: the script's options and ROS's."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path, metavar="BAG", nargs="?", help="folder of the bag")
    parser.add_argument("--match", type=int, help="number of the match, where the bag has several")
    parser.add_argument("--episodes", help="that can be watched, like 7 or 0,90-99; default: some")
    parser.add_argument("--out", type=Path, help="page to write (default BAG/replay.html)")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="a picture instead of a page")
    parser.add_argument("--add-markers", type=Path, metavar="NEW", help="copy with /markers")
    parser.add_argument("--time", type=float, default=0.0, help="of the picture [s]")
    parser.add_argument("--player", help="whose belief the picture shows, like keeper_1")
    parser.add_argument(
        "--live", action="store_true", help="serve the page of the match that is on"
    )
    parser.add_argument("--host", default="127.0.0.1", help="to serve on (default 127.0.0.1)")
    parser.add_argument("--port", type=int, default=8000, help="to serve on (default 8000)")
    words = sys.argv[1:]
    at = words.index("--ros-args") if "--ros-args" in words else len(words)
    args = parser.parse_args(words[:at])
    if args.live == bool(args.bag):
        parser.error("name a bag, or --live")
    return args, words[at:]


if __name__ == "__main__":
    sys.exit(main())
