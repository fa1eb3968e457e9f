"""Keep figures of the environments' page as JSON beside it, and write its tables from them.

    .venv/bin/python scripts/checks/environment_page.py --keep out/planner --keep out/network

Each folder is one that an example has made (its `figures.json`); `environment_speed.py` and
`hostile.py` keep theirs with `--write`. A test holds the page to what is kept.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from page_parts import with_part

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "src/keepaway_agent/examples"))

from figures import made_here  # noqa: E402 - of the examples
from intervals import bootstrap, half_width  # noqa: E402 - of the examples

__all__ = ["keep", "kept", "made_here", "written"]

PAGE = ROOT / "src/keepaway_agent/docs/environments.md"
KEPT = PAGE.with_suffix(".json")

Rows = Sequence[Sequence[str]]


def kept() -> dict[str, Any]:
    """All figures, by the part of the page that they are for."""
    figures: dict[str, Any] = json.loads(KEPT.read_text()) if KEPT.exists() else {}
    return figures


def keep(figures: Mapping[str, Any]) -> None:
    """Put figures in the place of earlier ones of the same part, and write the page."""
    together = dict(sorted((kept() | dict(figures)).items()))
    KEPT.write_text(json.dumps(together, indent=1, allow_nan=False) + "\n")
    PAGE.write_text(written(PAGE.read_text(), together))


def written(text: str, figures: Mapping[str, Any]) -> str:
    """The page with its parts written from the figures."""
    for name, figure in figures.items():
        made = f"`{figure['command']}`, version {figure['code_version']}"
        text = with_part(text, name, f"{PARTS[name](figure)}\n\n{made}\n", PAGE)
    return text


def speed(figure: Mapping[str, Any]) -> str:
    """Cycles a CPU second of every class beside the trainer's."""
    rows = []
    for fields, speeds in figure["cycles_a_cpu_second"].items():
        for name, value in speeds.items():
            share = f"{value / speeds['trainer']:.2f}"
            rows.append((f"{fields}, {name}", f"{value:,.0f}", share))
    return table(("", "cycles a CPU second", "of the trainer's"), rows)


def hostile(figure: Mapping[str, Any]) -> str:
    """What came of random and hostile calls."""
    rows = [
        (f"`{name}`", f"{calls:,}", f"{answered:,}", f"{calls - answered:,}", "0")
        for name, (calls, answered) in figure["calls"].items()
    ]
    header = ("class", "calls", "answered", "refused as documented", "anything else")
    return table(header, rows)


def planner(figure: Mapping[str, Any]) -> str:
    """How long planned episodes last beside hand-coded ones."""
    return _durations(figure, "keepers")


def self_play(figure: Mapping[str, Any]) -> str:
    """How long episodes of every pair of teams last."""
    return _durations(figure, "teams")


def learners(figure: Mapping[str, Any]) -> str:
    """How long episodes last at the end of training."""
    rows = []
    for name, curves in figure["curves"].items():
        last = np.array(curves)[:, -2:].mean(axis=1)
        low, high = last.mean() - half_width(last), last.mean() + half_width(last)
        rows.append((name, f"{last.mean():.1f}", f"{low:.1f} to {high:.1f}"))
    hours, trials = figure["settings"]["hours"], figure["settings"]["trials"]
    header = ("learner", f"last {hours / 10:g} of {hours:g} hours (s)", f"95 %, {trials} trials")
    return table(header, rows)


def _durations(figure: Mapping[str, Any], who: str) -> str:
    rows = []
    for name, durations in figure["durations"].items():
        low, high = bootstrap(np.array(durations))
        rows.append((name, f"{np.mean(durations):.1f}", f"{low:.1f} to {high:.1f}"))
    longest, count = figure["settings"]["longest"], figure["settings"]["episodes"]
    header = (who, f"mean duration (s), cut off at {longest:g} s", f"95 %, {count} episodes")
    return table(header, rows)


def table(header: Sequence[str], rows: Rows) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


PARTS: dict[str, Callable[[Mapping[str, Any]], str]] = {
    "speed": speed,
    "hostile": hostile,
    "planner": planner,
    "self_play": self_play,
    "learners": learners,
}
"""By name of the part: what writes it."""


def main() -> int:
    """Keep what examples have measured, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument(
        "--keep", type=Path, action="append", default=[], help="folder with figures.json"
    )
    figures: dict[str, Any] = {}
    for folder in parser.parse_args().keep:
        try:
            figures |= json.loads((folder / "figures.json").read_text())
        except (OSError, ValueError) as error:
            print(f"environment_page: {folder}: no figures ({error})", file=sys.stderr)
            return 1
    keep(figures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
