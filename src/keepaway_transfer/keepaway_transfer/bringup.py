"""A whole match as ROS processes: which nodes, with which parameters. No ROS: for launch files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import attrs
import yaml

from keepaway_agent.playing.policies import KEEPER_POLICIES, TAKER_POLICIES
from keepaway_sim.errors import KeepawayError, SettingError
from keepaway_sim.match.settings import MatchSettings
from keepaway_sim.settings import build, same, setting, settings_of
from keepaway_sim.task import Role, Task
from keepaway_sim.world.config import Config

LEARNED = ("learn", "greedy")
"""Policies that begin with weights, if there are any."""
OF_THE_SIMULATOR = (
    *("task", "field", "profile", "seed", "speed", "episodes", "record", "force"),
    "answer_timeout",
)


@attrs.frozen
class BringUp:
    """The arguments of the launch file.

    Raises:
        SettingError: a value that is refused; the message names the argument.
    """

    task: str = same(MatchSettings, "task")
    field: str = same(MatchSettings, "field")
    profile: str = same(Config, "profile")
    seed: int = same(MatchSettings, "seed")
    speed: float = setting(
        1.0, "simulated over wall time; 0: as fast as the players answer", "1", "[0, 10000]"
    )
    episodes: int = same(MatchSettings, "episodes")
    answer_timeout: float = same(MatchSettings, "answer_timeout")
    record: str = same(MatchSettings, "record")
    force: bool = same(MatchSettings, "force")
    keeper_policy: str = setting("hand", "of every keeper", choices=tuple(KEEPER_POLICIES))
    taker_policy: str = setting("hand", "of every taker", choices=tuple(TAKER_POLICIES))
    load_weights: str = setting("", "file, or folder with NAME.npz, that players begin with")
    save_weights: str = setting("", "folder in which learners write NAME.npz")
    elsewhere: str = setting("", "players that are started otherwise, like keeper_1,taker_2")
    namespace: str = setting("", "of every node and topic, /clock included; empty: none")
    use_sim_time: bool = setting(False, "the players' clocks are the simulator's")
    params_file: str = setting("", "parameters of nodes that count more than these; empty: none")

    def __attrs_post_init__(self) -> None:
        try:
            names = Task.parse(self.task, self.field).player_names
        except KeepawayError as error:
            raise SettingError(f"task or field: {error}") from error
        for name in self.absent:
            if name not in names:
                raise SettingError(f"elsewhere={name}: {self.task} has {', '.join(names)}")
        for name in ("load_weights", "params_file"):
            path = getattr(self, name)
            if path and not Path(path).exists():
                raise SettingError(f"{name}={path}: there is no such file")

    @property
    def absent(self) -> list[str]:
        """Names of the players that it does not start."""
        return [name.strip() for name in self.elsewhere.split(",") if name.strip()]


class NodeSpec(NamedTuple):
    """One process of a match, as a launch file starts it."""

    package: str
    executable: str
    name: str
    parameters: dict[str, Any]
    remappings: list[tuple[str, str]]


def from_arguments(texts: Mapping[str, str]) -> BringUp:
    """The arguments as they are typed, `speed:=1.0`.

    Raises:
        SettingError: one that does not exist, or whose value is refused.

    >>> from_arguments({"task": "4v3", "speed": "0"}).speed
    0.0
    """
    known = settings_of(BringUp)
    return build(
        BringUp,
        {
            name: text if name not in known or known[name].kind is str else yaml.safe_load(text)
            for name, text in texts.items()
        },
    )


def node_specs(given: BringUp, match_id: int) -> list[NodeSpec]:
    """The simulator and every player, in match order; `match_id` holds them together."""
    task = Task.parse(given.task, given.field)
    remaps = [("/clock", "clock")] if given.namespace else []
    simulator = {name: getattr(given, name) for name in OF_THE_SIMULATOR}
    made = [
        NodeSpec(
            "keepaway_sim", "simulator", "simulator", {**simulator, "match_id": match_id}, remaps
        )
    ]
    for player, name in enumerate(task.player_names):
        if name in given.absent:
            continue
        role = task.role(player)
        parameters = {**player_parameters(given, name, role), "match_id": match_id}
        made.append(NodeSpec("keepaway_agent", role.name.lower(), name, parameters, remaps))
    return made


def player_parameters(given: BringUp, name: str, role: Role) -> dict[str, Any]:
    """The parameters of one player's node."""
    policy = given.keeper_policy if role == Role.KEEPER else given.taker_policy
    parameters: dict[str, Any] = {"policy": policy, "use_sim_time": given.use_sim_time}
    if policy in LEARNED and given.load_weights:
        path = Path(given.load_weights).absolute()
        parameters["load_weights"] = str(path / f"{name}.npz" if path.is_dir() else path)
    if policy == "learn" and given.save_weights:
        parameters["save_weights"] = str(Path(given.save_weights).absolute() / f"{name}.npz")
    return parameters
