"""What a match is played by, beside the world's constants."""

from __future__ import annotations

from dataclasses import dataclass

from keepaway_sim.errors import KeepawayError


@dataclass(frozen=True)
class MatchSettings:
    """The simulator's parameters beside the world's constants.

    Raises:
        KeepawayError: a value outside its range.
    """

    task: str = "3v2"
    field: str = "25x25"  # length x width [m]
    seed: int = 0
    speed: float = 0.0  # simulated over wall time; 0: as fast as the players answer
    episodes: int = 0  # to play, those before first_episode included; 0: without end
    first_episode: int = 0  # its number; to go on with a match whose simulator died
    answer_timeout: float = 2.0  # [s] wall time; a player who takes longer is missing
    autostart: bool = True  # kick off when all players are there
    record: str = ""  # folder of a bag to write; empty: none
    record_info: str = "{}"  # JSON object of texts, written into the bag
    record_attachments: str = "{}"  # JSON object, name -> file to put into the bag
    wait_for_recorder: bool = False  # play no faster than recorders' nodes follow

    def __post_init__(self) -> None:
        for name in ("seed", "episodes", "first_episode", "speed"):
            if not 0 <= getattr(self, name) < float("inf"):
                raise KeepawayError(f"{name}={getattr(self, name)}: give 0 or more")
        if not 0 < self.answer_timeout < float("inf"):
            raise KeepawayError(f"answer_timeout={self.answer_timeout}: give seconds above 0")


CHANGEABLE = ("speed", "answer_timeout")
"""Settings that may be changed while a match is running."""
