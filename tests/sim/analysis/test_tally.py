"""A bag's analysis: every number is what a slow, plain count over the tracks gives."""

import json
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from keepaway_sim.analysis.report import analyse
from keepaway_sim.analysis.tally import Analyst, EpisodeRow, episode_table
from keepaway_sim.bags.match_bag import MatchBag, Track
from keepaway_sim.bags.reader import BagReader, is_bag
from keepaway_sim.bags.writer import BagWriter
from keepaway_sim.task import Action


@pytest.fixture(scope="module")
def table(bag_3v2: Path) -> pd.DataFrame:
    return episode_table(bag_3v2)


def holders(track: Track) -> list[int]:
    """Who of the keepers has the ball within reach, cycle by cycle; -1 nobody."""
    found = []
    for position in track.position:
        away = np.linalg.norm(position[:3] - position[5], axis=1)
        found.append(int(away.argmin()) if away.min() < 1.085 else -1)
    return found


def test_every_row_is_what_its_episode_was(bag_3v2: Path, table: pd.DataFrame) -> None:
    bag = MatchBag(bag_3v2)
    for row, episode in zip(table.itertuples(), bag.episodes(), strict=True):
        track = bag.track(episode)
        holder = [k for k in holders(track) if k >= 0]
        requested = track.requested[:, :3]
        assert (row.number, row.cycles) == (episode.number, episode.cycles)
        assert row.start_s == pytest.approx(episode.start / 1e9)
        assert row.outcome == episode.outcome.name.lower()
        assert row.lost_by == f"keeper_{episode.lost_by + 1}"
        assert (row.lost_x, row.lost_y) == tuple(track.position[-1, 5])
        assert row.held_cycles == len(holder)
        assert row.passes == sum(a != b for a, b in pairwise(holder))
        assert row.holds == (requested == Action.HOLD_BALL).sum()
        assert row.decisions == row.holds + (requested == Action.PASS_BALL).sum()


def test_passes_and_actions_add_up(bag_3v2: Path, table: pd.DataFrame) -> None:
    analyst = Analyst(MatchBag(bag_3v2))
    assert len(list(analyst.rows())) == 4
    assert analyst.tally.passes.sum() == table.passes.sum()
    assert np.trace(analyst.tally.passes) == 0
    counts = BagReader(bag_3v2).counts
    names = analyst.bag.match["player_names"]
    asked = [counts[f"/{name}/action_request"] for name in names]
    assert analyst.tally.actions.sum(axis=1).tolist() == asked


def test_chunks_do_not_matter(bag_3v2: Path, tmp_path: Path, table: pd.DataFrame) -> None:
    with BagWriter(tmp_path / "bag", chunk_size=3000) as small:
        for m in BagReader(bag_3v2).messages():
            small.write(m.topic, m.message_type, m.data, m.log_time)
    pd.testing.assert_frame_equal(episode_table(tmp_path / "bag"), table)


def test_tables_and_figures_are_written(bag_3v2: Path, tmp_path: Path, table: pd.DataFrame) -> None:
    said = analyse(bag_3v2, tmp_path)
    assert "3v2: 4 episodes in" in said
    decisions = int(table.decisions.sum())
    assert sum(map(int, re.findall(r"of (\d+) requests with the ball", said))) == decisions
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "episodes.parquet"), table)
    written = pd.read_csv(tmp_path / "episodes.csv")
    pd.testing.assert_frame_equal(written, table)
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["mean_duration_s"] == pytest.approx(table.duration_s.mean())
    for name in ("hold_time", "passes", "losses", "actions"):
        assert (tmp_path / f"{name}.png").stat().st_size > 5_000


def test_a_match_without_a_finished_episode_is_no_error(bag_3v2: Path, tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag") as short:
        for m in BagReader(bag_3v2).messages(end=1_000_000_000):
            short.write(m.topic, m.message_type, m.data, m.log_time)
    # The topic is there, as it is in every match, with nothing on it yet.
    assert "no finished episode" in analyse(tmp_path / "bag", tmp_path / "out")
    assert list(pd.read_parquet(tmp_path / "out/episodes.parquet").columns) == list(
        EpisodeRow._fields
    )


def test_bags_are_told_from_other_things(bag_3v2: Path, tmp_path: Path) -> None:
    assert is_bag(bag_3v2)
    assert is_bag(next(bag_3v2.glob("*.mcap")))
    assert not is_bag(tmp_path)
    assert not is_bag(bag_3v2 / "metadata.yaml")
