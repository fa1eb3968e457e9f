"""Does an agent keep to the contract? What a simulator sends to it, and a judge of its answers.

The sentences are those of `docs/agent_contract.md`. The script is plain data: steps made from the
random numbers of a seed, which know nothing of the world's rules. `nodes/scripted_simulator.py`
sends them to an agent and keeps a log; `judge` makes verdicts of the log.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple

import numpy as np

from keepaway_agent.actions import NEVER, UNREACHABLE, Outcome
from keepaway_agent.errors import AgentError

FIELD_SIZE: Final = 25.0  # [m]
CYCLE_TIME: Final = 0.1  # [s]
PAUSE: Final = 3.0  # [s] of wall time
MOST_ACTION_VALUES: Final = 64
CDR_HEADER: Final = b"\x00\x01\x00\x00"
"""Of every message. What begins otherwise an agent's middleware may refuse by itself; it then goes
on asking for it, and nothing that is published later arrives."""

READY: Final = "is ready"
ASKED: Final = "speaks when asked"
LEGAL: Final = "asks for what is legal"
LEAVES: Final = "leaves cleanly"
CHAPTERS: Final = {
    "answers": "answers every perception whose decision is due",
    "repeated": "answers again when a perception comes again",
    "reset": "continues after episodes that were aborted",
    "lost end": "continues when the end of an episode was never perceived",
    "unseen": "answers when it has never perceived another player",
    "pause": f"is silent in a pause of {PAUSE:.0f} s and continues after it",
    "clock": "continues when stamps jump an hour ahead and back to 0",
    "garbage": "survives malformed perceptions and continues",
    "new match": "plays on in a new match, from episode 0",
    "new size": "takes its place in a new match of another size",
}
"""The parts of the script, each of which puts one sentence to the test."""


class ScriptedMatch(NamedTuple):
    """A new match is announced; the agent has to say that it is ready."""

    num_keepers: int
    num_takers: int

    @property
    def player_names(self) -> list[str]:
        """In match order."""
        keepers = [f"keeper_{i + 1}" for i in range(self.num_keepers)]
        return [*keepers, *(f"taker_{i + 1}" for i in range(self.num_takers))]


@dataclass(frozen=True, eq=False)
class Shown:
    """A perception that the agent is shown; see the Perception message."""

    chapter: str  # of CHAPTERS
    player: int
    episode: int
    cycle: int
    due: bool
    kickable: bool
    position: np.ndarray  # (num_players + 1, 2) [m]
    age: np.ndarray  # (num_players + 1,) [cycles]
    cycles_to_ball: np.ndarray  # (num_players,) [cycles]
    outcome: int = Outcome.IN_PLAY
    stamp: float = 0.0  # [s]
    is_garbage: bool = False  # whatever is answered, if anything, is right

    @property
    def moment(self) -> tuple[int, int]:
        """What an answer must name."""
        return self.episode, self.cycle


class Garbage(NamedTuple):
    """Bytes on the perception's topic that are no message."""

    data: bytes


class Pause(NamedTuple):
    """Nothing is published for `seconds` seconds."""

    seconds: float


Step = ScriptedMatch | Shown | Garbage | Pause


class Request(NamedTuple):
    """An ActionRequest that the agent sent, `None` fields where its bytes were none."""

    player: int
    episode: int
    cycle: int
    action: int
    target: int
    action_values: Sequence[float]


@dataclass
class Exchange:
    """A step, and what the agent published until the next one."""

    step: Step
    requests: list[Request | None] = field(default_factory=list)  # None: bytes that are none
    ready: bool = False  # a Match: it reported that it is, with its name and index
    answer_time: float | None = None  # [s] a due Shown: until the first right answer


def script(name: str, seed: int = 0, one_size: bool = False) -> Iterator[Step]:
    """What the scripted simulator sends to the agent called `name`, chapter by chapter.

    Args:
        name: of a player of 3v2.
        seed: of the script's random numbers.
        one_size: leave out the match of another size, for an agent that learned 3v2.

    Raises:
        AgentError: a name that no player of 3v2 has.
    """
    rng = np.random.default_rng(seed)
    first = ScriptedMatch(3, 2)
    if name not in first.player_names:
        raise AgentError(f"{name!r}: choose one of {', '.join(first.player_names)}")
    yield first
    scenes = _Scenes(first, first.player_names.index(name), rng)
    yield from scenes.episode("answers", 60)
    yield from scenes.episode("answers", 40, Outcome.OUT_OF_BOUNDS)
    for shown in scenes.episode("repeated", 12):
        yield from (shown, shown)
    for _ in range(3):
        yield from scenes.episode("reset", 4, Outcome.ABORTED)
    yield from scenes.episode("reset", 10)
    yield from list(scenes.episode("lost end", 8))[:-1]
    yield from scenes.episode("lost end", 8)
    yield from scenes.episode("unseen", 10, unseen=True)
    yield Pause(PAUSE)
    yield from scenes.episode("pause", 10)
    for jump in (3600.0, -scenes.now - 3600.0):
        scenes.now += jump
        yield from scenes.episode("clock", 8)
    yield from _garbage(scenes, rng)
    yield from scenes.episode("garbage", 10)
    for chapter, match in (("new match", first), ("new size", ScriptedMatch(4, 3))):
        if match is first or not one_size:
            yield match
            scenes = _Scenes(match, match.player_names.index(name), rng)
            yield from scenes.episode(chapter, 20)


class _Scenes:
    """Episodes as one player may perceive them: all players wander about."""

    def __init__(self, match: ScriptedMatch, player: int, rng: np.random.Generator) -> None:
        self.now = 0.0  # [s] simulated
        self.num_players = len(match.player_names)
        self._match, self._player, self._rng, self._number = match, player, rng, 0

    def episode(
        self,
        chapter: str,
        num_cycles: int,
        outcome: Outcome = Outcome.TAKEN_AWAY,
        unseen: bool = False,
    ) -> Iterator[Shown]:
        """An episode's perceptions, the last of which has how it ended."""
        position = self._rng.uniform(-0.4, 0.4, (self.num_players + 1, 2)) * FIELD_SIZE
        number, self._number = self._number, self._number + 1
        for cycle in range(num_cycles + 1):
            position = position + self._rng.normal(0.0, 0.3, position.shape)
            shown = self._perceived(chapter, number, cycle, position)
            shown = self._blinded(shown) if unseen else shown
            is_last = cycle == num_cycles
            yield replace(shown, outcome=outcome, due=False) if is_last else shown
            self.now += CYCLE_TIME

    def _perceived(self, chapter: str, number: int, cycle: int, position: np.ndarray) -> Shown:
        kickable = bool(self._rng.random() < 0.4)
        seen = position.copy()
        if kickable:
            seen[-1] = seen[self._player] + 0.4
        far = np.linalg.norm(seen[:-1] - seen[-1], axis=1)
        is_keeper = np.arange(self.num_players) < self._match.num_keepers
        return Shown(
            chapter=chapter,
            player=self._player,
            episode=number,
            cycle=cycle,
            due=bool(cycle == 0 or self._rng.random() < 0.9),
            kickable=kickable,
            position=seen,
            age=self._rng.integers(0, 5, self.num_players + 1),
            cycles_to_ball=np.where(
                is_keeper == is_keeper[self._player], np.ceil(2 * far), UNREACHABLE
            ).astype(np.int64),
            stamp=self.now,
        )

    def _blinded(self, shown: Shown) -> Shown:
        """The same for a player that has perceived only itself."""
        own = np.arange(self.num_players + 1) == self._player
        return replace(
            shown,
            kickable=False,
            position=np.where(own[:, None], shown.position, 0.0),
            age=np.where(own, 0, NEVER),
            cycles_to_ball=np.full(self.num_players, UNREACHABLE),
        )


def _garbage(scenes: _Scenes, rng: np.random.Generator) -> Iterator[Step]:
    for data in (rng.bytes(60), bytes(8), b"\xff" * 300):
        yield Garbage(CDR_HEADER + data)
    for shown in scenes.episode("garbage", 1):
        bad = replace(shown, is_garbage=True, due=True)
        yield replace(bad, player=shown.player + 1)
        yield replace(bad, player=255, position=shown.position[:2], cycles_to_ball=np.zeros(0))
        yield replace(bad, position=np.full_like(shown.position, np.nan), outcome=200)
