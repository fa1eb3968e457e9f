"""Make a whole bag of one whose recorder was killed, or that is damaged: of all whole chunks.

    .venv/bin/python scripts/repair_bag.py out/bag                    # writes out/bag_repaired
    .venv/bin/python scripts/repair_bag.py out/bag out/whole

The unfinished bag is left as it is.
"""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.bags.matches import find_matches
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.repair import repair
from keepaway_sim.errors import KeepawayError, one_line


def main() -> int:
    """Repair it, and say what is in it."""
    args = parse()
    output = args.output or args.bag.with_name(f"{args.bag.stem}_repaired")
    try:
        if is_whole(args.bag):
            print(f"{args.bag} is whole: nothing to repair")
            return 0
        made = repair(args.bag, output)
        print(f"{output}: {made.message_count} messages")
        for problem in made.problems:
            print(one_line(problem))
        for line in matches_in(made):
            print(line)
    except KeepawayError as error:
        print(f"repair_bag: {error}", file=sys.stderr)
        return 1
    return 0


def is_whole(path: Path) -> bool:
    """Whether a bag lacks nothing that a repair would make."""
    try:
        reader = BagReader(path)
    except KeepawayError:
        return False
    return reader.complete and (path / "metadata.yaml").is_file() and not reader.problems


def matches_in(reader: BagReader) -> Iterator[str]:
    """What is missing of every match of a bag; a match that cannot be read is named."""
    try:
        count = len(find_matches(reader))
    except KeepawayError as error:
        yield f"its match cannot be read: {error}"
        return
    for number in range(1, count + 1):
        which = f"match {number}: " if count > 1 else ""
        try:
            bag = MatchBag(reader.path, number)
            seconds = (bag.found.last[3] if bag.found.last else 0) / 1e9
            yield f"{which}until {seconds:.1f} simulated seconds: {count_gaps(bag).report()}"
        except KeepawayError as error:
            yield f"{which}{error}"
    if not count:
        yield "no match is in it"


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("bag", type=Path, metavar="BAG", help="the unfinished bag, folder or file")
    parser.add_argument("output", type=Path, nargs="?", help="bag to make")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
