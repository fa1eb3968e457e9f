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

from keepaway_agent.fidelity.reference import reference_curves
from keepaway_transfer.reports.evidence import Evidence, Studies, difference, read_evidence
from keepaway_transfer.reports.never_hurts import TABLES, best_row, nearest_constant, worse
from keepaway_transfer.reports.page_parts import elsewhere
from keepaway_transfer.reports.statistics import Comparison, Interval
from keepaway_transfer.reports.summary import verdict

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "README.md"
WAY = "table2_averaged_scaled"  # the study of the way that the page recommends
EPISODES_A_BLOCK = 200  # that a point of a learning curve of the real server is the mean of
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
        SystemExit: a part has no place in the page; a sentence that the data do not bear out.
    """
    studies = read_evidence(ROOT / "src/keepaway_transfer/results")
    fidelity = json.loads((ROOT / "src/keepaway_sim/docs/fidelity.json").read_text())
    parts = {"results": results(studies), "fidelity": nearness(fidelity)}
    for name, lines in parts.items():
        text = with_part(text, name, "\n".join(["", *lines, "", ""]), PAGE)
    return text


def results(studies: Studies) -> Lines:
    """What transfer is worth, in five rows and a sentence."""
    table2, scaled, optimistic = (studies[name] for name in ("table2", WAY, "optimistic"))
    best = optimistic.best("target")
    rows = [
        ("nothing", table2, "0"),
        ("1,000 episodes of 3v2", table2, "1000"),
        ("3,000 episodes", table2, "3000"),
        (f"6,000 episodes, by `{scaled.row('6000').variant}`", scaled, "6000"),
        (f"no 3v2, but every action expected to be worth {best}", optimistic, best),
    ]
    saved = difference((optimistic, best), (scaled, "6000"), "target_hours")
    longer = difference((scaled, "6000"), (scaled, scaled.scratch), "initial_performance")
    said = [sentence for sentence, holds in claims(studies) if _checked(sentence, holds)]
    return [
        *table(
            ("4v3 begins with", "trials", "hours of 4v3", "hours in all"),
            [_result(*row) for row in rows],
        ),
        "",
        f"`{scaled.row('6000').variant}` gives weights never learned the mean of the others, and"
        " multiplies all until an action is worth 5 s on average. With those of"
        f" 6,000 episodes 4v3 takes {spread(saved)} h less than from the constant start, and"
        f" keepers hold the ball {spread(longer)} s longer than new ones in their first 100"
        " episodes.",
        "",
        *(f"- {sentence}" for sentence in said),
        "",
        "All of it: [what transfer is worth](src/keepaway_transfer/docs/results.md).",
    ]


def claims(studies: Studies) -> list[tuple[str, bool]]:
    """What the page says in words, each with whether the data say so, too."""
    table2, optimistic, variants, late = (
        studies[name] for name in ("table2", "optimistic", "variants_1000", "variants_6000")
    )
    against = [row.against[table2.scratch] for row in table2.rows.values() if row.against]
    start, best = (optimistic, optimistic.best("target")), (table2, table2.best("target"))
    beside = difference(start, best, "target_hours")
    level = difference((variants, "rho"), (variants, "level"), "target_hours")
    safe = worse(studies, WAY)
    gains = {
        name: f"{variants.rows[name].against[variants.scratch].target.difference:.1f}"
        for name in ("rho", "shuffled")
    }
    takes = {name: f"{late.rows[name].target.estimate:.1f}" for name in ("rho", "shuffled")}
    in_5v4 = {name: f"{row.target.estimate:.1f}" for name, row in studies["fivevfour"].rows.items()}
    mapping = difference((late, "shuffled"), (late, "rho"), "target_hours")
    early = studies["confirmation"]
    few = early.best("total")
    ahead = early.rows[few].against[early.scratch]
    nearest = nearest_constant(studies)
    totals = [best_row(studies, name, "total") for name in TABLES if name in studies]
    real = {arm["source_hours"]: arm for arm in elsewhere()["real_server"]["arms"]}
    scratch, most = real[0.0], real[max(real)]
    return [
        (
            "As in the paper, every amount of 3v2 makes 4v3 quicker, and too much of it helps"
            " less. On the real server, one run each, much 3v2 did not make it quicker.",
            all(verdict(one.target, one.target_holm) == "saves" for one in against)
            and difference((table2, "9000"), best, "target_hours").low > 0
            and most["to_9"] is None
            and most["to_8"] >= scratch["to_8"],
        ),
        (
            "A constant start is within an hour of the best amount; in 5v4 it takes"
            f" {in_5v4['5 s']} h, after 4v3 {in_5v4['4v3']}. Of what 1,000 episodes"
            f" of 3v2 carry, the mean value alone saves {spread(level)} h more than all of it; a"
            f" shuffled mapping saves {gains['shuffled']} h where rho saves {gains['rho']}. After"
            f" 6,000 the mapping matters: shuffled it takes {takes['shuffled']} h, by rho"
            f" {takes['rho']}.",
            max(abs(beside.low), abs(beside.high)) < 1 and level.low > 0 and mapping.low > 0,
        ),
        (
            "What 3v2 adds to a constant shows when all weights are made smaller: then more 3v2 no"
            " longer hurts 4v3.",
            difference((studies[WAY], "3000"), (studies[WAY], "9000"), "target_hours").low > -1,
        ),
        (
            "`averaged_scaled@5` is, in 4v3 hours and after 1,000 episodes or more, nowhere shown"
            " to be worse than scratch or a constant (by"
            f" {max(one.at_most for one in safe):.1f} h at most).",
            not any(one.rows for one in safe),
        ),
        (
            f"In all hours {few} episodes of 3v2 at a level of 5 s (`{early.row(few).variant}`)"
            f" save {spread(ahead.total)} h against that constant on new trials, and"
            f" {spread(nearest.saved)} against the best of three, {nearest.constant}; no other way"
            " does.",
            verdict(ahead.total, ahead.total_holm) == "saves"
            and verdict(nearest.saved, nearest.p_value) == "saves"
            and not any(one.verdict == "saves" for one in totals),
        ),
    ]


def _checked(sentence: str, holds: bool) -> bool:
    if not holds:
        raise SystemExit(f"readme: the data do not say: {sentence!r} Write it anew in claims().")
    return True


def _result(label: str, study: Evidence, name: str) -> tuple[str, ...]:
    row = study.rows[name]
    return label, str(row.trials), spread(row.target), spread(row.total)


def nearness(fidelity: Mapping[str, Any]) -> Lines:
    """Hold times beside the real server's: with the full view, and with one of 90 degrees."""
    cells = fidelity["cells"]
    known = {(c["profile"], c["visible_angle"], c["task"], c["policy"]): c for c in cells}
    rows = []
    for task, policy in (("3v2", "random"), ("3v2", "hand"), ("4v3", "hand")):
        cell = known["2005", 360, task, policy]
        real = cell["reference"]["mean_s"], cell["reference"]["second_session_mean_s"]
        both = "; ".join(f"{mean:.1f}" for mean in real)
        rows.append((f"{task}, {POLICIES[policy]}", f"{cell['mean_s']:.1f}", both))
    longest = max(reference_curves("2005"), key=len)
    learned = sum(curve[len(longest) - 1] for curve in fidelity["learned"]["curves_s"])
    mean = learned / len(fidelity["learned"]["curves_s"])
    until = f"{len(longest) * EPISODES_A_BLOCK:,}"
    rows.insert(
        2, (f"3v2, learned until episode {until}", f"{mean:.1f}", f"{longest[-1]:.1f} (one run)")
    )
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
