"""Who reaches the ball when: hand-worked numbers, and skipping cycles changes nothing.

Source: P WorldModelPredict.cc.
"""

import math

import numpy as np
import pytest

from keepaway_sim.task import Task
from keepaway_sim.world.config import NEVER, profile
from keepaway_sim.world.constants import pack
from keepaway_sim.world.skills import prediction
from keepaway_sim.world.skills.prediction import Ball, Body

approx = pytest.approx

C = pack(Task(), profile("2005"))
AT_REST = Body(0.0, 0.0, 0.0, 0.0, 1.0, 0.0)  # at (0, 0), faces +x
LIMIT = 2 * C.intercept_horizon - 1  # [cycles]


@pytest.mark.parametrize(
    ("along", "speed", "cycles", "power"),
    [
        (0.6, 0.0, 1, 100.0),
        (0.3, 0.0, 1, 50.0),
        (0.6, 0.3, 1, 50.0),  # rolls 0.3 by itself
        (0.84, 0.0, 2, 100.0),  # 0.6 + 0.24 rolling: one dash and a roll
        (9.0, 0.0, 1, 100.0),
        (-0.3, 0.0, 1, -50.0),
        (0.0, 0.6, 1, -100.0),  # brake
    ],
)
def test_power_of_the_dash_that_covers_a_way(along, speed, cycles, power):
    assert prediction.dash_power(C, along, speed, cycles) == approx(power)


@pytest.mark.parametrize(
    ("degrees", "speed", "moment"), [(30, 1.0, 180), (30, 0.0, 30), (90, 1.0, 180), (-10, 0.4, -30)]
)
def test_moment_that_turns_a_moving_player(degrees, speed, moment):
    sent = prediction.turn_moment(C, math.radians(degrees), speed)
    assert math.degrees(sent) == approx(moment)


def heading(to, velocity=(0.0, 0.0), cycles=1):
    """(turns, direction after it [deg]) of a player at (0, 0) that faces +x."""
    body = Body(0.0, 0.0, velocity[0], velocity[1], 1.0, 0.0)
    turns, ux, uy = prediction.heading_to_go(C, body, float(to[0]), float(to[1]), cycles)
    return bool(turns), math.degrees(math.atan2(uy, ux))


def test_a_point_ahead_needs_no_turn():
    assert heading((8, 0.9)) == (False, 0.0)  # less than 0.9 * 1.085 off the line
    assert heading((15, 2.0)) == (False, 0.0)  # farther points may lie further off


def test_a_point_beside_needs_a_turn():
    assert heading((8, 1.1)) == (True, approx(math.degrees(math.atan2(1.1, 8))))
    assert heading((0, 6)) == (True, approx(90.0))


def test_a_running_player_turns_less_a_cycle():
    turns, degrees = heading((0.4 * 1.624, 6.0), velocity=(0.4, 0.0))  # rolls out 0.65 m
    assert turns
    turns, degrees = heading((-9.0, 0.5), velocity=(0.4, 0.0))
    assert (turns, degrees) == (True, approx(60.0))  # 180 / (1 + 5 * 0.4)


def test_near_points_behind_are_reached_backwards():
    assert heading((-2, 0.5)) == (False, 0.0)
    assert heading((-3, 0.0))[0]


@pytest.mark.parametrize(
    ("distance", "speed", "cycles"),
    [
        (1.085, 0.0, 0),
        (1.6, 0.0, 1),  # 0.6 m from rest
        (2.5, 0.0, 2),  # 0.6 + 0.84 = 1.44 m
        (2.6, 0.0, 3),
        (2.0, 0.4, 1),  # 0.4 + 0.6
        (11.4, 0.0, 11),  # 1 m a cycle in the end; 2/3 m are lost at the start
    ],
)
def test_full_dashes_needed_straight_ahead(distance, speed, cycles):
    assert prediction.run_cycles(C, distance, speed) == cycles


@pytest.mark.parametrize(("to_x", "cycles"), [(2.5, 2), (-2.35, 3), (-1.0, 0)])
def test_a_turn_costs_a_resting_player_one_cycle(to_x, cycles):
    # to (-2.35, 0.87): behind, 2.506 m away: a cycle of turning, two to run 1.42 of 1.44 m
    to_y = 0.87 if to_x == -2.35 else 0.0
    assert prediction.cycles_to_point(C, AT_REST, to_x, to_y) == cycles


@pytest.mark.parametrize(("to", "cycles"), [((2.93, 0.0), 2), ((0.0, -2.93), 2), ((-2.96, 0.0), 3)])
def test_a_player_of_unknown_heading_is_believed_to_run_to_the_point(to, cycles):
    # from 0.3 m a cycle: 0.9 and 0.96 m, so 1.86 m and the reach of 1.085 m in two cycles
    body = Body(0.0, 0.0, 0.3, 0.0, 0.0, 0.0)
    assert prediction.cycles_to_point(C, body, *to) == cycles


@pytest.mark.parametrize(("cycles", "left"), [(0, 10.0), (1, 9.4), (2, 8.56), (3, 7.624)])
def test_way_left_after_running_straight(cycles, left):
    assert prediction.reach_after(C, AT_REST, 10.0, 0.0, cycles) == approx(left)


def reach_ball(body, lead, ball, limit=LIMIT):
    start = prediction.straight_run(C, body, lead, ball, limit)
    return prediction.reach_ball(C, body, lead, ball, start, limit)


def to_ball(x, y, ball, ball_v):
    body = Body(float(x), float(y), 0.0, 0.0, 1.0, 0.0)
    rolling = Ball(*(float(value) for value in (*ball, *ball_v)))
    return reach_ball(body, 0, rolling)[1]


def test_a_ball_that_comes_is_reached_sooner():
    assert to_ball(0, 0, (8, 0), (0, 0)) == 8  # 6.915 m at 1 m a cycle and 0.67 m lost
    # after 3 cycles it has rolled 2.82 m toward the player, who has 2.376 + 1.085 m of 5.18
    # after 4, 3.654 m, and 3.35 + 1.085 are enough for the 4.35 that are left
    assert to_ball(0, 0, (8, 0), (-1, 0)) == 4


def test_a_ball_that_leaves_for_good_is_not_reached():
    assert to_ball(0, 0, (30, 0), (2.7, 0)) == NEVER


def test_a_ball_in_reach_takes_no_time():
    assert to_ball(0, 0, (1, 0), (0, 0)) == 0
    assert to_ball(0, 0, (1, 0), (0.5, 0)) == 0


def random_scenes(count):
    """A player and a ball."""
    random = np.random.default_rng(11)
    for _ in range(count):
        x, y, bx, by = random.uniform(-15, 15, 4)
        speed, way, yaw, fast, rolls = random.random(5) * (0.48, 6.28, 6.28, 2.5, 6.28)
        velocity = speed * math.cos(way), speed * math.sin(way)
        body = Body(x, y, *velocity, math.cos(yaw), math.sin(yaw))
        yield body, Ball(bx, by, fast * math.cos(rolls), fast * math.sin(rolls))


@pytest.mark.parametrize("lead", [0, 2])
def test_skipping_cycles_finds_the_first_in_which_the_ball_is_reached(lead):
    for body, ball in random_scenes(2000):
        expected = NEVER, NEVER
        for i in range(2 * C.intercept_horizon):
            to = prediction.ball_ahead(C, ball, i)
            needed = max(prediction.cycles_to_point(C, body, *to) - lead, 0)
            if needed <= i:
                expected = i, needed
                break
        assert reach_ball(body, lead, ball) == expected
        if expected[0] < NEVER:
            assert reach_ball(body, lead, ball, expected[0] - 1)[0] == NEVER


def test_skipping_cycles_finds_the_first_meeting_point():
    for body, ball in random_scenes(2000):
        expected = prediction.BEYOND
        for i in range(C.intercept_horizon + 1):
            to = prediction.ball_ahead(C, ball, i)
            if prediction.reach_after(C, body, *to, i) < C.kickable_distance:
                expected = i
                break
        found = prediction.meeting_cycles(C, body, ball, 0.0, 0.0, False)
        assert found.cycles == expected
        assert found[1:] == approx(prediction.ball_ahead(C, ball, found.cycles))


def test_a_player_sticks_to_the_meeting_point_it_chose():
    ball = Ball(8.0, 3.0, -1.5, 0.0)
    first = prediction.meeting_cycles(C, AT_REST, ball, 0.0, 0.0, False)
    later = prediction.ball_ahead(C, ball, first.cycles + 1)  # that can be reached as well
    kept = prediction.meeting_cycles(C, AT_REST, ball, *later, True)
    assert kept.cycles >= first.cycles
    assert math.dist(kept[1:], later) <= math.dist(first[1:], later) + 1e-9
    far = prediction.meeting_cycles(C, AT_REST, ball, -20.0, 20.0, True)
    assert far == first  # an old point farther off than 1 m is given up
