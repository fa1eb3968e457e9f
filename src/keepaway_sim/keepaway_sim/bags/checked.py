"""What a bag says of a match is checked once, here; no other module checks it again.

Texts have a size, a depth and a shape; numbers are finite and possible; arrays are as long as the
match makes them.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from typing import Any

import numpy as np

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Action, Outcome, Task
from keepaway_sim.world.config import CYCLE_TIME, NEVER

_LONGEST_JSON = 2**18  # [bytes]
_DEEPEST_JSON = 8  # a configuration has 2
_LONGEST_NAME = 100
_FARTHEST = 1e4  # [m], [m/s], [rad]; nothing in a match is more
_RETIRED = ("hear_distance",)  # settings of earlier versions
_MOST = 2**31  # episodes, and cycles of an episode
MOST_VALUES = 64
"""Action values of a request."""
_PLAYER_NAME = re.compile(r"[A-Za-z]\w{0,39}")
_STRING = re.compile(r'"(?:[^"\\]|\\.)*"')


def read_json(text: str, what: str) -> Any:
    """The value of a JSON text that is no longer, and no deeper, than any of a match.

    Raises:
        KeepawayError: it is, or it is no JSON, or has numbers that are not finite.

    >>> read_json('{"physics": {"ball_decay": 0.94}}', "config_json")
    {'physics': {'ball_decay': 0.94}}
    """
    if len(text) > _LONGEST_JSON:
        raise KeepawayError(f"{what} has {len(text):,} characters, more than {_LONGEST_JSON:,}")
    depth = deepest = 0
    for letter in re.sub(r"[^\[\]{}]", "", _STRING.sub("", text)):
        depth += 1 if letter in "[{" else -1
        deepest = max(deepest, depth)
    if deepest > _DEEPEST_JSON:
        raise KeepawayError(f"{what} is nested {deepest} deep, more than {_DEEPEST_JSON}")
    try:
        return json.loads(text, parse_constant=_refuse_constant, parse_float=_finite)
    except (ValueError, RecursionError) as error:
        raise KeepawayError(f"{what} is no JSON: {error}") from error


def read_agents(text: str) -> dict[str, dict[str, Any]]:
    """The settings of every player that a bag says who played, by the player's name.

    Raises:
        KeepawayError: the text is anything else.
    """
    agents = read_json(text, "info 'agents'")
    if not isinstance(agents, dict) or not all(isinstance(a, dict) for a in agents.values()):
        raise KeepawayError("info 'agents' is not an object of settings by player")
    for name, settings in agents.items():
        for key, value in settings.items():
            words = value if isinstance(value, list) else [value]
            if not all(isinstance(word, str | int | float | bool | None) for word in words):
                raise KeepawayError(
                    f"info 'agents': {printable(name)}.{printable(key)} is no plain value"
                )
    return agents


def without_retired_settings(config: Any) -> Any:
    """A configuration of any version without the settings that went, which nothing ever read."""
    if not isinstance(config, dict):
        return config
    return {
        name: {key: value for key, value in group.items() if key not in _RETIRED}
        if isinstance(group, dict)
        else group
        for name, group in config.items()
    }


def kickable_distance(config: Any) -> float:
    """From how near [m] a player kicks the ball, by a configuration of any version.

    Raises:
        KeepawayError: it does not tell.
    """
    physics = config.get("physics") if isinstance(config, dict) else None
    parts = [
        physics.get(name) if isinstance(physics, dict) else None
        for name in ("player_size", "ball_size", "kickable_margin")
    ]
    total = 0.0
    for part in parts:
        if not isinstance(part, int | float) or not 0 <= part < _FARTHEST:
            raise KeepawayError("config_json does not tell from how near a player kicks the ball")
        total += part
    return total


def check_match(values: Mapping[str, Any]) -> Task:
    """The task of a Match message's fields.

    Raises:
        KeepawayError: a field is missing, or its value makes no sense.
    """
    absent = _MATCH_FIELDS.keys() - values.keys()
    if absent:
        raise KeepawayError(f"its definition of Match lacks {', '.join(sorted(absent))}")
    for name, kind in _MATCH_FIELDS.items():
        if not isinstance(values[name], kind):
            raise KeepawayError(f"{name} of its Match is a {type(values[name]).__name__}")
    for name in ("first_episode", "match_id"):  # newer than the others
        if not isinstance(values.get(name, 0), int) or not 0 <= values.get(name, 0) < 2**64:
            raise KeepawayError(f"{name} of its Match is no number from 0 on")
    for name in ("task", "profile", "code_version"):
        if len(values[name]) > _LONGEST_NAME or not values[name].isprintable():
            raise KeepawayError(f"{name}={printable(values[name])}: not a name")
    sides = values["field_length"], values["field_width"]
    task = Task(values["num_keepers"], values["num_takers"], *sides)
    _check_names(values["player_names"], task)
    if not abs(values["cycle_time"] - CYCLE_TIME) < 1e-9:
        raise KeepawayError(f"cycle_time={values['cycle_time']}: a cycle takes {CYCLE_TIME} s")
    if not 0 < values["visible_angle"] <= 2 * math.pi + 1e-9:
        raise KeepawayError(f"visible_angle={values['visible_angle']}: no angle up to 2 pi")
    return task


_MATCH_FIELDS: dict[str, type | tuple[type, ...]] = {
    "task": str, "profile": str, "num_keepers": int, "num_takers": int, "field_length": float,
    "field_width": float, "cycle_time": float, "visible_angle": float, "seed": int,
    "player_names": list, "code_version": str, "config_json": str,
}  # fmt: skip


def check_episodes(data: np.ndarray, task: Task) -> None:
    """Episode messages, (n,) of their dtype.

    Raises:
        KeepawayError: values that no episode of the task has.
    """
    _check_numbers(data, "number", "cycles")
    _check_stamps(data)
    _refuse(data["outcome"], (data["outcome"] < 1) | (data["outcome"] > 3), "an episode's outcome")
    by = data["lost_by"]
    _refuse(by, (by < -1) | (by >= task.num_keepers), "an episode's lost_by")
    off = ~(np.abs(data["duration"] - data["cycles"] * CYCLE_TIME) < CYCLE_TIME / 2)
    _refuse(data["duration"], off, "an episode's duration, which is not its cycles'")


def check_moments(data: np.ndarray) -> None:
    """What tells messages of a match apart: stamps, episodes and cycles, where they have them.

    Raises:
        KeepawayError: values that no match has.
    """
    _check_numbers(data, "episode", "cycle")
    if "stamp.sec" in (data.dtype.names or ()):
        _check_stamps(data)
    if "outcome" in (data.dtype.names or ()):
        _refuse(data["outcome"], data["outcome"] > max(Outcome), "an outcome")


def check_states(data: np.ndarray, task: Task) -> None:
    """FieldState messages, (n,) of their dtype.

    Raises:
        KeepawayError: values that no field has.
    """
    for name in ("positions", "velocities", "yaws", "neck_yaws"):
        _refuse(data[name], ~(np.abs(data[name]) < _FARTHEST), f"{name} of a field state")
    _check_actions(data["actions"], data["targets"], task.num_players, "a field state")


def check_perceptions(data: np.ndarray, player: int) -> None:
    """Perception messages of one player, (n,) of their dtype.

    Raises:
        KeepawayError: values that no perception of that player has.
    """
    whose = data["player_index"]
    _refuse(whose, whose != player, f"player_index of a perception of player {player}")
    place = data["positions"].reshape(*data["ages"].shape, 2)
    off = ~(np.abs(place) < _FARTHEST) & (data["ages"] < NEVER)[:, :, None]
    _refuse(place, off, "positions of a perception")


def check_requests(data: np.ndarray, player: int, task: Task) -> None:
    """ActionRequest messages of one player, (n,) of their dtype.

    Raises:
        KeepawayError: values that no request of that player has.
    """
    whose = data["player_index"]
    _refuse(whose, whose != player, f"player_index of a request of player {player}")
    _check_actions(data["action"], data["target"], task.num_players, "a request")
    if "action_values" in (data.dtype.names or ()):
        values = data["action_values"]
        _refuse(values, ~np.isfinite(values), "action_values of a request")


def check_count(count: int) -> int:
    """The number of a request's action values.

    Raises:
        KeepawayError: more than any learner chooses from.
    """
    if count > MOST_VALUES:
        raise KeepawayError(f"a request with {count:,} action values")
    return count


def printable(text: object) -> str:
    """Of an untrusted text as much as a line holds, without control characters."""
    return repr(str(text)[:40])


def _check_names(names: list[Any], task: Task) -> None:
    if len(names) != task.num_players or len(set(names)) != len(names):
        raise KeepawayError(
            f"player_names has {len(set(names))} names, {task.name} has {task.num_players} players"
        )
    for name in names:
        if not _PLAYER_NAME.fullmatch(name):
            raise KeepawayError(f"player_names has {printable(name)}: not a name")


def _check_numbers(data: np.ndarray, *names: str) -> None:
    for name in names:
        _refuse(data[name], data[name] >= _MOST, f"{name} of a message")


def _check_stamps(data: np.ndarray) -> None:
    _refuse(data["stamp.sec"], data["stamp.sec"] < 0, "seconds of a stamp")
    _refuse(data["stamp.nanosec"], data["stamp.nanosec"] >= 10**9, "nanoseconds of a stamp")


def _check_actions(action: np.ndarray, target: np.ndarray, num: int, whose: str) -> None:
    _refuse(action, action > max(Action), f"an action of {whose}")
    aimed = (action == Action.PASS_BALL) | (action == Action.MARK_KEEPER)
    _refuse(target, aimed & (target >= num), f"a target of {whose}")


def _refuse(values: np.ndarray, wrong: np.ndarray, what: str) -> None:
    if wrong.any():
        raise KeepawayError(f"{values[wrong].flat[0]!s} as {what}")


def _refuse_constant(text: str) -> Any:
    raise KeepawayError(f"{text} is no number of JSON")


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise KeepawayError(f"{text} is no finite number")
    return value


def moment_keys(data: np.ndarray) -> np.ndarray:
    """(n,) int64 by which messages of a match are ordered: episode, cycle, whether it ended.

    An episode that is aborted shows its last cycle twice.
    """
    cycle = data["cycle"].astype(np.int64) * 2
    if "outcome" in (data.dtype.names or ()):
        cycle += data["outcome"] != Outcome.IN_PLAY
    keys: np.ndarray = (data["episode"].astype(np.int64) << 32) + cycle
    return keys


def stamps_of(data: np.ndarray) -> np.ndarray:
    """(n,) int64 simulated times [ns]."""
    time: np.ndarray = data["stamp.sec"].astype(np.int64) * 10**9 + data["stamp.nanosec"]
    return time
