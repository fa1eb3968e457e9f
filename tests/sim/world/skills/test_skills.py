"""What players do to hold, pass, get open, mark, search and go to the ball, on small scenes.

Source: P BasicPlayer.cc and KeepawayPlayer.cc. A command is (kind, power, degrees).
"""

import math

import numpy as np
import pytest
from scenes import Scene

from keepaway_sim.task import Action
from keepaway_sim.world.skills import kicking, running, tactics
from keepaway_sim.world.state import DASH, KICK, TURN

approx = pytest.approx

HOLD, PASS, OPEN, GO, MARK = Action
REACH = 0.385 + 0.7 * 0.7  # [m] where a keeper holds the ball: 0.875


def polar(distance, degrees):
    return [distance * math.cos(math.radians(degrees)), distance * math.sin(math.radians(degrees))]


# --- hold ---


def beset(taker_x, taker_faces):
    """Keeper 1 at (3, 0) with the ball at its left, and a taker on its line."""
    scene = Scene("a . . 1 . . . o")
    scene.put("o", 3.0, 0.8)
    scene.put("a", taker_x, 0.0)
    scene.face("a", taker_faces)
    return scene


@pytest.mark.parametrize(
    ("taker_x", "taker_faces", "side"),
    [
        (-2.5, 0.0, 0.0),  # farther from the ball than 5 m: straight ahead
        (0.0, -10.0, 45.0),  # a taker that heads right is answered on the left
        (0.0, 10.0, -45.0),
        (6.0, 170.0, -135.0),  # it comes from before: the ball goes behind
        (6.0, -170.0, 135.0),
    ],
)
def test_the_ball_is_held_away_from_the_nearest_opponent(taker_x, taker_faces, side):
    scene = beset(taker_x, taker_faces)
    command = scene.command("1", HOLD)
    assert command[0] == KICK
    assert scene.ball_after("1", command) - (3.0, 0.0) == approx(polar(REACH, side))


def test_a_ball_that_lies_well_lets_the_keeper_turn_to_its_direction_of_play():
    scene = Scene("1 o")
    scene.put("o", REACH, 0.0)
    scene.face("1", 30.0)
    assert scene.command("1", HOLD) == approx((TURN, 0.0, -30.0))


@pytest.mark.parametrize(("name", "goal_x"), [("1", 52.5), ("a", -52.5)])
def test_who_holds_the_ball_turns_to_the_goal_of_a_whole_pitch(name, goal_x):
    # P holdBall: getPosOpponentGoal, whatever the field; S: a pitch is 105 m long
    scene = Scene("2 . 1 o")
    scene.lose("2")
    scene.put(name, 2.0, 10.0)
    reach = REACH if name == "1" else 0.385 + 0.3 * 0.7
    scene.put("o", 2.0 + reach, 10.0)
    action = HOLD if name == "1" else GO
    kind, _, moment = scene.command(name, action)
    assert kind == TURN
    assert moment == approx(math.degrees(math.atan2(-10.0, goal_x - 2.0)))


def test_a_ball_that_would_leave_is_brought_back():
    scene = Scene("1 o")
    scene.put("o", REACH, 0.0)
    scene.move("o", 0.3, 0.0)
    command = scene.command("1", HOLD)
    assert scene.ball_after("1", command) == approx([REACH, 0.0])


def test_a_ball_too_fast_to_be_placed_is_stopped():
    # it lies at the right and rolls away: 2.74 m/cycle^2 would be needed, 2.16 are there
    scene = Scene("1 o")
    scene.put("o", 0.0, -0.6)
    scene.move("o", 0.0, -2.0)
    kind, power, angle = scene.command("1", HOLD)
    rate = 0.027 * (1 - 0.25 * 0.5 - 0.25 * 0.215 / 0.7)
    assert (kind, power, angle) == approx((KICK, 2.0 / rate, 90.0))
    assert scene.ball_after("1", (kind, power, angle)) == approx([0.0, -0.6], abs=1e-9)


def test_whoever_cannot_kick_goes_to_the_ball_instead():
    scene = Scene("1 . . . . . . . o")
    assert scene.command("1", HOLD) == approx((DASH, 100.0, 0.0))
    assert scene.command("1", PASS, "2") == approx((DASH, 100.0, 0.0))


# --- pass ---


@pytest.mark.parametrize(
    ("distance", "cycles"),
    [
        (10.0, 7),  # ln(1 + 10 / 1.2 * 0.06383) / ln(1 / 0.94) = 6.89
        (20.0, 12),  # 11.71
        (5.0, 4),  # 3.82
    ],
)
def test_a_pass_arrives_at_its_end_speed(distance, cycles):
    c = Scene("1 2").c
    assert kicking.pass_speed(c, distance, 1.2) == approx(1.2 / 0.94**cycles)


def test_a_pass_is_kicked_at_once_where_power_suffices():
    scene = Scene("1 . . . . . . 2 o")
    scene.put("o", 0.4, 0.0)
    scene.put("2", 0.4 + 6.0, 8.0)  # 10 m away
    scene.face("1", 20.0)
    command = scene.command("1", PASS, "2")
    start = 1.2 / 0.94**7
    assert command[0] == KICK
    assert scene.ball_after("1", command) == approx([0.4 + 0.6 * start, 0.8 * start])


def test_a_pass_takes_the_balls_own_movement_into_account():
    scene = Scene("1 . . . . . . 2 o")
    scene.put("o", 0.4, 0.0)
    scene.move("o", 0.2, -0.3)
    scene.put("2", 10.4, 0.0)
    command = scene.command("1", PASS, "2")
    assert scene.ball_after("1", command) == approx([0.4 + 1.2 / 0.94**7, 0.0], abs=1e-9)


def pass_from_the_side(taker_away):
    """Ball at the left of keeper 1, receiver 14 m ahead of it: 2.094 of 1.963 m/cycle needed."""
    scene = Scene("1 2 o a")
    scene.put("o", 0.0, 0.8)
    scene.put("2", 14.0, 0.8)
    scene.put("a", 0.0, 0.8 + taker_away)
    return scene, scene.command("1", PASS, "2")


def test_a_pass_that_lacks_power_is_set_up_first():
    scene, command = pass_from_the_side(taker_away=2.1)
    assert scene.ball_after("1", command) == approx([0.385 + 0.16 * 0.7, 0.0])


def test_a_pressed_keeper_kicks_with_what_power_there_is():
    scene, (kind, power, angle) = pass_from_the_side(taker_away=1.9)
    rate = 0.027 * (1 - 0.25 * 0.5 - 0.25 * 0.415 / 0.7)
    assert (kind, power, angle) == approx((KICK, 100.0, 0.0))
    assert scene.ball_after("1", (kind, power, angle)) == approx([100 * rate, 0.8])


def test_keepers_are_ranked_by_distance_from_the_passer():
    scene = Scene(
        """
        2 . . . . . 4
        . 1 . . . . .
        . . . . . . .
        . . . 3 . o .
        """
    )
    ranks = [int(tactics.rank_of(scene.w, 0, 0, keeper)) for keeper in (1, 2, 3)]
    assert ranks == [0, 1, 2]
    assert [int(tactics.keeper_of_rank(scene.w, 0, 0, r)) for r in range(3)] == [1, 2, 3]


# --- get open ---

CORNER = -8.75  # [m] half of 70 % of 25 m: the outer points where a keeper may get open


def open_scene():
    """Keeper 2 with the ball in the lower left of a field whose centre is (0, 0), 1 there."""
    scene = Scene("1 2 o")
    scene.put("1", 0.0, 0.0)
    scene.put("2", CORNER, CORNER)
    scene.put("o", CORNER, CORNER)
    scene.predict_meetings("1")
    return scene


def test_a_keeper_gets_open_where_it_is_least_crowded():
    scene = open_scene()
    assert scene.command("1", OPEN) == approx((TURN, 0.0, 45.0))  # the far corner
    scene.face("1", 40.0)
    assert scene.command("1", OPEN) == approx((DASH, 100.0, 0.0))  # 5 degrees off will do


def test_a_lane_with_a_taker_in_it_is_no_good():
    scene = open_scene()
    scene.belief.age[0, 0, scene.index("a")] = 0
    scene.put("a", 4.0, 4.5)  # beside the diagonal: (8.75, -8.75) is 14.1 m, its mirror 13.4 m off
    assert scene.command("1", OPEN) == approx((TURN, 0.0, -45.0))


def test_a_keeper_that_is_open_turns_to_the_ball():
    scene = open_scene()
    scene.put("1", 8.0, 8.0)
    assert scene.command("1", OPEN) == approx((TURN, 0.0, -135.0))


def test_a_keeper_whose_lanes_are_all_blocked_goes_to_the_centre():
    names = "abcdefghijk"  # eleven cones of 33.4 degrees
    scene = Scene("1 2 o " + " ".join(names))
    scene.put("2", 1.0, 1.0)
    scene.put("o", 1.0, 1.0)
    for number, name in enumerate(names):
        x, y = polar(0.5, number * 360 / 11)
        scene.put(name, 1.0 + x, 1.0 + y)
    scene.put("1", 5.0, 0.0)
    scene.predict_meetings("1")
    assert scene.command("1", OPEN) == approx((TURN, 0.0, 180.0))


def test_the_pass_is_expected_from_where_the_ball_is_met():
    scene = Scene("1 2 . . . . . o")
    scene.face("2", 0.0)
    scene.move("o", -0.5, 0.0)
    scene.predict_meetings("1")
    soonest = int(scene.belief.cycles_to_ball[0, 0].min())
    assert soonest > 1
    rolled = 0.5 * (1 - 0.94**soonest) / 0.06
    assert tactics.pass_origin(scene.w, 0, 0) == approx((7.0 - rolled, 0.0))


def test_a_player_too_fast_to_turn_stops_first():
    # the way back needs three cycles of turning at 0.4 m/cycle: 60, 100 and 20 degrees
    scene = open_scene()
    scene.face("1", -135.0)
    scene.move("1", *polar(0.4, -135.0))
    assert scene.command("1", OPEN) == approx((DASH, -0.4 / 0.006, 0.0))


# --- go to the ball ---


def test_a_player_runs_to_a_ball_ahead_and_turns_to_one_behind():
    scene = Scene("o . . . . . . . 1 . . . . . . . .")
    assert scene.command("1", GO) == approx((TURN, 0.0, 180.0))
    scene.put("o", 16.0, 0.0)
    assert scene.command("1", GO) == approx((DASH, 100.0, 0.0))


def test_a_player_runs_to_where_the_ball_will_be():
    scene = Scene(
        """
        . . . . . . . . o
        . . . . . . . . .
        . . . . . . . . .
        1 . . . . . . . .
        """
    )
    scene.move("o", 0.0, -1.0)
    kind, _, angle = scene.command("1", GO)
    x, y = scene.memory.intercept_point[0, 0]
    assert x == approx(8.0)
    assert y < -2.0
    if kind == TURN:
        assert angle == approx(math.degrees(math.atan2(y, x)))


@pytest.mark.parametrize(
    ("taker_x", "command"),
    [(4.0, (TURN, 0.0, -90.0)), (2.5, (DASH, 0.0, 0.0))],  # farther than 3 m, or nearer
)
def test_while_a_ball_comes_a_player_faces_its_direction_of_play_unless_pressed(taker_x, command):
    scene = Scene("1 o a")
    scene.put("o", 1.6, 0.0)
    scene.move("o", -1.0, 0.0)  # within reach a cycle later, by itself
    scene.put("a", taker_x, 0.0)
    scene.face("1", 90.0)
    assert scene.command("1", GO) == approx(command)


def test_a_dash_brings_a_near_ball_into_reach():
    scene = Scene("1 o")
    scene.put("o", 1.5, 0.0)
    assert scene.command("1", GO) == approx((DASH, 100.0, 0.0))


def test_whoever_dashes_backward_in_vain_turns_in_the_end():
    scene = Scene("o . 1")  # the server of v19 takes a dash with negative power for none
    commands = [scene.command("1", GO) for _ in range(scene.c.patience + 1)]
    assert commands[:-1] == [(DASH, -100.0, 0.0)] * scene.c.patience
    assert abs(commands[-1][2]) == approx(180.0)
    assert scene.command("1", GO)[0] == TURN
    scene.face("1", 180.0)
    assert scene.command("1", GO) == approx((DASH, 100.0, 0.0))


def test_a_taker_with_the_ball_holds_it_close():
    scene = Scene("a o 1")
    scene.put("o", 0.0, 0.8)
    scene.put("1", 9.0, 0.0)
    command = scene.command("a", GO)
    assert scene.ball_after("a", command) == approx([0.385 + 0.3 * 0.7, 0.0])


def test_a_taker_leaves_the_ball_to_a_team_mate_that_has_it():
    scene = Scene(
        """
        . . . . o .
        . . . . b .
        . . . . . .
        a . . . . .
        """
    )
    scene.put("o", 4.0, 2.5)
    command = scene.command("a", GO)
    assert command == approx((TURN, 0.0, math.degrees(math.atan2(2.5, 4.0))))


def test_a_keeper_does_not_leave_it():
    scene = Scene("1 . . . . . 2 o")
    scene.put("o", 6.5, 0.0)
    assert scene.command("1", GO) == approx((DASH, 100.0, 0.0))


# --- mark ---


def marking(x, y):
    """Taker a at (x, y), ball at (0, 0), keeper 2 at (10, 0): the place to stand is (7, 0)."""
    scene = Scene("o . . . . . . . . . 2")
    scene.belief.age[0, :, scene.index("a")] = 0
    scene.put("a", x, y)
    return scene


def test_a_marker_runs_to_the_line_from_keeper_to_ball():
    scene = marking(7.0, 6.0)
    assert scene.command("a", MARK, "2") == approx((TURN, 0.0, -90.0))
    scene.face("a", -80.0)  # 10 degrees off will do: markers turn when 25 off
    kind, power, _ = scene.command("a", MARK, "2")
    assert (kind, power) == (DASH, approx(100.0))


def test_a_marker_in_place_stands_sideways():
    # keeper at -18.4 degrees, ball on its right: 80 degrees further right
    scene = marking(7.0, 1.0)
    facing = math.degrees(math.atan2(-1, 3)) - 80.0
    assert scene.command("a", MARK, "2") == approx((TURN, 0.0, facing))


# --- search ---


def test_a_player_who_lost_the_ball_turns_on_and_on():
    scene = Scene("1 . . . o")
    scene.put("o", 5.0, -3.0)
    scene.belief.cycle[0] = 40
    scene.lose("o", 10)
    assert scene.command("1", GO) == approx((TURN, 0.0, math.degrees(math.atan2(-3, 5))))
    scene.lose("o", 11)
    for cycle in (40, 41, 44):  # first toward where it was, then the same way round
        scene.belief.cycle[0] = cycle
        assert scene.command("1", OPEN) == approx((TURN, 0.0, -60.0))
        scene.put("o", 5.0, 3.0)
    scene.belief.cycle[0] = 48  # a new search
    assert scene.command("1", HOLD) == approx((TURN, 0.0, 60.0))


# --- commands ---


def test_commands_are_cut_to_whole_numbers():
    scene = Scene("1 2 o")
    scene.change(whole_commands=True)
    scene.put("1", 0.0, 0.0)
    scene.put("2", CORNER, CORNER)
    scene.put("o", CORNER, CORNER + 0.4)
    scene.predict_meetings("1")
    scene.face("1", 14.4)
    assert scene.command("1", OPEN) == approx((TURN, 0.0, 30.0))  # of 30.6
    scene.face("1", 75.6)
    assert scene.command("1", OPEN) == approx((TURN, 0.0, -30.0))


@pytest.mark.parametrize(("name", "direction"), [("1", 0.0), ("a", 180.0)])
def test_keepers_play_to_the_right_and_takers_to_the_left(name, direction):
    scene = Scene("1 a")
    assert math.degrees(running.direction_of_play(scene.c, scene.index(name))) == direction


def test_a_neck_is_turned_only_where_the_view_is_limited():
    scene = open_scene()
    scene.command("1", OPEN)
    assert scene.belief.neck[0, 0] == 0.0
    scene.change(visible_angle=math.pi / 2)
    scene.put("1", 4.0, 4.0)
    kind, _, _ = scene.command("1", OPEN)
    assert kind == TURN  # by 45 degrees, away from the centre: the neck goes as far as it can
    assert abs(math.degrees(scene.belief.neck[0, 0])) == approx(90.0)
    scene.command("1", GO)  # looks at the ball, also at (-, -)
    assert np.isfinite(scene.belief.neck[0, 0])


def narrow(drawing: str) -> Scene:
    scene = Scene(drawing)
    scene.change(visible_angle=math.pi / 2)
    return scene


def test_a_player_looks_at_where_the_ball_will_be_from_where_it_will_be():
    scene = narrow("1 . . . . . . . o")
    scene.put("o", 8.0, 0.8)
    scene.move("o", 0.3, 0.0)
    kind, power, _ = scene.command("1", GO)
    assert (kind, power) == (DASH, 100.0)
    seen_from = 0.6  # after a dash
    assert scene.belief.neck[0, 0] == approx(math.atan2(0.8, 8.3 - seen_from))


def test_who_has_the_ball_leaves_its_neck_as_it_is():
    scene = narrow("a o 1")
    scene.put("o", 0.0, 0.8)
    scene.put("1", 0.9, 0.8)
    scene.belief.neck[0] = 0.5
    scene.command("a", GO)
    scene.command("1", HOLD)
    assert scene.belief.neck[0, [0, scene.index("a")]] == approx([0.5, 0.5])


def test_a_taker_that_leaves_the_ball_to_another_looks_ahead():
    scene = narrow("a . . . b o")
    scene.put("o", 4.5, 0.0)
    scene.belief.neck[0] = 0.5
    scene.command("a", GO)
    assert scene.belief.neck[0, scene.index("a")] == 0.0
