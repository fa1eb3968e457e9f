"""Draw an animation (GIF) of keepers on one field, in the colours of the page.

.venv/bin/python scripts/animate.py out/3v2 --seconds 12
.venv/bin/python scripts/animate.py --policy hand --task 4v3 --out out/hand.gif
"""

from __future__ import annotations

import argparse
import collections
import dataclasses
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from keepaway_agent.environments.pictures import TRAIL, Painter, scene_of
from keepaway_agent.errors import AgentError
from keepaway_agent.settings import build
from keepaway_agent.training.trainer import Trainer
from keepaway_agent.training.training import Training
from keepaway_agent.training.trial import Moment
from keepaway_sim.errors import KeepawayError

COLOURS = 48  # of the palette that all frames share
CYCLES_A_SECOND = 10


def main() -> int:
    """Play episodes until there are enough frames, and write them; a refusal is one line."""
    args = parse()
    try:
        frames = list(played(args))
        save(frames, args)
    except (AgentError, KeepawayError, OSError) as error:
        print(f"animate: {error}", file=sys.stderr)
        return 1
    print(f"{args.out}: {len(frames)} frames, {args.out.stat().st_size / 1e6:.1f} MB")
    return 0


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("weights", nargs="?", default="", help="weights file, or a folder of them")
    parser.add_argument("--task", default="3v2", help="keepers v takers (default 3v2)")
    parser.add_argument("--policy", help="of the keepers; default: greedy with weights, else hand")
    parser.add_argument("--seed", type=int, default=0, help="of the episodes (default 0)")
    parser.add_argument("--seconds", type=float, default=12.0, help="simulated (default 12)")
    parser.add_argument("--side", type=int, default=320, help="pixels (default 320)")
    parser.add_argument("--out", type=Path, default=Path("out/keepers.gif"), help="GIF to write")
    return parser.parse_args()


def played(args: argparse.Namespace) -> Iterator[Image.Image]:
    """A frame for every cycle of a trial."""
    policy = args.policy or ("greedy" if args.weights else "hand")
    chosen = {"task": args.task, "policy": policy, "seed": args.seed, "episodes": 20}
    training = build(Training, chosen | {"load_weights": args.weights})
    loaded = training.start()
    weights = np.stack([each.values for each in loaded]) if loaded else None
    painter = Painter(training.trainer.task)
    frames: list[Image.Image] = []
    trail: collections.deque[np.ndarray] = collections.deque(maxlen=TRAIL)

    def watch(moment: Moment) -> None:
        if len(frames) >= args.seconds * CYCLES_A_SECOND:
            return
        world, field = moment.world, moment.field
        if world.belief.cycle[field] == 0:
            trail.clear()
        trail.append(world.truth.position[field, -1].copy())
        drawn = painter.paint(scene_of(world, field, np.array(trail)))
        frames.append(Image.fromarray(drawn).resize((args.side, args.side)))

    trial = dataclasses.replace(training.trial(0, weights), watch=watch)
    for _ in Trainer(training.trainer, 1).run([trial]):
        pass
    yield from frames


def save(frames: list[Image.Image], args: argparse.Namespace) -> None:
    """Write the frames with one palette, ten a second."""
    palette = frames[0].quantize(COLOURS, Image.Quantize.FASTOCTREE)  # which keeps rare colours
    first, *others = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    period = round(1000 / CYCLES_A_SECOND)
    args.out.parent.mkdir(parents=True, exist_ok=True)
    first.save(args.out, save_all=True, append_images=others, duration=period, loop=0)


if __name__ == "__main__":
    sys.exit(main())
