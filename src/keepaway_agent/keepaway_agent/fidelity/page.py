"""The page about how near the world is to the real one, written from measured numbers alone.

`scripts/checks/fidelity.py --page DIR` measures, keeps the numbers in `DIR/fidelity.json` and
writes `DIR/fidelity.md` from them; a test holds the two together.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from keepaway_agent.fidelity.measure import POINT
from keepaway_agent.fidelity.reference import reference, reference_curves

STAGES: Final = ("episodes_0_200", "episodes_2800_3000", "episodes_5285_5485")
"""Names of the reference's stages of learning, in order."""
FIRST_BLOCK: Final = 2
"""Blocks of POINT episodes before the band counts: they depend on who wins the first ties."""
LONG_BLOCK: Final = 3
"""Blocks of POINT episodes that are compared with the longest run together."""
INTRODUCTION: Final = """# How near the world is to the real one

Everything here was measured by `scripts/checks/fidelity.py --page` and compared with the RoboCup
soccer server 19.0.0 and UT Austin's keepaway players (`keepaway_sim/reference/`). Profile `2005`
has the parameters of the papers' time, `v19` those of today. No number of the world is tuned to
these: each rule follows the source named in its docstring.
"""


def page(numbers: Mapping[str, Any]) -> str:
    """The page in Markdown, of the parts that have been measured.

    Args:
        numbers: `cells` and `processes` of hold times, and `learned`, as the script keeps them.
    """
    parts = [INTRODUCTION]
    if "cells" in numbers:
        parts += ["## Hold times\n", _cells(numbers["cells"]), _commands(numbers, "cells")]
    if "processes" in numbers:
        parts += ["## Why episodes last as long as they do\n", _processes(numbers["processes"])]
    if "learned" in numbers:
        parts += ["## Learned play\n", *_learned(numbers["learned"])]
        parts += [_commands(numbers, "learned")]
    return "\n".join(parts)


def table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A table in Markdown."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def _commands(numbers: Mapping[str, Any], part: str) -> str:
    made = numbers["made"][part]
    return f"`{made['command']}`, version {made['code_version']}\n"


def _cells(cells: Sequence[Mapping[str, Any]]) -> str:
    header = ["profile", "view", "task", "keepers", "here (s)", "real server (s)", "ratio", "near?"]
    rows = []
    for cell in cells:
        theirs = cell["reference"]
        second = theirs["second_session_mean_s"]
        rows.append(
            [
                cell["profile"],
                str(cell["visible_angle"]),
                cell["task"],
                cell["policy"],
                f"{cell['mean_s']:.2f} ± {cell['sem_s']:.2f}",
                f"{theirs['mean_s']:.2f} ± {theirs['sem_s']:.2f}"
                + (f"; {second:.2f}" if second else ""),
                f"{cell['ratio']['estimate']:.2f}",
                "yes" if cell["goal_reached"] else "**no**",
            ]
        )
    return table(header, rows) + "\n![durations](fidelity.png)\n"


def _processes(processes: Sequence[Mapping[str, Any]]) -> str:
    header = ["here : real server", *(f"{each['task']} {each['policy']}" for each in processes)]
    rows = [
        [
            name.replace("_", " "),
            *(f"{each['ours'][name]:.3g} : {each['reference'][name]:.3g}" for each in processes),
        ]
        for name in processes[0]["ours"]
    ]
    return table(header, rows)


def _learned(learned: Mapping[str, Any]) -> list[str]:
    """Learning curves, behaviour and belief errors of 3v2 keepers."""
    durations = np.array(learned["curves_s"])
    mean, spread = durations.mean(axis=0), durations.std(axis=0, ddof=1)
    header = ["until episode", "here, mean ± 2 sd of trials", *("real run",) * 4]
    curves = reference_curves("2005")
    rows = [
        [
            str(POINT * (k + 1)),
            f"{mean[k]:.1f} ± {2 * spread[k]:.1f}",
            *(f"{curve[k]:.1f}" if k < len(curve) else "" for curve in curves),
        ]
        for k in range(len(mean))
    ]
    return [
        f"Means of {POINT} episodes of 3v2 (s), {len(durations)} trials here.\n",
        "![learning](learned.png)\n",
        table(header[: 2 + len(curves)], rows),
        _nearness(mean, spread, curves),
        _behaviour(learned["stages"]),
        _holding(learned["stages"][-1]),
        _beliefs(learned["belief_errors"]),
        "How learned keepers play, means of an episode:\n",
        _processes(learned["processes"]),
    ]


def _nearness(mean: np.ndarray, spread: np.ndarray, curves: Sequence[np.ndarray]) -> str:
    """How many blocks of the real runs lie in the band, and our mean over the longest run's."""
    counts = []
    for curve in curves:
        n = min(len(curve), len(mean))
        inside = np.abs(curve[:n] - mean[:n]) <= 2.0 * spread[:n]
        counts.append((int(inside[FIRST_BLOCK:].sum()), max(n - FIRST_BLOCK, 0)))
    each = ", ".join(f"{inside} of {of}" for inside, of in counts)
    longest = max(curves, key=len)
    n = min(len(longest), len(mean)) // LONG_BLOCK * LONG_BLOCK
    ours, theirs = (x[:n].reshape(-1, LONG_BLOCK).mean(axis=1) for x in (mean, longest))
    ratios = ", ".join(f"{ratio:.2f}" for ratio in ours / theirs)
    return (
        f"From episode {POINT * FIRST_BLOCK} on {each} blocks of the real runs lie inside mean ± 2"
        f" sd. Our mean over the longest run's, by {POINT * LONG_BLOCK} episodes: {ratios}.\n"
    )


def _holding(stage: Mapping[str, Any]) -> str:
    """Share of holding by the distance at which the nearest taker is believed."""
    ours = stage["hold_share_by_distance_to_T1_m"]
    theirs = reference("hold_times")["E05"]["learned_3v2"]["hold_share_by_distance_to_T1_m"]
    names = [name for name in ours if name in theirs]
    rows = [
        [f"here, from episode {stage['begin']}", *(f"{ours[name]:.2f}" for name in names)],
        ["real server", *(f"{theirs[name]:.2f}" for name in names)],
    ]
    return table(["share of holding, T1 at (m)", *names], rows)


def _behaviour(stages: Sequence[Mapping[str, Any]]) -> str:
    theirs = reference("hold_times")["E05"]["learned_3v2"]["behaviour"]
    names = theirs["columns"]
    header = ["stage", *(name.replace("_", " ") for name in names)]
    rows = []
    for stage, name in zip(stages, STAGES, strict=False):
        ours = [f"{stage['behaviour'][column]:.2f}" for column in names]
        rows.append([f"here, from episode {stage['begin']}", *ours])
        real = ["real server, " + name.replace("_", " "), *(str(x) for x in theirs[name])]
        rows.append(real)
    return table(header, rows)


def _beliefs(ours: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    theirs = reference("hold_times")["E05"]["belief_errors_of_keepers"]
    rows = []
    for name, errors in ours.items():
        for look, (bias, spread) in errors.items():
            real = theirs[name].get(look, [0.0, theirs[name].get(f"{look}_sd")])
            rows.append(
                [
                    name.replace("_", " "),
                    look.replace("_", " "),
                    f"{bias:.2f}, {spread:.2f}",
                    f"{real[0]:.2f}, {real[1]:.2f}",
                ]
            )
    header = ["believed minus true (m)", "", "here: bias, sd", "real server"]
    return table(header, rows)
