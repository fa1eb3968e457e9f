"""What a match is played by, beside the world's constants."""

from __future__ import annotations

import attrs

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
    match_id: int = setting(
        0, "tells this match from every other one; 0: drawn at random", "", f"[0, {MOST}]"
    )
    answer_timeout: float = setting(
        2.0, "wall time after which a player who has not answered is unresponsive", "s", "(0, 3600]"
    )
    autostart: bool = setting(True, "kick off when all players are ready")
    record: str = setting("", "folder of a bag to write; empty: none")
    record_info: str = setting("{}", "JSON object of texts, written into the bag")
    record_attachments: str = setting("{}", "JSON object, name -> file to put into the bag")
    wait_for_recorder: bool = setting(
        False, "begin with the recorders' nodes, and play no faster than they follow"
    )
    force: bool = setting(False, "start although another simulator publishes its match here")


CHANGEABLE = ("speed", "answer_timeout")
"""Settings that may be changed while a match is running."""
