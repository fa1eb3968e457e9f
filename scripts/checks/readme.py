"""Write the figures of README.md anew from the committed data; without --write, say if they differ.

    .venv/bin/python scripts/checks/readme.py
    .venv/bin/python scripts/checks/readme.py --write

Its parts stand between `<!-- results: begin -->` and `<!-- results: end -->`, and `fidelity` alike:
what transfer is worth, from the trials in `src/keepaway_transfer/results`, and how near the world
is to the real server, from `src/keepaway_sim/docs/fidelity.json`. A test holds them to the data.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from page_parts import with_part

from keepaway_transfer.reports.evidence import Evidence, Studies, difference, read_evidence
from keepaway_transfer.reports.statistics import Comparison, Interval

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "README.md"
POLICIES = {"random": "random", "hand": "hand-coded"}

Lines = list[str]


def main() -> int:
    """Write the page, or compare it; 1 if it differs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--write", action="store_true", help="write README.md")
    is_written = parser.parse_args().write
    before = PAGE.read_text(encoding="utf-8")
    after = written(before)
    if is_written:
        PAGE.write_text(after, encoding="utf-8")
    elif before != after:
        print("readme: README.md differs from the data: --write writes it", file=sys.stderr)
        return 1
    return 0


def written(text: str) -> str:
    """The page with its parts written from the data.

    Raises:
        SystemExit: a part has no place in the page.
    """
    studies = read_evidence(ROOT / "src/keepaway_transfer/results")
    fidelity = json.loads((ROOT / "src/keepaway_sim/docs/fidelity.json").read_text())
    parts = {"results": results(studies), "fidelity": nearness(fidelity["cells"])}
    for name, lines in parts.items():
        text = with_part(text, name, "\n".join(["", *lines, "", ""]), PAGE)
    return text


def results(studies: Studies) -> Lines:
    """What transfer is worth, in five rows and a sentence."""
    table2, scaled, optimistic = (
        studies[name] for name in ("table2", "table2_scaled", "optimistic")
    )
    best = optimistic.best("target")
    rows = [
        ("nothing", table2, "0"),
        ("1,000 episodes of 3v2", table2, "1000"),
        ("6,000 episodes", table2, "6000"),
        (
            "6,000 episodes, all weights scaled down until an action is worth 5 s",
            scaled,
            "6000",
        ),
        (f"no 3v2, but every action worth {best}", optimistic, best),
    ]
    saved = difference((optimistic, best), (scaled, "6000"), "target_hours")
    longer = difference((scaled, "6000"), (scaled, scaled.scratch), "initial_performance")
    return [
        *table(
            ("4v3 begins with", "trials", "hours of 4v3", "hours in all"),
            [_result(*row) for row in rows],
        ),
        "",
        f"The scaled weights of 6,000 episodes take {spread(saved)} h of 4v3 less than the"
        f" optimistic start, and their keepers hold the ball {spread(longer)} s longer than new"
        " ones in their first 100 episodes.",
    ]


def _result(label: str, study: Evidence, name: str) -> tuple[str, ...]:
    row = study.rows[name]
    return label, str(row.trials), spread(row.target), spread(row.total)


def nearness(cells: Sequence[Mapping[str, Any]]) -> Lines:
    """Hold times beside the real server's: with the full view, and with one of 90 degrees."""
    known = {(c["profile"], c["visible_angle"], c["task"], c["policy"]): c for c in cells}
    rows = []
    for task in ("3v2", "4v3"):
        for policy, name in POLICIES.items():
            cell = known["2005", 360, task, policy]
            real = cell["reference"]["mean_s"], cell["reference"]["second_session_mean_s"]
            both = "; ".join(f"{mean:.1f}" for mean in real)
            rows.append((f"{task}, {name}", f"{cell['mean_s']:.1f}", both))
    narrow = ", ".join(
        f"{name} {cell['mean_s']:.1f} s (real {cell['reference']['mean_s']:.1f} s)"
        for policy, name in POLICIES.items()
        for cell in [known["2005", 90, "3v2", policy]]
    )
    return [
        *table(("task, keepers", "here", "real server, two sessions"), rows),
        "",
        f"With a view of 90 degrees in 3v2: {narrow}.",
    ]


def spread(estimate: Interval | Comparison) -> str:
    """An estimate with its interval, to a tenth."""
    return f"{estimate[0]:.1f} [{estimate[1]:.1f}, {estimate[2]:.1f}]"


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> Lines:
    """A table in Markdown."""
    return ["| " + " | ".join(line) + " |" for line in (header, ["---"] * len(header), *rows)]


if __name__ == "__main__":
    sys.exit(main())
