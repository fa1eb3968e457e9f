"""Where a researcher starts: a bag and a study as pandas tables, and three plots of them.

    .venv/bin/python scripts/match.py --episodes 20 --keeper-policy hand --record out/bag
    .venv/bin/python scripts/explore.py out/bag src/keepaway_transfer/results/table2

Copy this page and change it. Its cells (`# %%`) run one by one in editors that know them. Every
column has its unit in README.md of `msgs/` or in `studies/records.py`.
"""

# %% What is read, and where the figure goes
import argparse
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd

from keepaway_sim.bags.match_bag import MatchBag
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Action
from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.results import read_results

mpl.use("Agg")
from matplotlib import pyplot as plt

parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
parser.add_argument("bag", type=Path, help="folder of a recorded match")
parser.add_argument("study", type=Path, help="folder of a study's results")
parser.add_argument("--out", type=Path, default=Path("out/explore.png"), help="figure to write")
args = parser.parse_args()
try:
    bag, study = MatchBag(args.bag), read_results(args.study)
    courses = dict(bag.tracks(list(bag.episodes())))
except (KeepawayError, StudyError, OSError) as error:
    sys.exit(f"explore: {error}")
if not courses:
    sys.exit(f"explore: {args.bag}: no finished episode")
num_keepers = bag.task.num_keepers

# %% The bag: a row for each episode
episodes = pd.DataFrame(list(courses)).assign(outcome=[each.outcome.name for each in courses])
print(episodes[["number", "duration", "outcome"]].groupby("outcome").duration.describe())

# %% The bag: a row for each choice of a keeper with the ball (what it asked for, who was near)
parts = []
for episode, course in courses.items():
    asked = course.requested[:, :num_keepers]
    cycle, keeper = np.nonzero(np.isin(asked, (Action.HOLD_BALL, Action.PASS_BALL)))
    own = course.position[cycle, keeper, None]
    takers = course.position[cycle, num_keepers:-1]
    columns = {
        "episode": episode.number,
        "cycle": course.cycle[cycle],
        "keeper": keeper + 1,
        "passes": asked[cycle, keeper] == Action.PASS_BALL,
        "taker_distance": np.linalg.norm(takers - own, axis=2).min(axis=1),  # [m]
    }
    parts.append(pd.DataFrame(columns))
choices = pd.concat(parts, ignore_index=True)
print(choices.head())

# %% The study: a row for each trial
trials = pd.DataFrame(study.records)
trials["row"] = pd.Categorical(trials.row, [row.name for row in study.study.rows])  # their order
trials["total_hours"] = trials.source_hours + trials.crossing_hours
print(trials.groupby("row", observed=True)[["crossed", "crossing_hours", "total_hours"]].mean())

# %% Three plots
figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13, 4), layout="constrained")
episodes.duration.plot.hist(ax=left, bins=15, title=f"{len(episodes)} episodes of {args.bag.name}")
left.set(xlabel="duration (s)", ylabel="episodes")

metres = pd.cut(choices.taker_distance, np.arange(0, 13))
shares = choices.groupby(metres, observed=True).passes.mean()
middle.plot([each.mid for each in shares.index], shares, marker="o")
middle.set(
    title=f"{len(choices):,} choices with the ball",
    xlabel="distance of the nearest taker (m)",
    ylabel="share of passes",
    ylim=(0, 1.05),
)

hours = trials.groupby("row", observed=True)[["crossing_hours", "total_hours"]].agg(["mean", "sem"])
for place, (column, label) in enumerate(
    [("crossing_hours", f"{study.study.target} alone"), ("total_hours", "with the source task")]
):
    mean, half = hours[column]["mean"], 1.96 * hours[column]["sem"]
    right.errorbar(np.arange(len(mean)) + 0.1 * place, mean, half, fmt="o", label=label)
right.set_xticks(range(len(hours)), hours.index, rotation=45)
right.set(
    title=f"{study.study.name}: hours until {study.study.threshold:g} s\n(else all played)",
    xlabel="row",
    ylabel="simulated hours (95 %)",
    ylim=(0, None),
)
right.legend()
args.out.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(args.out, dpi=110)
print(f"drew {args.out}")
