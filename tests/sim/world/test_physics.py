"""Movement, kicks and collisions by hand-worked numbers.

Sources: S is the RoboCup soccer server 19.0.0 (leg.cpp dash, player.cpp turn and kick, object.cpp
movement, stadium.cpp collisions).
"""

import math

import numpy as np
import pytest
from scenes import draws

from keepaway_sim.task import Task
from keepaway_sim.world import physics
from keepaway_sim.world.bodies import Bodies
from keepaway_sim.world.config import profile
from keepaway_sim.world.constants import pack
from keepaway_sim.world.state import Scratch

approx = pytest.approx

C_2005 = pack(Task(), profile("2005"))
C_V19 = pack(Task(), profile("v19"))
TOUCH, KICKABLE = 0.385, 1.085  # [m] S: 0.3 + 0.085, and 0.7 more


@pytest.mark.parametrize(
    ("c", "power", "degrees", "expected"),
    [
        (C_2005, 100.0, 0.0, (0.6, 0.0)),  # 100 * 0.006
        (C_2005, 50.0, 90.0, (0.0, 0.3)),
        (C_2005, 150.0, 180.0, (-0.6, 0.0)),  # cut to 100
        (C_2005, -100.0, 0.0, (-0.6, 0.0)),  # 2005: full strength backward
        (C_V19, -100.0, 0.0, (0.0, 0.0)),  # since 17.0.0 min_dash_power is 0
    ],
)
def test_dash_accelerates_along_the_body(c, power, degrees, expected):
    assert physics.dash_acceleration(c, power, math.radians(degrees)) == approx(expected, abs=1e-12)


NOISY = physics.Limits(accel=1.0, speed=1.2, rand=0.1)


def no_noise(c, velocity, acceleration, accel_max, speed_max):
    limits = physics.Limits(accel_max, speed_max, 0.0)
    return physics.moved_velocity(*velocity, *acceleration, limits, draws(), 0)


def test_full_dashes_approach_one_metre_a_cycle():
    # 0.6 / (1 - 0.4) = 1.0, below player_speed_max: 0.6, 0.84, 0.936, ..
    velocity, speeds = (0.0, 0.0), []
    for _ in range(30):
        velocity = no_noise(C_2005, velocity, (0.6, 0.0), 1.0, 1.2)
        speeds.append(velocity[0])
        velocity = (0.4 * velocity[0], 0.0)
    assert speeds[:3] == approx([0.6, 0.84, 0.936], abs=1e-8)
    assert speeds[-1] == approx(1.0, abs=1e-8)


@pytest.mark.parametrize(
    ("moment", "speed", "noise", "expected"),
    [
        (90.0, 0.0, 0.0, 90.0),
        (180.0, 1.0, 0.0, 30.0),  # 180 / (1 + 5 * 1)
        (90.0, 0.4, 0.0, 30.0),  # 90 / (1 + 5 * 0.4)
        (90.0, 0.0, 1.0, 99.0),  # (1 + 0.1) * 90
        (90.0, 0.0, -1.0, 81.0),
        (400.0, 1.0, 0.0, 30.0),  # a moment is cut to 180
        (-90.0, 0.4, 0.0, -30.0),
    ],
)
def test_moving_players_turn_less(moment, speed, noise, expected):
    turned = physics.turned_yaw(C_2005, 0.0, math.radians(moment), speed, noise)
    assert math.degrees(turned) == approx(expected)


def test_a_turn_past_the_back_stays_within_half_a_circle():
    turned = physics.turned_yaw(C_2005, math.radians(170.0), math.radians(30.0), 0.0, 0.0)
    assert math.degrees(turned) == approx(-160.0)


@pytest.mark.parametrize(
    ("distance", "degrees", "share"),
    [
        (TOUCH, 0.0, 1.0),
        (TOUCH, 90.0, 0.875),  # 1 - 0.25 * 90 / 180
        (TOUCH, -180.0, 0.75),
        (KICKABLE, 0.0, 0.75),  # 1 - 0.25 * 0.7 / 0.7
        (TOUCH + 0.35, 90.0, 0.75),
        (KICKABLE, 180.0, 0.5),
    ],
)
@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_kick_rate_falls_with_angle_and_distance(distance, degrees, share, yaw):
    angle = yaw + math.radians(degrees)
    x, y = distance * math.cos(angle), distance * math.sin(angle)
    assert physics.kick_rate(C_2005, x, y, yaw) == approx(0.027 * share)


@pytest.mark.parametrize(
    ("power", "direction", "expected"),
    [
        (100.0, 0.0, (2.7, 0.0)),
        (50.0, 90.0, (0.0, 1.35)),
        (120.0, 180.0, (-2.7, 0.0)),  # cut to 100
        (-10.0, 0.0, (0.0, 0.0)),
    ],
)
def test_a_kick_accelerates_the_ball(power, direction, expected):
    kicked = physics.kick_acceleration(C_2005, power, math.radians(direction), TOUCH, 0.0, 0.0)
    assert kicked == approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("power", "distance", "degrees", "ball_speed", "expected"),
    [
        (100.0, TOUCH, 0.0, 0.0, 0.1),  # 0.1 * (0.5 + 0.5)
        (50.0, TOUCH, 0.0, 0.0, 0.05),
        (100.0, KICKABLE, 180.0, 0.0, 0.15),  # 0.1 * (1.0 + 0.5)
        (100.0, KICKABLE, 180.0, 3.0 * 0.94, 0.2),  # 0.1 * (1.0 + 1.0), the most
        (100.0, TOUCH, 90.0, 1.41, 0.1375),  # 0.1 * (0.625 + 0.75)
    ],
)
def test_kick_noise_grows_with_power_placement_and_ball_speed(
    power, distance, degrees, ball_speed, expected
):
    angle = math.radians(degrees)
    ball = distance * math.cos(angle), distance * math.sin(angle)
    assert physics.kick_noise_radius(C_V19, power, *ball, 0.0, ball_speed) == approx(expected)


def test_kicks_of_2005_have_no_noise():
    assert physics.kick_noise_radius(C_2005, 100.0, KICKABLE, 0.0, 0.0, 2.0) == 0.0


@pytest.mark.parametrize(
    ("velocity", "acceleration", "expected"),
    [
        ((0.0, 0.0), (3.0, 4.0), (1.62, 2.16)),  # acceleration cut to 2.7
        ((2.0, 0.0), (2.0, 0.0), (2.7, 0.0)),  # speed cut to 2.7
        ((0.6, 0.8), (0.0, 0.0), (0.6, 0.8)),
    ],
)
def test_acceleration_and_speed_of_the_ball_are_limited(velocity, acceleration, expected):
    assert no_noise(C_2005, velocity, acceleration, 2.7, 2.7) == approx(expected, abs=1e-9)


def test_movement_noise_is_a_share_of_the_speed_in_a_random_direction():
    # U(0, 0.1 * 1.0) at 0.5 is 0.05; U(0, 2 pi) at 0.25 is straight left
    random = draws(0.5, 0.25, 0.9)
    moved = physics.moved_velocity(1.0, 0.0, 0.0, 0.0, NOISY, random, 0)
    assert moved == approx((1.0, 0.05), abs=1e-9)
    assert random.cursor[0] == 2


def test_what_lies_still_draws_no_noise():
    random = draws(0.5, 0.25)
    moved = physics.moved_velocity(0.0, 0.0, 0.0, 0.0, NOISY, random, 0)
    assert moved == (0.0, 0.0)
    assert random.cursor[0] == 0


def separated(places, radii, velocity=None):
    """Positions and velocities after collisions; places on the x axis or (x, y)."""
    position = np.array([place if isinstance(place, tuple) else (place, 0.0) for place in places])
    moving = np.array(velocity, dtype=float) if velocity else np.ones_like(position)
    num = len(radii)
    places, none = np.zeros((num, 2)), np.zeros(1)
    collided = np.zeros(num, dtype=np.bool_)
    numbers = np.zeros((num, 2), dtype=np.int64)
    felt = np.zeros((num, 3))
    scratch = Scratch(places.copy(), places, np.zeros(num), collided, none, felt, numbers)
    physics.separate(position, moving, np.array(radii), scratch)
    return position, moving


def test_overlapping_discs_are_pushed_to_touching_and_reversed():
    position, velocity = separated([0.0, 0.4, 5.0], [0.3] * 3, [(1, 0), (0, 2), (1, 1)])
    assert position == approx(np.array([(-0.1, 0), (0.5, 0), (5, 0)]))
    assert velocity == approx(np.array([(-0.1, 0), (0, -0.2), (1, 1)]), abs=1e-9)


def test_player_and_ball_share_the_push():
    # they touch at 0.385 and lie 0.2 apart along y: each moves 0.0925
    position, _ = separated([(1.0, 1.0), (1.0, 1.2)], [0.3, 0.085])
    assert position == approx(np.array([(1.0, 0.9075), (1.0, 1.2925)]))


def test_touching_discs_do_not_collide():
    _, velocity = separated([0.0, 0.6], [0.3, 0.3])
    assert np.all(velocity == 1.0)


def test_a_pile_of_three_spreads_over_ten_sweeps():
    # At 0, 0.4, 0.8 with touching distance 0.6: the middle one goes to the mean of 0.5 and 0.3,
    # so it stays; what the outer ones lack halves with every sweep: 0.6 - 0.2 / 2**10.
    position, velocity = separated([0.0, 0.4, 0.8], [0.3] * 3)
    reach = 0.6 - 0.2 / 2**10
    assert position[:, 0] == approx([0.4 - reach, 0.4, 0.4 + reach], abs=1e-8)
    assert velocity == approx(np.full((3, 2), -0.1), abs=1e-9)  # once, not once a sweep


def test_a_disc_in_two_pairs_goes_to_the_mean_of_its_places():
    # One sweep would put the corner disc at the mean of (-0.1, 0) and (0, -0.1); both gaps of the
    # others then are 0.4 + 0.1 + .. short of 0.6, and all three end (almost) at touching.
    position, _ = separated([(0.0, 0.0), (0.4, 0.0), (0.0, 0.4)], [0.3] * 3)
    gaps = [np.linalg.norm(position[a] - position[b]) for a, b in ((0, 1), (0, 2), (1, 2))]
    assert min(gaps) > 0.599
    assert position[0, 0] == approx(position[0, 1])  # the pile is symmetric about x = y


def test_discs_on_one_spot_part_along_x():
    position, _ = separated([1.0, 1.0], [0.3, 0.3])
    assert position == approx(np.array([(0.7, 0.0), (1.3, 0.0)]))


def test_velocities_lie_on_a_grid():
    x, y = no_noise(C_2005, (0.1, 1 / 3), (0.0, 0.0), 1.0, 1.2)
    assert (x * 2**30).is_integer()
    assert (y * 2**30).is_integer()
    assert (x, y) == approx((0.1, 1 / 3), abs=1e-9)


GRID_RANDOM = np.random.default_rng(8)


def on_grid(low, high, shape):
    """Random multiples of 2**-30."""
    return np.round(GRID_RANDOM.uniform(low, high, shape) * 2**30) / 2**30


@pytest.mark.parametrize("num_fields", [1, 7, 40])
def test_discs_move_by_their_velocity_to_the_last_bit_whether_pymunk_moves_them_or_not(num_fields):
    bodies = Bodies(num_fields, np.array([0.3] * 5 + [0.085]), 25.0)
    discs = bodies.discs
    for cycle in range(300):
        here = on_grid(-14.0, 14.0, (num_fields, 6, 2))
        step = on_grid(-3.0, 3.0, (num_fields, 6, 2))
        num_asked = 1 + cycle % num_fields
        discs.num_asked[0], discs.asked[:] = num_asked, np.arange(num_fields)[::-1]
        discs.motion[:, :, :2], discs.motion[:, :, 2:] = here + discs.place[:, None, :], step
        bodies.move()
        moved = discs.motion[:, :, :2] - discs.place[:, None, :]
        np.testing.assert_array_equal(moved[:num_asked], (here + step)[:num_asked])


def overlapping(position, radius):
    """Do any two discs of a field overlap by more than what counts as touching?"""
    gaps = np.linalg.norm(position[:, None] - position, axis=2) - radius[:, None] - radius
    return bool((gaps[np.triu_indices(len(radius), 1)] < -1e-6).any())


def test_no_overlap_escapes_the_pair_test_or_pymunk():
    radius = np.array([0.3] * 5 + [0.085])
    bodies = Bodies(32, radius, 25.0)
    discs, found = bodies.discs, 0
    discs.asked[:], discs.num_asked[0] = np.arange(32), 32
    for _ in range(200):
        here, step = on_grid(-2.0, 2.0, (32, 6, 2)), on_grid(-1.0, 1.0, (32, 6, 2))
        discs.motion[:, :, :2], discs.motion[:, :, 2:] = here + discs.place[:, None, :], step
        bodies.move()
        for f in range(32):
            if overlapping(here[f] + step[f], radius):
                found += 1
                assert physics.may_touch(here[f], step[f], radius)
                assert discs.touched[f]
    assert 500 < found < 6000


def test_only_fields_in_which_discs_touch_are_named():
    bodies = Bodies(20, np.array([0.3, 0.3, 0.085]), 25.0)
    discs = bodies.discs
    discs.motion[:, :, :2] = discs.place[:, None, :] + np.array([(0, 0), (4, 0), (8, 0)])
    discs.motion[7, 1, :2] = discs.place[7] + (0.5, 0.0)
    discs.motion[13, 2, 2:] = (-3.8, 0.0)  # a ball that rolls against a player
    discs.asked[:15], discs.num_asked[0] = np.arange(15) + 3, 15
    bodies.move()
    assert np.flatnonzero(discs.touched).tolist() == [10, 16]
    discs.num_asked[0] = 0
    bodies.move()
    assert not discs.touched.any()
