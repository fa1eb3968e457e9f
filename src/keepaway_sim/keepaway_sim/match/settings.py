"""What a match is played by, beside the world's constants."""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import parse_qsl, urlencode

import attrs

from keepaway_sim.errors import SettingError
from keepaway_sim.settings import setting

MOST = 2**63 - 1
"""The largest whole number of a ROS parameter."""


@attrs.frozen
class MatchSettings:
    """The simulator's parameters beside the world's constants.

    Raises:
        SettingError: a value outside its range.
    """

    task: str = setting("3v2", "keepers v takers")
    field: str = setting("25x25", "length x width of the field", "m")
    seed: int = setting(0, "every random number of the match follows from it", "", f"[0, {MOST}]")
    speed: float = setting(
        0.0, "simulated over wall time; 0: as fast as the players answer", "1", "[0, 10000]"
    )
    episodes: int = setting(
        0,
        "to play, those before first_episode included; 0: without end",
        "episodes",
        "[0, 1000000000]",
    )
    first_episode: int = setting(
        0, "its number, to continue a match whose simulator died", "", "[0, 1000000000]"
    )
    match_id: int = setting(0, "identifies this match; 0: drawn at random", "", f"[0, {MOST}]")
    answer_timeout: float = setting(
        2.0, "wall time after which a player who has not answered is unresponsive", "s", "(0, 3600]"
    )
    autostart: bool = setting(True, "kick off when all players are ready")
    record: str = setting("", "folder of a bag to write; empty: none")
    record_info: str = setting("", "texts written into the bag: NAME=TEXT&NAME=TEXT, as in a URL")
    record_attachments: str = setting("", "files put into the bag: NAME=PATH&NAME=PATH")
    wait_for_recorder: bool = setting(
        False, "begin with the recorders' nodes, and play no faster than they follow"
    )
    force: bool = setting(False, "start although another simulator publishes its match here")


def named_texts(texts: Mapping[str, str]) -> str:
    """Texts by name as one parameter; no JSON, which `ros2 param load` cannot read from a text.

    >>> named_texts({"command": "match.py --seed 1"})
    'command=match.py+--seed+1'
    """
    return urlencode(texts)


def read_named_texts(name: str, value: str) -> dict[str, str]:
    """Texts by name from the parameter of that name.

    Raises:
        SettingError: it is not made like that.

    >>> read_named_texts("record_info", "command=match.py+--seed+1")
    {'command': 'match.py --seed 1'}
    """
    try:
        return dict(parse_qsl(value, keep_blank_values=True, strict_parsing=bool(value)))
    except ValueError as error:
        raise SettingError(f"{name}={value!r}: give NAME=TEXT&NAME=TEXT") from error


CHANGEABLE = ("speed", "answer_timeout")
"""Settings that may be changed while a match is running."""
