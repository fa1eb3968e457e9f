"""Whose answers are in: players that are late, lie, vanish and come back."""

import contextlib
import math

import numpy as np
import pytest

from keepaway_sim.errors import KeepawayError
from keepaway_sim.match.roster import MOST_OPEN, Roster, checked_request
from keepaway_sim.task import Action, Outcome, Task
from keepaway_sim.wire.messages import Request, action_request
from keepaway_sim.world.config import Config
from keepaway_sim.world.world import World

TIMEOUT = 2.0  # [s]
KEEPER, MATE, TAKER = 0, 1, 3


def answer(player, episode=0, cycle=0, action=Action.GO_TO_BALL, target=0, values=(), match_id=0):
    return action_request(Request(player, episode, cycle, action, target, match_id), values)


@pytest.fixture
def world():
    made = World(Task.parse("3v2"), Config())
    made.start(0, np.random.SeedSequence(1))
    return made


@pytest.fixture
def roster(world):
    """Everybody is there, and the first perceptions have been sent at time 0."""
    made = Roster(world.task, world.config)
    for player in range(world.task.num_players):
        made.take_seat(player)
    made.begin(world, now=0.0)
    return made


def next_cycle(world, roster, now):
    world.step(*roster.requests())
    return roster.begin(world, now)


def new_episode(world, roster, now):
    world.abort(0)
    roster.begin(world, now)
    world.step(*roster.requests())
    return roster.begin(world, now)


def test_nobody_is_there_before_saying_so(world):
    roster = Roster(world.task, world.config)
    assert roster.absent == ["keeper_1", "keeper_2", "keeper_3", "taker_1", "taker_2"]
    roster.take_seat(TAKER)
    assert roster.absent == ["keeper_1", "keeper_2", "keeper_3", "taker_2"]


def test_answers_are_awaited_and_played(world, roster):
    assert roster.num_awaited == 5
    roster.take(KEEPER, answer(KEEPER, action=Action.PASS_BALL, target=MATE))
    assert roster.num_awaited == 4
    assert roster.unanswered() == [1, 2, 3, 4]
    action, target = roster.requests()
    assert (action[0, KEEPER], target[0, KEEPER]) == (Action.PASS_BALL, MATE)


def test_an_answer_that_comes_twice_counts_once_and_the_first_one_counts(roster):
    roster.take(KEEPER, answer(KEEPER, action=Action.GET_OPEN))
    roster.take(KEEPER, answer(KEEPER, action=Action.HOLD_BALL))
    assert roster.num_awaited == 4
    assert roster.requests()[0][0, KEEPER] == Action.GET_OPEN


def test_without_answers_keepers_get_open_and_takers_go_to_the_ball(world, roster):
    action, _ = roster.requests()
    assert action.tolist() == [[Action.GET_OPEN] * 3 + [Action.GO_TO_BALL] * 2]
    world.belief.ball_kickable[0, KEEPER] = True
    roster.begin(world, now=0.0)
    assert roster.requests()[0][0, KEEPER] == Action.HOLD_BALL
    assert [seat.missed for seat in roster.seats] == [2, 2, 2, 2, 2]


def test_who_does_not_answer_is_dismissed_and_not_waited_for(world, roster):
    for player in (0, 1, 2, 3):
        roster.take(player, answer(player))
    assert roster.time_out(TIMEOUT - 0.1, TIMEOUT) == []
    assert roster.time_out(TIMEOUT, TIMEOUT) == ["taker_2"]
    assert (roster.num_awaited, roster.absent) == (0, ["taker_2"])
    next_cycle(world, roster, now=3.0)
    assert roster.num_awaited == 4


@pytest.mark.parametrize("by", ["status", "answer"])
def test_who_is_back_joins_at_the_next_kick_off(world, roster, by):
    roster.time_out(TIMEOUT, TIMEOUT)
    assert roster.is_deserted
    if by == "status":
        roster.take_seat(TAKER)
    else:
        roster.take(TAKER, answer(TAKER))
    assert not roster.is_deserted
    assert next_cycle(world, roster, now=3.0) == []
    assert roster.num_awaited == 0
    assert new_episode(world, roster, now=4.0) == ["taker_1"]
    assert roster.unanswered() == [TAKER]


def test_a_late_answer_holds_until_a_better_one_comes(world, roster):
    next_cycle(world, roster, now=0.1)
    roster.take(KEEPER, answer(KEEPER, cycle=0, action=Action.GO_TO_BALL))
    assert roster.seats[KEEPER].late == 1
    assert roster.num_awaited == 5
    assert roster.requests()[0][0, KEEPER] == Action.GO_TO_BALL
    roster.take(KEEPER, answer(KEEPER, cycle=1, action=Action.GET_OPEN))
    assert roster.requests()[0][0, KEEPER] == Action.GET_OPEN


def test_who_is_always_late_is_not_missing(world, roster):
    seen = world.belief
    for cycle in range(1, 50):
        before = int(seen.episode[0]), int(seen.cycle[0])
        next_cycle(world, roster, now=0.1 * cycle)
        roster.take(KEEPER, answer(KEEPER, *before))
        assert "keeper_1" not in roster.time_out(0.1 * cycle + 0.09, TIMEOUT)
    seat = roster.seats[KEEPER]
    assert seat.late == seat.missed == 48  # at the episode's end no answer was due


def test_an_answer_that_comes_twice_is_no_late_one(world, roster):
    """A perception that was sent again is answered again."""
    roster.take(KEEPER, answer(KEEPER))
    next_cycle(world, roster, now=0.1)
    roster.take(KEEPER, answer(KEEPER, cycle=0))
    seat = roster.seats[KEEPER]
    assert (seat.late, seat.missed, seat.rejected) == (0, 0, 0)


def test_of_answers_that_never_come_only_the_last_are_kept(world, roster):
    for cycle in range(1, MOST_OPEN + 300):
        next_cycle(world, roster, now=0.1 * cycle)
    seat = roster.seats[KEEPER]
    assert seat.missed > len(seat.open) == MOST_OPEN


def test_requests_of_an_earlier_episode_are_not_played(world, roster):
    roster.take(KEEPER, answer(KEEPER, action=Action.GO_TO_BALL))
    new_episode(world, roster, now=0.1)
    roster.take(KEEPER, answer(KEEPER, episode=0, cycle=0))
    assert roster.requests()[0][0, KEEPER] == Action.GET_OPEN


def test_the_end_of_an_episode_needs_no_answer(world, roster):
    world.abort(0)
    assert world.belief.outcome[0] == Outcome.ABORTED
    roster.begin(world, now=0.1)
    assert roster.num_awaited == 0


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "no ActionRequest"),
        (b"\0\1\0\0" + b"\0" * 10, "no ActionRequest"),
        (b"\0\0" + answer(KEEPER)[2:], "no ActionRequest"),
        (answer(KEEPER) + b"\0" * 4, "ActionRequest of 40 bytes"),
        (answer(KEEPER, values=[1.0])[:-1], "ActionRequest of 43 bytes"),
        (answer(KEEPER, values=[1.0] * 65), "65 action values"),
        (answer(KEEPER, values=[math.nan]), "not finite"),
        (answer(KEEPER, values=[1.0, math.inf]), "not finite"),
        (answer(KEEPER, match_id=9), "match 9, which is another one"),
        (answer(MATE), "in the name of player 1"),
        (answer(KEEPER, cycle=1), "yet to come"),
        (answer(KEEPER, episode=1), "yet to come"),
        (answer(KEEPER, action=5), "action=5"),
        (answer(KEEPER, action=255), "action=255"),
        (answer(KEEPER, action=Action.MARK_KEEPER), "action=4"),
        (answer(KEEPER, action=Action.PASS_BALL, target=KEEPER), "target=0"),
        (answer(KEEPER, action=Action.PASS_BALL, target=TAKER), "target=3"),
        (answer(KEEPER, action=Action.PASS_BALL, target=200), "target=200"),
    ],
)
def test_what_no_player_may_send_is_counted_and_moves_nobody(roster, data, why):
    with pytest.raises(KeepawayError, match=why):
        roster.take(KEEPER, data)
    assert roster.seats[KEEPER].rejected == 1
    assert roster.num_awaited == 5
    assert roster.requests()[0][0, KEEPER] == Action.GET_OPEN


@pytest.mark.parametrize("values", [(), (0.5, 1.5)])
def test_answers_of_agents_from_before_matches_had_numbers_count(roster, values):
    whole = answer(KEEPER, values=values)
    roster.take(KEEPER, whole[: 28 + 8 * len(values)] if values else whole[:24])
    assert roster.num_awaited == 4


def test_a_seat_is_its_holders_until_that_is_missing(world, roster):
    roster.seats[KEEPER].holder = b"first"
    request = answer(KEEPER, action=Action.PASS_BALL, target=MATE)
    for claim in (
        lambda: roster.take(KEEPER, request, b"second"),
        lambda: roster.take_seat(KEEPER, b"second"),
    ):
        with pytest.raises(KeepawayError, match="another process plays keeper_1"):
            claim()
    assert (roster.num_awaited, roster.seats[KEEPER].rejected) == (5, 1)
    roster.time_out(TIMEOUT, TIMEOUT)
    roster.take(KEEPER, request, b"second")
    with pytest.raises(KeepawayError, match="another process plays keeper_1"):
        roster.take(KEEPER, request, b"first")
    next_cycle(world, roster, now=3.0)
    assert new_episode(world, roster, now=3.0) == ["keeper_1"]
    assert roster.seats[KEEPER].holder == b"second"


def test_a_target_that_does_not_matter_may_be_anything(roster):
    roster.take(KEEPER, answer(KEEPER, action=Action.GO_TO_BALL, target=255))
    assert roster.num_awaited == 4


def test_any_bytes_are_a_request_or_refused():
    random = np.random.default_rng(0)
    for size in range(200):
        data = b"\0\1\0\0" + random.bytes(size)
        with contextlib.suppress(KeepawayError):
            assert checked_request(data).action < 256


def test_everything_that_passes_the_check_the_world_can_carry_out(world, roster):
    for player, action, target in roster._legal:
        roster.begin(world, now=0.0)
        roster.take(player, answer(player, action=action, target=target))
        trial = World(world.task, world.config)
        trial.start(0, np.random.SeedSequence(1))
        trial.step(*roster.requests())
