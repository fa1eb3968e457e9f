"""Kick-off places, possession and ends of episodes (S: referee.cpp, class KeepawayRef)."""

import itertools

import numpy as np
import pytest
from scenes import draws, make_record

from keepaway_sim.task import Outcome, Task
from keepaway_sim.world import referee
from keepaway_sim.world.config import profile
from keepaway_sim.world.constants import pack

approx = pytest.approx


def kicked_off(task, uniforms):
    """Positions and velocities after a kick-off with these random numbers."""
    w = make_record(task, profile("2005"))
    w = w._replace(random=draws(*uniforms))
    w.truth.position[:], w.truth.velocity[:] = 77.0, 1.0
    referee.kick_off(w, 0)
    assert w.random.cursor[0] == 1 + 2 * task.num_players
    return w.truth.position[0], w.truth.velocity[0]


def test_without_jitter_players_stand_in_corners():
    position, velocity = kicked_off(Task(3, 2), np.zeros(11))
    corners = [(-12.5, -12.5), (12.5, -12.5), (12.5, 12.5)]  # slots 0, 1, 2
    takers = [(-12.5, 12.5)] * 2
    assert position == approx(np.array([*corners, *takers, (-8.5, -8.5)]))
    assert not velocity.any()


def test_jitter_is_three_metres_inward():
    position, _ = kicked_off(Task(3, 2, 30.0, 20.0), [0.0, *[0.5] * 10])
    corners = [(-13.5, -8.5), (13.5, -8.5), (13.5, 8.5)]
    assert position == approx(np.array([*corners, *[(-13.5, 8.5)] * 2, (-11.0, -6.0)]))


@pytest.mark.parametrize(("u", "offset"), [(0.0, 0), (0.3, 1), (0.6, 2), (0.99, 3)])
def test_a_cyclic_offset_decides_who_stands_where(u, offset):
    position, _ = kicked_off(Task(4, 1), [u, *[0.5] * 10])
    slots = [(-11, -11), (11, -11), (11, 11), (0, 0)]  # the fourth is near the centre
    expected = [slots[(k + offset) % 4] for k in range(4)]
    assert position[:4] == approx(np.array(expected, dtype=float))


def test_places_stay_within_their_jitter():
    random = np.random.default_rng(1)
    task = Task(5, 4)
    places = np.stack([kicked_off(task, [0.0, *random.random(18)])[0] for _ in range(400)])
    low, high = places.min(axis=0), places.max(axis=0)
    assert low[0] == approx([-12.5, -12.5], abs=0.05)
    assert high[0] == approx([-9.5, -9.5], abs=0.05)
    assert low[4] == approx([-1.0, -1.0], abs=0.05)
    assert high[4] == approx([1.0, 1.0], abs=0.05)
    assert low[8] == approx([-12.5, 9.5], abs=0.05)
    assert high[8] == approx([-9.5, 12.5], abs=0.05)


@pytest.mark.parametrize(
    ("cycles", "ended"),
    [
        ("TTTT-", 5),  # in the cycle after the fourth, as in games recorded on the server
        ("TTTTK", 5),  # whoever is near then
        ("BBBBB", 5),  # a taker near counts, also with a keeper near
        ("TBTBT", 5),
        ("T-T--TT-", 8),  # nobody near: the count stays
        ("TTTKTTT-", None),  # a cycle with keepers only clears it
        ("TTTKTTTTK", 9),
        ("KKKKKK", None),
        ("------", None),
    ],
)
def test_the_take_counter(cycles, ended):
    c = pack(Task(), profile("2005"))
    position, count = np.zeros((6, 2)), 0
    ends = None
    for cycle, who in enumerate(cycles, start=1):
        if referee.outcome(c, position, count) == Outcome.TAKEN_AWAY:
            ends = cycle
            break
        count = referee.next_take_count(count, who in "KB", who in "TB")
    assert ends == ended


@pytest.mark.parametrize(
    ("ball", "takes", "expected"),
    [
        ((12.49, -12.49), 3, Outcome.IN_PLAY),
        ((12.5, 0.0), 0, Outcome.OUT_OF_BOUNDS),  # on the line is out
        ((0.0, -12.5), 0, Outcome.OUT_OF_BOUNDS),
        ((0.0, 13.0), 4, Outcome.OUT_OF_BOUNDS),  # out of bounds comes first
        ((0.0, 0.0), 4, Outcome.TAKEN_AWAY),
    ],
)
def test_ends_of_episodes(ball, takes, expected):
    c = pack(Task(), profile("2005"))
    position = np.zeros((6, 2))
    position[5] = ball
    assert referee.outcome(c, position, takes) == expected


def test_near_the_ball_is_within_kicking_distance():
    c = pack(Task(), profile("2005"))
    for distance, player in itertools.product((1.08, 1.09), range(5)):
        position = np.full((6, 2), 9.0)
        position[player], position[5] = (0.0, 0.0), (distance, 0.0)
        found = referee.near_ball(c, position, 0, 5)
        assert found == (player if distance < 1.085 else -1)
        assert referee.near_ball(c, position, player + 1, 5) == -1


def test_of_several_near_the_ball_the_nearest_counts():
    c = pack(Task(), profile("2005"))
    position = np.array([(1.0, 0), (0.5, 0), (0.7, 0), (0.1, 0), (9, 9), (0, 0)], dtype=float)
    assert referee.near_ball(c, position, 0, 3) == 1
    assert referee.near_ball(c, position, 3, 5) == 3
