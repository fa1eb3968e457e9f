"""Watch a recorded match in a browser, or take a picture of a moment.

    .venv/bin/python scripts/view.py out/bag                      # writes out/bag/replay.html
    .venv/bin/python scripts/view.py out/bag --episodes 0,90-99 --out match.html
    .venv/bin/python scripts/view.py out/bag --picture pass.png --episodes 3 --time 2.4

The page is one file and needs no network.
"""

import argparse
import math
import sys
from pathlib import Path

from keepaway_sim.episodes import MatchBag
from keepaway_sim.errors import KeepawayError
from keepaway_sim.viewer import numbers_in, picture, replay_page


def main() -> int:
    """Write the page or the picture."""
    args = parse()
    try:
        numbers = numbers_in(args.episodes) if args.episodes else None
        if args.picture:
            return take_picture(args, min(numbers) if numbers else 0)
        text = replay_page(args.bag, numbers)
    except KeepawayError as error:
        print(f"view: {error}", file=sys.stderr)
        return 1
    out = args.out or (args.bag if args.bag.is_dir() else args.bag.parent) / "replay.html"
    out.write_text(text, encoding="utf-8")
    print(f"{out} ({len(text) / 1e6:.1f} MB): open it in a browser")
    return 0


def take_picture(args: argparse.Namespace, number: int) -> int:
    """Write a PNG of one moment."""
    bag = MatchBag(args.bag)
    episode = next((e for e in bag.episodes() if e.number == number), None)
    if episode is None:
        raise KeepawayError(f"episode {number} is not in {args.bag}")
    track = bag.track(episode)
    row = min(round(args.time / bag.match["cycle_time"]), len(track.time) - 1)
    player = bag.task.player_names.index(args.player) if args.player else -1
    angle = bag.match["visible_angle"]
    picture(track, row, bag.task, angle, player).savefig(args.picture)
    print(f"{args.picture}: episode {number} at {math.floor(10 * args.time) / 10} s")
    return 0


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="folder of the bag")
    parser.add_argument("--episodes", help="that can be watched, like 7 or 0,90-99; default: some")
    parser.add_argument("--out", type=Path, help="page to write (default BAG/replay.html)")
    parser.add_argument("--picture", type=Path, metavar="PNG", help="a picture instead of a page")
    parser.add_argument("--time", type=float, default=0.0, help="of the picture [s]")
    parser.add_argument("--player", help="whose belief the picture shows, like keeper_1")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
