"""Make a whole bag of one whose recorder was killed: everything up to its last whole chunk.

    .venv/bin/python scripts/repair_bag.py out/bag                    # writes out/bag_repaired
    .venv/bin/python scripts/repair_bag.py out/bag out/whole

The unfinished bag is left as it is.
"""

import argparse
import sys
from pathlib import Path

from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.repair import repair
from keepaway_sim.errors import KeepawayError


def main() -> int:
    """Repair it, and say what is in it."""
    args = parse()
    output = args.output or args.bag.with_name(f"{args.bag.stem}_repaired")
    try:
        if BagReader(args.bag).complete and (args.bag / "metadata.yaml").is_file():
            print(f"{args.bag} is whole: nothing to repair")
            return 0
        whole = repair(args.bag, output)
    except KeepawayError as error:
        print(f"repair_bag: {error}", file=sys.stderr)
        return 1
    seconds = (whole.end_time - whole.start_time) / 1e9
    print(f"{output}: {whole.message_count} messages of {seconds:.1f} simulated seconds")
    print(count_gaps(whole).report())
    return 0


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
