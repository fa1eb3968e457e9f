"""Print what a weights file holds, and draw what was learned.

    .venv/bin/python scripts/describe.py out/3v2/keeper_1.npz
    .venv/bin/python scripts/describe.py out/3v2/keeper_1.npz --draw out/pictures
    .venv/bin/python scripts/describe.py out/3v2/*.npz --json

Drawn are the value of each action along each state variable, and which action is preferred as one
taker moves over the field. With --json there is one JSON object a file, one a line.
"""

import argparse
import json
import shlex
import sys
from pathlib import Path

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.describe import describe, draw_preferences, draw_values, save
from keepaway_agent.learning.weights import load_weights, to_metadata


def main() -> int:
    """Describe each file; a refusal is one line."""
    arguments = parse()
    try:
        for number, path in enumerate(arguments.weights):
            weights = load_weights(path)
            if arguments.json:
                print(json.dumps({"file": str(path), **to_metadata(weights)}, allow_nan=False))
            else:
                print(("\n\n" if number else "") + f"{path}: {describe(weights)}")
            if arguments.draw:
                command = shlex.join(["scripts/describe.py", *sys.argv[1:]])
                for what, draw in (("values", draw_values), ("preferences", draw_preferences)):
                    picture = arguments.draw / f"{path.stem}_{what}.png"
                    save(draw(weights), picture, command)
                    print(f"drawn: {picture}", file=sys.stderr)
    except (AgentError, OSError) as error:
        print(f"describe: {error}", file=sys.stderr)
        return 1
    return 0


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("weights", type=Path, nargs="+", help="weights files")
    parser.add_argument("--draw", type=Path, metavar="DIR", help="folder for the pictures")
    parser.add_argument(
        "--json", action="store_true", help="what a file contains beside the weights"
    )
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
