"""Carry what a keeper learned to a larger task; write a mapping down; start the transfer node.

    .venv/bin/python scripts/transfer.py apply keeper_1.npz 4v3 --out start.npz
    .venv/bin/python scripts/transfer.py apply keeper_1.npz 4v3 5v4 --out start.npz
    .venv/bin/python scripts/transfer.py apply keeper_1.npz 4v3 --variant rho_shape@5 --out s.npz
    .venv/bin/python scripts/transfer.py apply keeper_1.npz 4v3 --variant optimistic@5 --out o.npz
    .venv/bin/python scripts/transfer.py mapping 3v2 4v3 > mine.toml
    .venv/bin/python scripts/transfer.py apply keeper_1.npz 4v3 --mapping mine.toml --out b.npz
    .venv/bin/python scripts/transfer.py node --ros-args -r __ns:=/match_2

Several tasks are a chain: rho from each to the next. A level in seconds behind a variant's name is
what actions are worth on average: rho_shape@5 keeps the order of states in 3v2 and nothing
else.
"""

import argparse
import dataclasses
import shlex
import sys
from pathlib import Path

from keepaway_agent.errors import AgentError
from keepaway_agent.learning.cmac import WIDTH_PROFILES
from keepaway_agent.learning.weights import load_weights, save_weights
from keepaway_agent.texts import one_line
from keepaway_sim.errors import KeepawayError
from keepaway_transfer.errors import MappingError
from keepaway_transfer.mapping import load_mapping
from keepaway_transfer.rho import Transfer, transferred
from keepaway_transfer.variants import VARIANTS


def main() -> int:
    """Do what the command line says; a refusal is one line."""
    arguments = _parse()
    try:
        return int(arguments.run(arguments))
    except (AgentError, KeepawayError, OSError) as error:
        print(f"transfer: {error}", file=sys.stderr)
        return 1


def _apply(arguments: argparse.Namespace) -> int:
    mapping = load_mapping(arguments.mapping) if arguments.mapping else None
    if mapping is not None and len(arguments.tasks) > 1:
        raise MappingError("--mapping is for one step: name one task")
    source = weights = load_weights(arguments.weights)
    for task in arguments.tasks:
        step = Transfer(task, arguments.variant, mapping, arguments.seed, arguments.widths)
        weights = transferred(weights, step)
    command = shlex.join(["scripts/transfer.py", *sys.argv[1:]])
    weights = dataclasses.replace(weights, created_by=one_line(command))
    save_weights(arguments.out, weights, overwrite=arguments.overwrite)
    how = f"by {arguments.mapping or arguments.variant}"
    print(f"{source.task} -> {' -> '.join(arguments.tasks)} {how}: {arguments.out}")
    return 0


def _mapping(arguments: argparse.Namespace) -> int:
    step = Transfer(arguments.target, arguments.variant, seed=arguments.seed)
    print(step.mapping_from(arguments.source).to_toml(), end="")
    return 0


def _node(arguments: argparse.Namespace) -> int:
    from keepaway_transfer.nodes import transfer  # the others do without ROS

    transfer.main(arguments.ros)
    return 0


def _parse() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    commands = parser.add_subparsers(required=True)
    apply = commands.add_parser("apply", help="weights file in, weights file out")
    apply.add_argument("weights", type=Path, help="of a keeper of the source task")
    apply.add_argument("tasks", nargs="+", help="target task, for example 4v3; several: a chain")
    apply.add_argument("--out", type=Path, required=True, help="weights file to write")
    apply.add_argument("--mapping", type=Path, help="your own, a TOML file")
    apply.add_argument(
        "--widths", choices=sorted(WIDTH_PROFILES), default="", help="of tiles; default: as before"
    )
    apply.add_argument("--overwrite", action="store_true", help="replace the file at --out")
    apply.set_defaults(run=_apply)
    mapping = commands.add_parser("mapping", help="print a mapping as TOML, a start for your own")
    mapping.add_argument("source", help="for example 3v2")
    mapping.add_argument("target", help="for example 4v3")
    mapping.set_defaults(run=_mapping)
    node = commands.add_parser(
        "node",
        help="a ROS 2 node that carries weights over when asked",
        usage="%(prog)s [--ros-args ..]",
    )
    node.set_defaults(run=_node)
    for command in (apply, mapping):
        command.add_argument(
            "--variant", default="rho", metavar="NAME[@SECONDS]", help=f"{', '.join(VARIANTS)}"
        )
        command.add_argument("--seed", type=int, default=0, help="of the shuffled mapping")
    arguments, ros = parser.parse_known_args()
    if ros and arguments.run != _node:
        parser.error(f"unrecognized arguments: {shlex.join(ros)}")
    arguments.ros = ros
    return arguments


if __name__ == "__main__":
    sys.exit(main())
