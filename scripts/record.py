"""Record a match that is on, as a node of its own, until Ctrl-C.

    .venv/bin/python scripts/record.py out/bag
    .venv/bin/python scripts/record.py out/bag --compression lz4 --ros-args -r __ns:=/match_2

It ends with 1 if a cycle is missing, and names the topic; in a match that was running before, from
when it has received from every node. (To record at full speed let the simulator write the bag:
scripts/match.py --record.) What follows --ros-args goes to the node.
"""

import argparse
import sys

from keepaway_sim.cli.options import add_options, parse_node_arguments
from keepaway_sim.nodes.recorder import RecorderSettings, main


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("path", metavar="BAG", help="folder to make")
    add_options(made, RecorderSettings, without=("path",))
    return made


if __name__ == "__main__":
    main(parse_node_arguments(parser(), sys.argv[1:]))
