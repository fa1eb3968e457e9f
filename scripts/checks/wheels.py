"""Build the four wheels, install them into an empty environment, and play a match from there.

    .venv/bin/python scripts/checks/wheels.py

Nothing of the checkout is used but the wheels: the match is played in an empty folder. Ends with
code 1 and the reason where a step fails.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = ("msgs", "src/keepaway_sim", "src/keepaway_agent", "src/keepaway_transfer")
PLAYERS = {
    "keeper": ("keeper_1", "keeper_2", "keeper_3"),
    "taker": ("taker_1", "taker_2"),
}
PATIENCE = 600.0  # [s] for all episodes, machine code compiled before them


class WheelError(RuntimeError):
    """A step that failed, with what it printed."""


def main() -> int:
    """Build, install, play."""
    args = parse()
    with tempfile.TemporaryDirectory(prefix="wheels-") as made:
        folder = Path(made)
        try:
            names = build(folder / "dist")
            python = install(folder)
            size = play(python, folder / "away", args)
        except WheelError as error:
            print(f"wheels: {error}", file=sys.stderr)
            return 1
    print(f"{', '.join(names)}: installed; {args.episodes} episodes in a bag of {size:,} bytes")
    return 0


def build(dist: Path) -> list[str]:
    """Build every wheel; their names."""
    for source in SOURCES:
        copied = dist.parent / "source" / source
        run(["cp", "-R", f"{ROOT / source}/.", str(copied)], made=copied)
        command = ["uv", "build", "--no-build-isolation", "--wheel", "--out-dir", str(dist)]
        command += ["--python", sys.executable]  # not the one that this folder's .venv may have
        run([str(Path(sys.prefix, "bin", command[0])), *command[1:], str(copied)])
    return sorted(path.name for path in dist.glob("*.whl"))


def install(folder: Path) -> Path:
    """Make an environment of the wheels and what they need; its Python."""
    uv, python = str(Path(sys.prefix, "bin", "uv")), folder / "environment/bin/python"
    run([uv, "venv", "--quiet", "--python", sys.executable, str(folder / "environment")])
    wanted = [f"keepaway_{name}[ros]" for name in ("sim", "agent", "transfer")]
    places = ["--python", str(python), "--find-links", str(folder / "dist")]
    run([uv, "pip", "install", "--quiet", *places, *wanted])
    return python


def play(python: Path, folder: Path, args: argparse.Namespace) -> int:
    """Play a recorded match of hand-coded players; the size of its bag [bytes]."""
    folder.mkdir()
    kept = {"PATH", "HOME", "LANG", "TMPDIR", "NUMBA_CACHE_DIR"}
    environment = {name: value for name, value in os.environ.items() if name in kept} | {
        "ROS_DOMAIN_ID": str(args.domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "AMENT_PREFIX_PATH": str(python.parents[1]),
    }

    def start(program: str, *options: str, out: int = subprocess.DEVNULL) -> subprocess.Popen[str]:
        command = [str(python.with_name(program)), "--ros-args", *options]
        return subprocess.Popen(
            command, cwd=folder, env=environment, text=True, stdout=out, stderr=out
        )

    settings = ["-p", f"episodes:={args.episodes}", "-p", "record:=bag"]
    simulator = start("simulator", *settings, out=subprocess.PIPE)
    players = [
        start(program, "-r", f"__node:={name}")
        for program, names in PLAYERS.items()
        for name in names
    ]
    try:
        said, errors = simulator.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        raise WheelError(f"no {args.episodes} episodes within {PATIENCE:.0f} s") from None
    finally:
        for process in (simulator, *players):
            process.kill()
            process.wait()
    if simulator.returncode:
        raise WheelError(f"the simulator ended with code {simulator.returncode}:\n{errors}")
    bags = list(folder.glob("bag/*.mcap"))
    if not bags:
        raise WheelError(f"no bag was recorded:\n{said}{errors}")
    return sum(bag.stat().st_size for bag in bags)


def run(command: list[str], made: Path | None = None) -> None:
    """Run a step.

    Raises:
        WheelError: it failed.
    """
    if made:
        made.mkdir(parents=True)
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise WheelError(f"{' '.join(command)}:\n{done.stdout}{done.stderr}")


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--episodes", type=int, default=3, help="of 3v2 to play (default 3)")
    parser.add_argument("--domain", type=int, default=74, help="ROS domain (default 74)")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
