"""Start one taker's node: it waits for a match, then answers what it perceives.

    .venv/bin/python scripts/taker.py --name taker_2 --policy hand --ros-args -r __ns:=/match_2

Every parameter of the node is an option; what follows --ros-args goes to the node as it is. The
name is the player's: the match of a task has taker_1, taker_2 and so on.
"""

import argparse
import sys

from keepaway_agent.nodes.player import PlayerSettings
from keepaway_agent.nodes.taker import main
from keepaway_agent.playing.agent import AgentConfig, WeightsFiles
from keepaway_sim.cli.options import add_options, parse_node_arguments


def parser() -> argparse.ArgumentParser:
    """The command line."""
    made = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    made.add_argument("--name", default="", help="of the player (default taker_1)")
    for group in (AgentConfig, WeightsFiles, PlayerSettings):
        add_options(made, group)
    return made


if __name__ == "__main__":
    main(parse_node_arguments(parser(), sys.argv[1:]))
