"""The course of a match without ROS: players that answer, are late, are lost, come back."""

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from keepaway_sim.errors import LOG_PERIOD, KeepawayError
from keepaway_sim.match.beginning import begin_match
from keepaway_sim.match.conductor import BEGINS, Conductor
from keepaway_sim.match.reporting import LONG_WAIT
from keepaway_sim.match.settings import MatchSettings
from keepaway_sim.task import Action, Outcome, Task
from keepaway_sim.wire import messages
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import MessageHead, Request, action_request, read_head
from keepaway_sim.world.config import Config
from keepaway_sim.world.world import World

TASK = Task.parse("3v2")
TIMEOUT = 2.0  # [s]
PATIENCE = 100_000  # turns for a match to end

Lossy = Callable[[str, MessageHead], bool]
"""Whether a perception on a topic gets lost."""


def status(player: int, episodes: int = 0) -> bytes:
    """A player that is ready."""
    said = {"player_index": player, "name": TASK.player_names[player], "policy": "plain"}
    rest = {"learning": False, "ready": True, "episodes": episodes, "simulated_hours": 0.0}
    return codec(messages.AGENT_STATUS).encode({**said, **rest, "code_version": ""})


def plain_answer(player: int) -> Action:
    return Action.GET_OPEN if player < TASK.num_keepers else Action.GO_TO_BALL


class Stage:
    """A wall clock that only waiting moves, and players that answer when the match waits."""

    def __init__(self, **settings: Any) -> None:
        self.now = 0.0
        self.published: list[tuple[str, bytes, int]] = []
        self.recorded: list[str] = []
        self.reports: list[str] = []
        self.warnings: list[str] = []
        self.waited_for: list[int] = []  # how much had been published at each wait
        self.silent: set[int] = set()
        self.is_lost: Lossy = lambda topic, saying: False
        self.hook: Callable[[], None] = lambda: None
        self._answers: list[tuple[int, bytes]] = []
        self.world = World(TASK, Config())
        given = MatchSettings(**{"answer_timeout": TIMEOUT, **settings})
        self.match = Conductor(self.world, given, self, self, lambda: self.now)

    # What the match publishes through.

    def publish(self, topic: str, data: bytes, time: int) -> None:
        self.published.append((topic, data, time))
        self.repeat(topic, data)

    def repeat(self, topic: str, data: bytes) -> None:
        if not topic.endswith("/perception"):
            return
        seen = read_head(messages.PERCEPTION, data)
        player = seen.player_index
        if seen.decision_due and player not in self.silent and not self.is_lost(topic, seen):
            asked = Request(player, seen.episode, seen.cycle, plain_answer(player), 0)
            self._answers.append((player, action_request(asked)))

    def publish_if_wanted(self, topic: str, make: Callable[[], bytes], time: int) -> None:
        self.publish(topic, make(), time)

    def has_subscribers(self, topic: str) -> bool:
        return True

    def wait_until_received(self, patience: float) -> None:
        self.waited_for.append(len(self.published))

    def record_answer(self, topic: str, message_type: str, data: bytes, time: int) -> None:
        self.recorded.append(topic)

    def write_recorded(self) -> None:
        pass

    # What it reports to.

    def info(self, message: str) -> None:
        self.reports.append(message)

    def warning(self, message: str) -> None:
        self.info(message)
        self.warnings.append(message)

    error = warning

    # Playing.

    def arrive(self, *players: int) -> None:
        for player in players or range(TASK.num_players):
            self.match.take_status(player, status(player), b"")

    def spin(self, timeout: float) -> None:
        self.hook()
        answers, self._answers = self._answers, []
        for player, data in answers:
            self.match.take_request(player, data, b"")
        if not answers:
            self.now += max(timeout, 0.001)

    def play(self, until: Callable[[], bool] = lambda: False) -> None:
        turns = iter(range(PATIENCE))
        self.match.play(self.spin, lambda: until() or next(turns, None) is None)
        assert next(turns, None) is not None, "the match did not end"

    def sayings(self, player: int = 0) -> list[MessageHead]:
        """What one player perceived, in the order in which it was published first."""
        topic = f"{TASK.player_names[player]}/perception"
        return [read_head(messages.PERCEPTION, data) for t, data, _ in self.published if t == topic]

    def ended(self) -> list[tuple[int, int]]:
        """Cycles and outcome of every episode that was published."""
        episodes = [
            codec(messages.EPISODE).decode(d) for t, d, _ in self.published if t == "episode"
        ]
        return [(each["cycles"], each["outcome"]) for each in episodes]


def played_alone(episodes: int, seed: int) -> list[tuple[int, int]]:
    """The same match by the world alone."""
    world, found = World(TASK, Config()), list[tuple[int, int]]()
    begin_match(world, seed)
    action = np.array([[plain_answer(player) for player in range(TASK.num_players)]])
    while len(found) < episodes:
        seen = world.belief
        if seen.outcome[0] != Outcome.IN_PLAY:
            found.append((int(seen.cycle[0]), int(seen.outcome[0])))
        world.step(action.astype(np.int64), np.zeros_like(action, dtype=np.int64))
    return found


def test_a_match_is_what_the_world_plays_by_the_players_answers() -> None:
    stage = Stage(episodes=3, seed=5)
    stage.arrive()
    stage.play()
    assert stage.ended() == played_alone(3, seed=5)
    assert stage.match.num_finished == 3
    assert not [seat for seat in stage.match.roster.seats if seat.missed or seat.late]


def test_perceptions_that_are_lost_are_sent_again_and_change_nothing() -> None:
    stage, lost = Stage(episodes=2, seed=5), set()

    def lose_each_once(topic: str, saying: MessageHead) -> bool:
        is_new = (topic, saying) not in lost
        lost.add((topic, saying))
        return is_new and saying.cycle % 7 == 3

    stage.is_lost = lose_each_once
    stage.arrive()
    stage.play()
    assert stage.ended() == played_alone(2, seed=5)
    assert stage.match.roster.absent == []


def test_nothing_is_played_until_everybody_is_there() -> None:
    stage = Stage(episodes=1)
    stage.arrive(0, 1, 3, 4)
    stage.play(until=lambda: stage.now > 2 * LOG_PERIOD)
    assert stage.published == []
    assert "waits for keeper_3" in stage.reports
    assert BEGINS not in stage.reports
    assert stage.match.start() == "waits for keeper_3"
    stage.arrive(2)
    stage.play()
    assert stage.reports.count(BEGINS) == 1
    assert len(stage.ended()) == 1


def test_a_wait_for_players_is_a_warning_only_after_long() -> None:
    stage = Stage(episodes=1)
    stage.play(until=lambda: stage.now > LONG_WAIT - 1.0)
    assert len(stage.reports) > 5
    assert not stage.warnings
    stage.play(until=lambda: stage.now > 1.5 * LONG_WAIT)
    assert len(stage.warnings) == 1


def test_who_does_not_answer_times_out_and_is_back_from_the_next_kick_off() -> None:
    stage = Stage(episodes=2)
    stage.arrive()
    stage.silent = {1}
    stage.play(until=lambda: stage.match.num_cycles > 5)
    assert stage.match.state() == "plays without keeper_2"
    assert [text for text in stage.reports if text.startswith("keeper_2 timed out")]
    assert stage.now == pytest.approx(TIMEOUT, abs=0.5)  # it was waited for once
    stage.silent = set()
    stage.play(until=lambda: stage.match.num_finished == 1)
    assert stage.match.roster.absent == ["keeper_2"]
    stage.play()
    assert stage.match.roster.absent == []
    assert "keeper_2 is back" in stage.reports


def test_a_reset_ends_the_episode_at_a_moment_of_its_own() -> None:
    stage = Stage(episodes=2)
    stage.arrive()
    stage.play(until=lambda: stage.match.num_cycles == 4)
    assert stage.match.reset() == "ends the episode and kicks off the next one"
    stage.play(until=lambda: stage.match.num_finished == 1)
    for player in range(TASK.num_players):
        moments = [(seen.episode, seen.cycle) for seen in stage.sayings(player)]
        assert moments == sorted(set(moments))
        last = stage.sayings(player)[-1]
        assert (last.episode, last.outcome, last.decision_due) == (0, Outcome.ABORTED, False)
    stage.play()
    assert stage.ended()[0][1] == Outcome.ABORTED
    assert stage.ended()[1][1] != Outcome.ABORTED


def test_a_paused_match_goes_on_where_it_was() -> None:
    stage = Stage(episodes=1, seed=5, autostart=False)
    stage.arrive()
    stage.play(until=lambda: stage.now > 1.0)
    assert (stage.match.num_cycles, stage.match.state()) == (0, "pauses")
    assert stage.match.start() == "plays"
    stage.play(until=lambda: stage.match.num_cycles == 3)
    stage.match.pause()
    then = stage.now
    stage.play(until=lambda: stage.now > then + 1.0)
    assert stage.match.num_cycles == 3
    stage.match.start()
    stage.play()
    assert stage.ended() == played_alone(1, seed=5)


def test_in_real_time_a_cycle_takes_its_time() -> None:
    stage = Stage(speed=2.0)
    stage.arrive()
    stage.play(until=lambda: stage.match.num_cycles >= 1)
    then = stage.now
    stage.play(until=lambda: stage.match.num_cycles >= 41)
    assert stage.now - then == pytest.approx(40 * 0.1 / 2.0, abs=0.06)


@pytest.mark.parametrize("speed", [1.0, 3.0, 20.0])
def test_markers_are_published_ten_times_a_second(speed: float) -> None:
    stage = Stage(speed=speed)
    stage.arrive()
    stage.play(until=lambda: stage.now > 20.0)
    markers = [topic for topic, _, _ in stage.published if topic == "markers"]
    assert len(markers) / stage.now == pytest.approx(10.0, rel=0.05)


def test_the_match_waits_for_a_recorder_that_is_behind_but_not_for_ever() -> None:
    stage = Stage(wait_for_recorder=True)
    stage.arrive()
    stage.play(until=lambda: stage.now > 2 * LOG_PERIOD)
    assert "waits for a recorder" in stage.reports
    stage.match.take_recorded(struct.pack("<4xiI", 0, 0), b"it")
    stage.play(until=lambda: stage.match.num_cycles >= 60)
    assert "a recorder timed out: the match continues without it" in stage.reports


def test_messages_that_cannot_be_are_counted_and_warned_of_once() -> None:
    stage = Stage(episodes=1)
    stage.arrive()
    stage.match.take_request(0, b"nonsense", b"")
    stage.match.take_request(0, b"nonsense", b"")
    stage.match.take_status(0, status(1), b"")
    stage.match.take_recorded(b"", b"it")
    assert stage.match.roster.seats[0].rejected == 3
    assert len([text for text in stage.reports if "rejected" in text]) == 1
    assert len([text for text in stage.reports if text.startswith("recorded")]) == 1


def test_players_may_take_in_the_end_before_the_simulator_leaves() -> None:
    stage = Stage(episodes=1)
    stage.arrive()
    stage.play()
    ended = []
    stage.match.on_end = lambda: ended.append(stage.now)

    def report() -> None:
        for player in range(TASK.num_players):
            stage.match.take_status(player, status(player, episodes=1), b"")

    stage.hook = report
    then = stage.now
    stage.match.take_leave()
    assert len(ended) == 1
    assert stage.now - then < 1.0
    assert stage.waited_for == [len(stage.published)]  # everybody has all of it before it leaves
    assert stage.recorded[-1] == "taker_2/status"


def match_of_another(stage: Stage) -> bytes:
    return codec(messages.MATCH).encode({"task": "4v3", "match_id": stage.match.match_id + 1})


def test_a_simulator_that_finds_another_one_refuses_to_play() -> None:
    stage = Stage(episodes=1)
    stage.arrive()
    stage.match.take_match(match_of_another(stage), b"")
    with pytest.raises(KeepawayError, match=r"another simulator .* \(4v3\): choose .* force:=true"):
        stage.play()
    assert stage.match.num_cycles == 0


def test_a_second_simulator_with_the_number_of_the_match_is_another_one() -> None:
    stage = Stage(episodes=1)
    stage.arrive()
    data = codec(messages.MATCH).encode({"task": "3v2", "match_id": stage.match.match_id})
    stage.match.take_match(data, b"itself")
    stage.match.take_match(data, b"itself")
    assert stage.match.state() == "plays"
    stage.match.take_match(data, b"a copy started with its parameters")
    with pytest.raises(KeepawayError, match=r"another simulator .* \(3v2\): choose"):
        stage.play()


@pytest.mark.parametrize("is_forced", [True, False])
def test_a_match_that_is_running_goes_on_and_warns_of_another_simulator(is_forced: bool) -> None:
    stage = Stage(episodes=1, seed=5, force=is_forced)
    stage.arrive()
    if not is_forced:
        stage.play(until=lambda: stage.match.num_cycles == 3)
    stage.match.take_match(match_of_another(stage), b"")
    stage.match.take_match(b"nonsense", b"")
    stage.play()
    assert stage.ended() == played_alone(1, seed=5)
    assert [text for text in stage.reports if text.startswith("another simulator publishes")]


def test_players_of_another_match_are_not_waited_for() -> None:
    stage = Stage()
    other = codec(messages.AGENT_STATUS).decode(status(0))
    ready = {**other, "match_id": stage.match.match_id + 1}
    stage.match.take_status(0, codec(messages.AGENT_STATUS).encode(ready), b"")
    assert "keeper_1" in stage.match.roster.absent
    stage.match.take_status(
        0, codec(messages.AGENT_STATUS).encode({**ready, "match_id": stage.match.match_id}), b""
    )
    assert "keeper_1" not in stage.match.roster.absent


def test_every_message_says_whose_match_and_which_moment_it_is_about() -> None:
    stage = Stage(episodes=1, match_id=77)
    stage.match.announce()
    stage.arrive()
    stage.play()
    types = {
        "match": messages.MATCH,
        "episode": messages.EPISODE,
        "field_state": messages.FIELD_STATE,
    }
    seen = {topic: (data, time) for topic, data, time in stage.published}
    for topic, (data, time) in seen.items():
        if topic.endswith("/perception") or topic in types:
            message = codec(types.get(topic, messages.PERCEPTION)).decode(data)
            assert message["match_id"] == 77
            if topic != "match":
                assert message["header"] == messages.header(time)
                assert messages.read_match_id(data) == 77
