"""What players see, feel, hear and remember, by hand-worked numbers.

Sources: S visualsenderplayer.cpp (what is seen) and P WorldModelUpdate.cc (what is made of it).
"""

import json
import math
from importlib import resources

import numpy as np
import pytest
from scenes import EXACT, Scene

from keepaway_sim.world import hearing, memory, sight, survey
from keepaway_sim.world.config import NEVER, noiseless, profile
from keepaway_sim.world.state import DASH, KICK, NONE, Command

approx = pytest.approx

NARROW = noiseless(profile("2005", visible_angle_deg=90.0))
ROUNDED = profile("2005", self_position_error=0.0, self_yaw_error=0.0)

WIDE = """
    . . . . . . . . . . a . .
    . . . . . . . . . . . . .
    . . . . . . 1 . . . . o .
    . . . . . . . . . . . . .
    . 2 . . . . . . . . . . .
"""


@pytest.mark.parametrize(
    ("distance", "reported"),
    [
        (10.0, 10.0),  # ln 2.303 -> 2.3 -> 9.97 -> 10.0
        (10.5, 11.0),  # ln 2.351 -> 2.4 -> 11.02 -> 11.0
        (14.0, 13.5),  # ln 2.639 -> 2.6 -> 13.46 -> 13.5
        (20.0, 20.1),  # ln 2.996 -> 3.0 -> 20.09 -> 20.1
        (3.0, 3.0),
        (0.7, 0.7),  # ln -0.357 -> -0.4 -> 0.67 -> 0.7
    ],
)
def test_distances_are_rounded_on_a_logarithmic_scale(distance, reported):
    scene = Scene("1 o", ROUNDED)
    scene.put("o", distance, 0.0)
    scene.look("1")
    assert scene.seen("1", "o") == approx([reported, 0.0])


@pytest.mark.parametrize(
    ("degrees", "faces", "reported"),
    [(30.4, 0.0, 30.0), (30.6, 0.0, 31.0), (30.4, 0.5, 30.5), (-170.2, 10.0, -170.0)],
)
def test_directions_are_rounded_as_seen_from_the_face(degrees, faces, reported):
    scene = Scene("1 o", ROUNDED)
    scene.put("o", 10 * math.cos(math.radians(degrees)), 10 * math.sin(math.radians(degrees)))
    scene.face("1", faces)
    scene.look("1")
    x, y = scene.seen("1", "o")
    assert math.degrees(math.atan2(y, x)) == approx(reported)


@pytest.mark.parametrize(
    ("moving", "expected"),
    [
        ((1.05, 0.0), (1.0, 0.0)),  # 1.05 / 10 is rounded to 0.02 * 5, times 10.0
        ((0.0, 1.0), (0.0, 0.99484)),  # 5.73 degrees a cycle are rounded to 5.7, times 10.0
    ],
)
def test_changes_of_distance_and_direction_are_rounded(moving, expected):
    scene = Scene("1 . 2", ROUNDED)
    scene.put("2", 10.0, 0.0)
    scene.move("2", *moving)
    scene.look("1")
    assert scene.belief.velocity[0, 0, 1] == approx(expected, abs=1e-5)


def test_velocities_are_those_over_ground():
    scene = Scene(WIDE)
    scene.move("1", 0.2, -0.3)
    scene.move("o", -1.0, 0.5)
    scene.move("a", 0.0, 0.4)
    truth = scene.velocity.copy()
    scene.belief.velocity[:] = 0.0
    scene.look("1")
    assert scene.belief.velocity[0, 0, 1:] == approx(truth[1:])  # the own one is felt, not seen


def test_without_noise_a_player_sees_the_truth():
    scene = Scene(WIDE)
    for number, name in enumerate("12a"):
        scene.face(name, 40.0 * number)
    scene.belief.position[0, 0, 1:] = 55.0
    scene.belief.body[0, 0] = 0.0
    scene.belief.age[:] = NEVER
    scene.look("1")
    assert scene.belief.position[0, 0] == approx(scene.position)
    assert scene.belief.body[0, 0] == approx(scene.yaw)
    assert not scene.belief.age[0, 0, 1:].any()


def test_a_narrow_view_is_a_cone_about_the_face():
    scene = Scene(WIDE, NARROW)  # a lies at 26.6 degrees, o straight ahead, 2 at -158
    scene.belief.age[:] = 5
    scene.look("1")
    assert scene.belief.age[0, 0, [1, 2, 3]].tolist() == [5, 0, 0]
    scene.belief.age[:] = 5
    scene.face("1", 75.0)
    scene.belief.neck[0, 0] = math.radians(-10.0)  # faces 65: within 45 degrees of a, not of o
    scene.look("1")
    assert scene.belief.age[0, 0, [1, 2, 3]].tolist() == [5, 0, 5]


def test_a_full_view_sees_behind():
    scene = Scene(WIDE)
    scene.face("1", 180.0)
    scene.belief.age[:] = 5
    scene.look("1")
    assert not scene.belief.age[0, 0, 1:].any()


def test_what_lies_behind_is_felt_within_three_metres():
    scene = Scene("o . . 1", NARROW)
    for x, age in ((0.1, 0), (-0.1, 5)):
        scene.put("o", x, 0.0)
        scene.belief.age[:] = 5
        scene.look("1")
        assert scene.belief.age[0, 0, scene.ball] == age


@pytest.mark.parametrize(
    ("distance", "draws", "velocity"),
    [
        (19.9, [], 0.5),
        (30.0, [0.49], 0.5),  # half the time half way between 20 and 40 m
        (30.0, [0.51], 0.1),
        (39.0, [0.04], 0.5),
        (39.0, [0.06], 0.1),
        (41.0, [0.0], 0.1),
    ],
)
def test_far_objects_show_less_often_how_they_move(distance, draws, velocity):
    scene = Scene("1 o", field=90.0)
    scene.change(certain_distance=20.0)
    scene.put("o", distance, 0.0)
    scene.move("o", 0.5, 0.0)
    scene.belief.velocity[0, 0, scene.ball] = 0.1, 0.0
    scene.look("1", *draws)
    assert scene.belief.velocity[0, 0, scene.ball, 0] == approx(velocity)


@pytest.mark.parametrize(
    ("seen", "believed"),
    [(1.05, 1.025), (1.2, 1.2)],  # within 2 * ball_rand of the expected 1.0: the mean
)
def test_a_ball_that_rolls_as_expected_is_believed_half_way(seen, believed):
    scene = Scene("1 . . . . o")
    scene.move("o", seen, 0.0)
    scene.belief.velocity[0, 0, scene.ball] = 1.0, 0.0
    scene.look("1")
    assert scene.belief.velocity[0, 0, scene.ball] == approx([believed, 0.0])


@pytest.mark.parametrize(
    ("taker", "velocity"),
    [(6.0, 0.0), (6.2, 0.3)],  # within 1.085 m of the ball at 5, or not
)
def test_a_ball_within_an_opponents_reach_is_believed_to_lie_still(taker, velocity):
    scene = Scene("1 . . . . o a")
    scene.put("a", taker, 0.0)
    scene.move("o", 0.3, 0.0)
    scene.look("1")
    assert scene.belief.velocity[0, 0, scene.ball] == approx([velocity, 0.0])


def test_the_error_of_the_own_position_moves_everything_seen():
    scene = Scene("1 . . . . o", noiseless(profile("2005")))
    scene.change(self_position_error=0.15)
    scene.look("1", 1.0, 0.25)  # +0.15 along x, -0.075 along y
    assert scene.belief.position[0, 0, 0] == approx([0.15, -0.075])
    assert scene.belief.position[0, 0, scene.ball] == approx([5.15, -0.075])


def test_the_own_position_is_known_as_well_as_was_measured_on_the_real_server():
    # P: a particle filter over flags; evenly spread errors along each axis
    file = resources.files("keepaway_sim") / "reference" / "hold_times.json"
    measured = json.loads(file.read_text())["E05"]["belief_errors_of_keepers"]
    spread = profile("2005").vision.self_position_error / math.sqrt(3.0)
    assert spread == approx(measured["K1_to_centre"]["with_look_sd"], abs=0.001)


def test_the_error_of_the_own_direction_turns_everything_seen():
    scene = Scene("1 . . . . o")
    scene.change(self_yaw_error=math.radians(0.3))
    scene.look("1", 0.0)
    assert math.degrees(scene.belief.body[0, 0, 0]) == approx(-0.3)
    assert scene.seen("1", "o") == approx(
        [5 * math.cos(math.radians(0.3)), -5 * math.sin(math.radians(0.3))]
    )


def looks_at(scene: Scene, time: int) -> bool:
    """Does the first player see something new at a time of its field's life?"""
    scene.w.truth.time[0] = time
    return bool(survey.looks_now(scene.w, 0, 0))


def test_two_of_three_cycles_bring_something_new():
    scene = Scene("1 2")
    for phase in range(3):
        scene.memory.look_phase[0, 0] = phase
        looks = [looks_at(scene, time) for time in range(9)]
        assert sum(looks) == 6
        assert looks[:3] == looks[3:6] == looks[6:]


def test_with_a_period_of_one_every_cycle_brings_something_new():
    scene = Scene("1 2")
    scene.change(look_period=1)
    assert all(looks_at(scene, time) for time in range(9))


def test_what_is_not_seen_rolls_on_and_ages():
    scene = Scene(WIDE)
    scene.lose("a")
    scene.move("2", 0.4, 0.0)
    scene.move("o", 1.0, -0.5)
    scene.belief.age[0, 0, 1] = 3
    memory.remember(scene.w, 0, 0)
    memory.roll_on(scene.w, 0, 0)
    belief = scene.belief
    assert belief.position[0, 0, 1] == approx([1.4, 0.0])
    assert belief.velocity[0, 0, 1] == approx([0.16, 0.0])  # player_decay 0.4
    assert belief.position[0, 0, scene.ball] == approx([12.0, 1.5])
    assert belief.velocity[0, 0, scene.ball] == approx([0.94, -0.47])
    assert belief.position[0, 0, 2] == approx([10.0, 4.0])  # who is not known stays
    assert belief.age[0, 0].tolist() == [1, 4, NEVER, 1]


def test_the_first_of_the_own_team_is_never_moved():
    # P updateDynamicObjectForNextCycle leaves OBJECT_TEAMMATE_1 where it was seen
    scene = Scene("1 . . . 2 . . 3 . o")
    for name in "13":
        scene.move(name, 0.4, 0.0)
    memory.roll_on(scene.w, 0, 1)
    assert scene.seen("2", "1") == approx([-4.0, 0.0])
    assert scene.belief.velocity[0, 1, 0] == approx([0.4, 0.0])
    assert scene.seen("2", "3") == approx([3.4, 0.0])


def test_the_opponent_fastest_to_the_ball_is_believed_to_come_for_it():
    # a is 8 m and b 6 m from where the ball is, but it rolls toward a
    scene = Scene("a . . . 1 . . . o . . . . . b")
    scene.move("o", -1.0, 0.0)
    memory.roll_on(scene.w, 0, 0)
    assert scene.seen("1", "a") == approx([-4.0 + 0.3, 0.0])


@pytest.mark.parametrize(
    ("ball_vx", "drift"),
    [(0.0, -0.25), (0.5, 0.25), (1.1, 0.5), (-0.5, -0.25), (-1.1, -0.5)],
)
def test_other_unseen_opponents_drift_along_x_with_the_ball(ball_vx, drift):
    # P: toward -x of the own frame, unless the ball flies ahead; twice as far if it is fast
    scene = Scene("1 . a . . . . . . . b")
    scene.put("o", 2.0, 0.5)  # a has it
    scene.move("o", ball_vx, 0.0)
    scene.move("b", 0.4, 0.3)
    memory.roll_on(scene.w, 0, 0)
    assert scene.seen("1", "b") == approx([10.0 + drift, 0.0])


def test_an_opponent_of_whom_was_heard_makes_up_for_the_age_of_that():
    # P updateAfterSenseMessage: carried on by as many cycles as its place is old
    scene = Scene("1 . 2 a . . . . . . . . . 3 b o")
    for name in "2b":
        say(scene, name)
    scene.lose("a", 9)
    hear(scene, "1", 0.2)
    x, y = scene.seen("1", "a")
    memory.roll_on(scene.w, 0, 0)
    assert scene.seen("1", "a") == approx([x - 3 * 0.25, y])
    memory.roll_on(scene.w, 0, 0)
    assert scene.seen("1", "a") == approx([x - 4 * 0.25, y])


def test_for_takers_the_drift_is_mirrored():
    scene = Scene("a . 1 . . . . . . . 2")
    scene.put("o", 2.0, 0.5)
    scene.move("o", -0.5, 0.0)  # ahead for those who play toward -x
    memory.roll_on(scene.w, 0, scene.index("a"))
    assert scene.seen("a", "2") == approx([10.0 - 0.25, 0.0])


def test_an_own_kick_is_part_of_what_is_expected():
    scene = Scene("1 o")
    scene.put("o", 0.385, 0.0)
    scene.move("o", 0.3, 0.0)
    scene.memory.command[0, 0] = KICK, 50.0, math.pi / 2
    scene.memory.kicked[0, 0] = True
    memory.remember(scene.w, 0, 0)
    # 50 * 0.027 = 1.35 to the left
    assert scene.seen("1", "o") == approx([0.685, 1.35])
    assert scene.belief.velocity[0, 0, scene.ball] == approx([0.94 * 0.3, 0.94 * 1.35])


def test_an_own_turn_is_part_of_what_is_expected():
    scene = Scene("1 o")
    scene.memory.turned[0, 0] = math.radians(30.0)
    memory.remember(scene.w, 0, 0)
    assert math.degrees(scene.belief.body[0, 0, 0]) == approx(30.0)


def test_own_speed_is_felt_to_a_hundredth():
    scene = Scene("1 . . o", ROUNDED)
    scene.velocity[0] = 0.3 * 0.777, 0.4 * 0.777  # speed 0.3885
    memory.feel_self(scene.w, 0, 0)
    assert scene.belief.velocity[0, 0, 0] == approx([0.6 * 0.39, 0.8 * 0.39])
    assert scene.belief.age[0, 0, 0] == 0


def test_whoever_runs_into_the_ball_believes_it_before_its_body():
    scene = Scene("1 . o")
    scene.belief.cycle[0] = 1
    scene.belief.position[0, 0, scene.ball] = 0.6, 0.0
    scene.belief.velocity[0, 0, scene.ball] = -0.5, 0.0
    scene.belief.velocity[0, 0, 0] = 0.9, 0.0  # expected now: 0.36; felt: reversed and slow
    scene.velocity[0] = -0.05, 0.0
    memory.feel_self(scene.w, 0, 0)
    assert scene.seen("1", "o") == approx([0.2, 0.0])
    assert scene.belief.velocity[0, 0, scene.ball] == approx([0.05, 0.0])


def test_a_new_episode_forgets_the_last():
    scene = Scene(WIDE)
    scene.move("o", 1.0, 0.0)
    scene.draw(0.7)
    memory.forget(scene.w, 0, 0)
    assert np.all(scene.belief.age[0, 0] == NEVER)
    assert not scene.belief.velocity[0, 0].any()
    assert scene.memory.look_phase[0, 0] == 2  # 0.7 * 3


HEARD = """
    . . . . . a . . . . . . .
    . . . . . . 2 o . . . . .
    1 . . . . . . . . . . . 3
"""


STAY = Command(NONE, 0.0, 0.0)


def say(scene: Scene, name: str, command: Command = STAY) -> None:
    hearing.speak(scene.w, 0, scene.index(name), command)


def hear(scene: Scene, name: str, uniform: float) -> None:
    """Let a player hear the team-mate that this random number chooses."""
    scene.draw(uniform)
    hearing.hear(scene.w, 0, scene.index(name))


@pytest.mark.parametrize(
    ("value", "ahead", "told"),
    [(0.0, True, -0.725), (7.0, True, 6.525), (7.9, True, 6.525), (8.0, True, 7.975)],
)
def test_a_message_cuts_numbers_to_the_lower_end_of_a_step(value, ahead, told):
    # P: 73 steps of 1.45 m from -53 m on; 7.0 and 7.9 lie in the one from 6.525 to 7.975
    assert hearing.cut(value, 1.45, ahead) == approx(told)
    assert hearing.cut(-value, 1.45, not ahead) == approx(-told)  # who plays toward -x


def test_a_player_speaks_of_the_ball_and_of_an_opponent_near_it():
    scene = Scene(HEARD, ROUNDED)
    scene.move("o", 0.5, 0.5)
    say(scene, "2")
    # steps of 1.45 and 0.93 m, y to the right: ball (7, 1) -> (6.525, 1.395)
    still = [-0.037, 0.037]  # within reach: lies still, as well as that can be spelled
    assert scene.speech.ball[0, 1] == approx([6.525, 1.395, *still])
    assert scene.speech.ball_age[0, 1] == 1
    assert scene.speech.opponent[0, 1] == scene.index("a")
    assert scene.speech.opponent_position[0, 1] == approx([3.625, 2.325])


def test_a_player_far_from_all_has_nothing_to_say():
    scene = Scene(HEARD, ROUNDED)
    scene.lose("o", 2)
    say(scene, "3", Command(DASH, 100.0, 0.0))
    assert scene.speech.ball_age[0, 2] == -1
    assert scene.speech.opponent[0, 2] == -1


def test_nobody_learns_from_a_message_where_its_speaker_is():
    # P processPlayerMessage: as if the listener had said it, who knows better
    scene = Scene(HEARD, ROUNDED)
    scene.lose("2", 9)
    scene.lose("3")
    say(scene, "2")
    say(scene, "3")
    for uniform in (0.4, 0.6):
        hear(scene, "1", uniform)
    assert scene.belief.age[0, 0, :3].tolist() == [0, 9, NEVER]
    assert scene.seen("1", "2") == approx([6.0, 1.0])


@pytest.mark.parametrize("age", [0, 1])
def test_a_kick_is_announced_also_without_a_look(age):
    # P makeSayMessage: where the ball will be, if it leaves reach by this kick
    scene = Scene("1 o . . 2")
    scene.put("o", 0.5, 0.0)
    scene.lose("o", age)
    say(scene, "1", Command(KICK, 100.0, 0.0))
    assert scene.speech.ball_age[0, 0] == 0
    x, y, vx, vy = scene.speech.ball[0, 0]
    assert (x, y) == approx(scene.ball_after("1", (KICK, 100.0, 0.0)))
    assert (vx, vy) == approx((0.94 * (x - 0.5), 0.0))
    say(scene, "1", Command(KICK, 5.0, 0.0))  # stays in reach
    assert scene.speech.ball_age[0, 0] == (1 if age == 0 else -1)


def test_a_message_helps_who_has_not_seen_the_ball_move_for_four_cycles():
    scene = Scene(HEARD, ROUNDED)
    scene.belief.cycle[0] = 20
    say(scene, "2")
    for age, x in ((3, 7.0), (4, 6.525 - 0.037)):  # rolled on by the cycle of the message
        scene.believe()
        scene.lose("o", age)
        hear(scene, "1", 0.1)
        assert scene.belief.position[0, 0, scene.ball, 0] == approx(x)
    assert scene.belief.age[0, 0, scene.ball] == 2


@pytest.mark.parametrize(("age", "taken"), [(0, False), (1, True)])
def test_a_kick_that_is_told_of_counts_for_who_does_not_see_the_ball_now(age, taken):
    scene = Scene("1 . . . . . . 2 o")
    scene.put("o", 7.5, 0.0)
    scene.belief.cycle[0] = 20
    scene.believe()
    say(scene, "2", Command(KICK, 100.0, 0.0))
    scene.lose("o", age)
    hear(scene, "1", 0.1)
    assert (scene.belief.velocity[0, 0, scene.ball, 0] > 1.0) == taken
    assert scene.belief.age[0, 0, scene.ball] == (1 if taken else age)


def test_who_is_near_the_ball_trusts_itself():
    scene = Scene(HEARD)
    say(scene, "2")
    scene.belief.cycle[0] = 20
    scene.lose("o", 8)
    scene.belief.position[0, 0, scene.ball] = 2.9, 0.0
    hear(scene, "1", 0.1)
    assert scene.belief.position[0, 0, scene.ball] == approx([2.9, 0.0])


def test_one_message_a_cycle_is_heard_and_only_of_team_mates():
    scene = Scene(HEARD, ROUNDED)
    for name in "123a":
        say(scene, name)
    scene.belief.age[0, 0] = [0, 9, 9, 9, 0]
    hear(scene, "1", 0.6)  # the second of two team-mates: 3
    assert scene.belief.age[0, 0].tolist() == [0, 9, 9, 9, 0]
    hear(scene, "1", 0.4)  # 2 tells of the taker, as seen a cycle before
    assert scene.belief.age[0, 0].tolist() == [0, 9, 9, 2, 0]
    before = scene.belief.position[0, 3].copy()
    hear(scene, "a", 0.5)  # has nobody to listen to
    np.testing.assert_array_equal(scene.belief.position[0, 3], before)


@pytest.mark.parametrize(
    ("y", "turn", "neck"),
    [(4.0, 0.0, 45.0), (4.0, 30.0, 15.0), (-4.0, 0.0, -45.0), (4.0, -90.0, 90.0)],
)
def test_a_neck_turns_toward_a_point_as_far_as_it_goes(y, turn, neck):
    scene = Scene("1 o")
    sight.turn_neck(scene.w, 0, 0, 4.0, y, math.radians(turn))
    assert math.degrees(scene.belief.neck[0, 0]) == approx(neck)


def test_exact_scenes_need_no_random_numbers():
    scene = Scene(WIDE, EXACT)
    for name in "12a":
        scene.look(name)
