"""What a recording misses is counted and named."""

from pathlib import Path

import pytest

from keepaway_sim.bags.gaps import GapCounter
from keepaway_sim.bags.reader import BagReader
from keepaway_sim.bags.topics import Recorded
from keepaway_sim.wire.cdr import codec
from keepaway_sim.wire.messages import ACTION_REQUEST, EPISODE, FIELD_STATE, PERCEPTION


@pytest.fixture(scope="module")
def recorded(bag_3v2: Path) -> list[Recorded]:
    return list(BagReader(bag_3v2).messages())


def counted(messages: list[Recorded]) -> GapCounter:
    counter = GapCounter()
    for message in messages:
        counter.feed(message.topic, message.message_type, message.data)
    return counter


def nth(messages: list[Recorded], topic: str, number: int) -> Recorded:
    return [m for m in messages if m.topic == topic][number]


def test_nothing_is_missing_of_a_whole_recording(recorded: list[Recorded]) -> None:
    counter = counted(recorded)
    assert set(counter.missing().values()) == {0}
    assert set(counter.unanswered_decisions().values()) == {0}
    assert counter.report().startswith("nothing is missing of ")
    assert counter.complete_until() == recorded[-1].log_time


@pytest.mark.parametrize("number", [0, 5, 6, -1])
def test_a_lost_perception_is_named_wherever_it_was(recorded: list[Recorded], number: int) -> None:
    lost = nth(recorded, "/keeper_2/perception", number)
    counter = counted([m for m in recorded if m is not lost])
    missing = counter.missing()
    assert missing.pop("/keeper_2/perception") == 1
    assert set(missing.values()) == {0}
    assert "/keeper_2/perception misses 1 cycles" in counter.report()


def test_many_lost_cycles_are_counted_across_the_end_of_an_episode(
    recorded: list[Recorded],
) -> None:
    end = next(m.log_time for m in recorded if m.topic == "/episode")
    lost = range(end - 300_000_000, end + 300_000_000, 100_000_000)
    kept = [m for m in recorded if m.topic != "/field_state" or m.log_time not in lost]
    assert counted(kept).missing()["/field_state"] == 6


def test_a_perception_sent_again_is_counted_once(recorded: list[Recorded]) -> None:
    first = nth(recorded, "/taker_1/perception", 0)
    counter = counted([m for message in recorded for m in [message] * (1 + (message is first))])
    assert counter.topics["/taker_1/perception"].repeated == 1
    assert set(counter.missing().values()) == {0}
    assert set(counter.unanswered_decisions().values()) == {0}


def test_messages_of_another_match_are_not_counted_but_said(recorded: list[Recorded]) -> None:
    counter = GapCounter(match_id=7)
    kinds = (FIELD_STATE, PERCEPTION, EPISODE, ACTION_REQUEST)
    for message in recorded:
        if message.message_type not in kinds:
            continue
        layout = codec(message.message_type)
        for match_id in (7, 8):
            data = layout.encode({**layout.decode(message.data), "match_id": match_id})
            counter.feed(message.topic, message.message_type, data)
    others = sum(message.message_type in kinds for message in recorded)
    alone = counted(recorded).report()
    assert counter.report() == f"{alone}; {others} messages are of another match"


def test_a_lost_request_is_named_by_its_player(recorded: list[Recorded]) -> None:
    lost = nth(recorded, "/taker_1/action_request", 10)
    counter = counted([m for m in recorded if m is not lost])
    assert counter.unanswered_decisions() == {0: 0, 1: 0, 2: 0, 3: 1, 4: 0}
    assert "player 3 left 1 decisions open" in counter.report()


def test_a_request_may_come_before_the_perception_it_answers(recorded: list[Recorded]) -> None:
    requests = [m for m in recorded if m.message_type == ACTION_REQUEST]
    rest = [m for m in recorded if m.message_type != ACTION_REQUEST]
    late = [m for pair in zip(requests, rest, strict=False) for m in pair]
    late += requests[len(rest) :] + rest[len(requests) :]
    assert set(counted(late).unanswered_decisions().values()) == {0}


def test_players_that_never_answer_do_not_fill_the_memory(recorded: list[Recorded]) -> None:
    perceptions = [m for m in recorded if m.message_type == PERCEPTION]
    counter = counted(perceptions)
    due = sum(1 for m in perceptions if m.data[25] and m.data[12] == 0)
    assert counter.unanswered_decisions()[0] in (due, due - 1)


def test_a_match_that_was_on_is_counted_from_when_every_topic_was_heard(
    recorded: list[Recorded],
) -> None:
    """A recorder finds one topic after the other; only what it then misses is a loss."""
    begin = {"/keeper_2/perception": 900_000_000, "/field_state": 500_000_000}
    late = [m for m in recorded if m.log_time >= begin.get(m.topic, 700_000_000)]
    counter = counted(late)
    assert counter.start() == 900_000_000
    assert set(counter.missing().values()) == {0}
    assert counter.report().startswith("joined at 0.9 s, since then ")
    lost = nth(late, "/keeper_2/perception", 3)
    counter = counted([m for m in late if m is not lost])
    assert "/keeper_2/perception misses 1 cycles" in counter.report()


def test_hearing_nothing_is_not_called_complete() -> None:
    assert GapCounter().report() == "no perception and no state was recorded"


def test_selected_episodes_are_no_gaps(recorded: list[Recorded]) -> None:
    ends = [m.log_time for m in recorded if m.topic == "/episode"]
    kept = [m for m in recorded if not ends[0] < m.log_time <= ends[1]]
    selected = GapCounter(selected=True)
    for message in kept:
        selected.feed(message.topic, message.message_type, message.data)
    assert set(selected.missing().values()) == {0}
    assert set(counted(kept).missing().values()) != {0}
