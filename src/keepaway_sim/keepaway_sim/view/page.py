"""Pictures of a moment of a match, and the page to watch it: `replay.html`, one file, no network.

The page's data is one int16 row ("frame") for every cycle of an episode; `layout` says where in it
what is. A live match is sent to the page in the same frames.
"""

from __future__ import annotations

import base64
import functools
import html
import json
import math
from collections.abc import Collection, Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from keepaway_sim.bags.checked import check_match
from keepaway_sim.bags.gaps import count_gaps
from keepaway_sim.bags.match_bag import EpisodeSummary, MatchBag, Track
from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.world.config import NEVER

NO_VALUE = -32768
"""In a frame: not known."""
_CYCLES = 2**15  # a frame has a cycle's number in two parts: below this, and how often this
MOST_CYCLES_SHOWN = 12_000
"""Cycles in a page if its episodes are not chosen: about 5 MB of 3v2."""


def layout(task: Task) -> tuple[dict[str, int], int]:
    """Where each part of a frame begins, and a frame's size.

    Positions are in cm, angles in 1/10000 rad, times in cycles, action values in 1/10 cycle;
    arrays in the order of `episodes.Track`.
    """
    num, objects = task.num_players, task.num_players + 1
    counts = {
        "cycle": 1,
        "cycle_high": 1,
        "outcome": 1,
        "position": 2 * objects,
        "yaw": num,
        "neck": num,
        "action": num,
        "target": num,
        "requested": num,
        "requested_target": num,
        "believed": 2 * num * objects,
        "age": num * objects,
        "values": num * task.num_keepers,
    }
    starts = np.cumsum([0, *counts.values()]).tolist()
    return dict(zip(counts, starts, strict=False)), starts[-1]


@np.errstate(over="ignore")  # what overflows is not shown, like all that is not finite
def frames(track: Track, task: Task) -> np.ndarray:
    """A track as the page wants it: (num_cycles, size) int16."""
    scaled = {
        "cycle": track.cycle % _CYCLES,
        "cycle_high": track.cycle // _CYCLES,
        "outcome": track.outcome,
        "position": 100 * track.position,
        "yaw": 1e4 * track.yaw,
        "neck": 1e4 * track.neck,
        "action": track.action,
        "target": track.target,
        "requested": track.requested,
        "requested_target": track.requested_target,
        "believed": np.where(track.age[..., None] < NEVER, 100 * track.believed, np.nan),
        "age": track.age,
        "values": 10 * track.values,
    }
    count = len(track.time)
    columns = [_int16(scaled[name]).reshape(count, -1) for name in layout(task)[0]]
    return np.concatenate(columns, axis=1)


def _int16(values: np.ndarray) -> np.ndarray:
    known = np.isfinite(values)
    clipped = np.clip(np.rint(np.where(known, values, 0)), NO_VALUE + 1, 32767)
    whole: np.ndarray = np.where(known, clipped, NO_VALUE).astype("<i2")
    return whole


def encoded(rows: np.ndarray) -> str:
    """Frames as base64, for JSON."""
    return base64.b64encode(rows.astype("<i2").tobytes()).decode()


def match_data(
    match: Mapping[str, Any],
    facts: Sequence[str] = (),
    agents: Mapping[str, Mapping[str, Any]] | None = None,
) -> dict[str, Any]:
    """What the page must know of a match.

    Args:
        match: a Match message's fields.
        facts: more to show of it.
        agents: the settings of every player, by name, where they are known.

    Raises:
        KeepawayError: fields that make no sense.
    """
    task = check_match(match)
    starts, size = layout(task)
    angle = math.degrees(match["visible_angle"])
    return {
        "task": match["task"],
        "names": list(match["player_names"]),
        "num_keepers": task.num_keepers,
        "field_length": task.field_length,
        "field_width": task.field_width,
        "cycle_time": match["cycle_time"],
        "visible_angle": match["visible_angle"],
        "orderings": [
            "k1" if (agents or {}).get(name, {}).get("ordering") == "k1" else "ball"
            for name in match["player_names"]
        ],
        "facts": [
            f"seed {match['seed']}",
            f"{task.field_length:g} × {task.field_width:g} m",
            f"players see {angle:.0f}°",
            f"rules of {match['profile']}",
            *facts,
            f"version {match['code_version']}",
        ],
        "layout": starts,
        "frame_size": size,
    }


def episode_data(episode: EpisodeSummary) -> dict[str, Any]:
    """What the page's list shows of an episode."""
    return {
        "number": episode.number,
        "duration": round(episode.duration, 3),
        "outcome": int(episode.outcome),
        "lostBy": episode.lost_by,
    }


def replay_page(
    path: Path | str,
    numbers: Collection[int] | None = None,
    max_cycles: int = MOST_CYCLES_SHOWN,
    number: int | None = None,
) -> tuple[str, str]:
    """The page of a bag, all in one text; and what the bag misses, in words.

    Args:
        path: the bag.
        numbers: the episodes that can be watched; by default some, spread over the match. All
            are in the list and in the learning curve.
        max_cycles: of the default choice together.
        number: of the match, from 1 on, where the bag has several.

    Raises:
        KeepawayError: no such bag, or no such episodes in it.
    """
    bag = MatchBag(path, number)
    episodes = list(bag.episodes())
    rest = bag.unfinished()
    if rest is not None:
        episodes.append(rest)
    gaps = count_gaps(bag).report()
    if not episodes:
        raise KeepawayError(f"{path} has no episode to show: {gaps}")
    wanted = chosen_episodes(episodes, numbers, max_cycles)
    shown = {
        episode.number: encoded(frames(track, bag.task))
        for episode, track in bag.tracks([e for e in episodes if e.number in wanted])
    }
    entries = [
        episode_data(e) | ({"frames": shown[e.number]} if e.number in shown else {})
        for e in episodes
    ]
    agents, facts = _who_played(bag)
    data = {
        "live": False,
        "match": match_data(bag.match, [*facts, gaps], agents),
        "episodes": entries,
    }
    return page(data), gaps


def page(data: Mapping[str, Any]) -> str:
    """The page with its data in it."""
    match = data["match"]
    parts = {
        "title": html.escape(f"Keepaway {match['task']}" if match else "Keepaway, live"),
        "css": _part("page.css"),
        "script": _part("pure.js") + _part("page.js"),
        "data": json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    }
    made = _part("page.html")
    for name, text in parts.items():
        made = made.replace("{{" + name + "}}", text)
    return made


def chosen_episodes(
    episodes: Sequence[EpisodeSummary], numbers: Collection[int] | None, max_cycles: int
) -> set[int]:
    """The numbers of the episodes that a page shows.

    Raises:
        KeepawayError: nothing to show.
    """
    have = {episode.number for episode in episodes}
    if numbers is not None:
        chosen = have & set(numbers)
        if not chosen:
            span = f"{min(have)}..{max(have)}" if have else "none"
            raise KeepawayError(f"none of the episodes asked for is there: the bag has {span}")
        return chosen
    if not have:
        raise KeepawayError("the bag has no episode")
    every = 1
    while sum(e.cycles for e in episodes[::every]) > max_cycles and every < len(episodes):
        every += 1
    return {episode.number for episode in episodes[::every]}


def _who_played(bag: MatchBag) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """The players' settings, and how each team played in words.

    Where the bag's are no settings, the words say so: the match can be watched all the same.
    """
    try:
        teams = _policies(bag.agents).items()
        return bag.agents, [f"{role} {policy}" for role, policy in teams]
    except KeepawayError as error:
        return {}, [str(error)]


def _policies(agents: Mapping[str, Mapping[str, Any]]) -> dict[str, str]:
    """Who played how, where the bag contains it and a team plays alike."""
    teams: dict[str, set[str]] = {}
    for name, settings in agents.items():
        teams.setdefault(name.split("_")[0] + "s", set()).add(
            str(settings.get("policy", "hand"))[:40]
        )
    return {team: policies.pop() for team, policies in teams.items() if len(policies) == 1}


@functools.cache
def _part(name: str) -> str:
    return (resources.files("keepaway_sim.view") / "web" / name).read_text(encoding="utf-8")
