"""Process statistics of episodes: when the ball is reached, kicked and passed; how all move.

They say *why* episodes last as long as they do. The same definitions serve true positions of the
real soccer server and those of this world.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np

REACH = 1.085  # [m] S: kickable distance
PLAYER_DECAY = 0.4  # recorded speeds are those after decay


class Trajectories(NamedTuple):
    """True positions of whole episodes, one row a cycle; episodes one after the other."""

    episode: np.ndarray  # (num_rows,) int
    ball: np.ndarray  # (num_rows, 4) x, y [m], vx, vy [m/cycle]
    players: np.ndarray  # (num_rows, num_players, >= 4) x, y, vx, vy; keepers first
    commands: np.ndarray  # (num_rows, num_players, 3) running counts of kicks, dashes, turns


def process_statistics(trajectories: Trajectories, num_keepers: int) -> dict[str, float]:
    """Means over episodes (cycles of 0.1 s, metres).

    Args:
        trajectories: any number of episodes; the terminal cycle may be missing.
        num_keepers: players before this index are keepers.
    """
    rows = [
        _episode_statistics(*_rows(trajectories, episode), num_keepers)
        for episode in np.unique(trajectories.episode)
    ]
    names = rows[0].keys()
    return {name: _mean([row[name] for row in rows]) for name in names}


def _mean(values: list[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")


def _rows(t: Trajectories, episode: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rows = t.episode == episode
    return t.ball[rows], t.players[rows], t.commands[rows]


def _episode_statistics(
    ball: np.ndarray, players: np.ndarray, commands: np.ndarray, num_keepers: int
) -> dict[str, float]:
    away = np.linalg.norm(players[:, :, :2] - ball[:, None, :2], axis=2)
    keepers = (away[:, :num_keepers] < REACH).any(axis=1)
    takers = (away[:, num_keepers:] < REACH).any(axis=1)
    speed = np.linalg.norm(ball[:, 2:4], axis=1)
    first_taker = _first(takers)
    run = np.linalg.norm(players[:, :, 2:4], axis=2) / PLAYER_DECAY
    done = commands[-1] - commands[0]
    cycles = max(len(ball) - 1, 1)
    passes, pass_cycles, pass_metres = _passes(away[:, :num_keepers], ball)
    reached = not np.isnan(first_taker)
    return {
        "first_keeper_reach": _first(keepers),
        "first_taker_reach": first_taker,
        "taker_reach_to_end": len(ball) - first_taker,
        "taker_in_reach": float(takers.sum()),
        "both_in_reach": float((takers & keepers).sum()),
        "keeper_kicks": float(done[:num_keepers, 0].sum()),
        "taker_kicks": float(done[num_keepers:, 0].sum()),
        "final_ball_speed": float(speed[-1]),
        "fastest_ball_after_taker": float(speed[int(first_taker) :].max()) if reached else np.nan,
        "taker_speed": float(run[:, num_keepers:].mean()),
        "keeper_speed": float(run[:, :num_keepers].mean()),
        "taker_dash_share": float(done[num_keepers:, 1].mean() / cycles),
        "taker_turn_share": float(done[num_keepers:, 2].mean() / cycles),
        "passes": passes,
        "pass_cycles": pass_cycles,
        "pass_metres": pass_metres,
    }


def _first(flags: np.ndarray) -> float:
    return float(np.argmax(flags)) if flags.any() else float("nan")


def _passes(away: np.ndarray, ball: np.ndarray) -> tuple[float, float, float]:
    """Number of completed passes, mean cycles and mean metres of one.

    A pass lasts from the last cycle in which one keeper alone has the ball in reach to the first
    in which another has.
    """
    owner = np.where((away < REACH).any(axis=1), away.argmin(axis=1), -1)
    held = np.flatnonzero(owner >= 0)
    changes = [(a, b) for a, b in itertools.pairwise(held) if owner[a] != owner[b]]
    if not changes:
        return 0.0, float("nan"), float("nan")
    cycles = float(np.mean([b - a for a, b in changes]))
    metres = float(np.mean([np.linalg.norm(ball[b, :2] - ball[a, :2]) for a, b in changes]))
    return float(len(changes)), cycles, metres
