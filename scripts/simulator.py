"""Start the simulator's node: it publishes what is played and waits for the players.

    .venv/bin/python scripts/simulator.py --task 3v2 --seed 7 --speed 1
    .venv/bin/python scripts/simulator.py --visible-angle-deg 90 --ros-args -r __ns:=/match_2

Every parameter of the node is an option, the world's constants among them; what follows --ros-args
goes to the node as it is.
"""

import argparse
import sys

from keepaway_sim.cli.options import add_options, parse_node_arguments
from keepaway_sim.match.settings import MatchSettings
from keepaway_sim.nodes.simulator import main
from keepaway_sim.world.config import Config


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for group in (MatchSettings, Config):
        add_options(made, group)
    return made


if __name__ == "__main__":
    main(parse_node_arguments(parser(), sys.argv[1:]))
