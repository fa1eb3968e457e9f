"""The profiles are the servers' constants; ill settings are refused by name."""

import json
import math

import attrs
import numpy as np
import pytest

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Task
from keepaway_sim.world.config import CYCLE_TIME, PROFILES, Config, noiseless, profile
from keepaway_sim.world.constants import pack

approx = pytest.approx


def test_profiles_differ_where_the_servers_do():
    # S: serverparam.cpp and NEWS: 12.0 kick noise, 17.0.0 no backward dash
    old, new = (attrs.asdict(PROFILES[name]) for name in ("2005", "v19"))
    differ = {name: (old[name], new[name]) for name in old if old[name] != new[name]}
    assert differ == {
        "player_speed_max": (1.2, 1.05),
        "min_dash_power": (-100.0, 0.0),
        "ball_speed_max": (2.7, 3.0),
        "kick_rand": (0.0, 0.1),
    }


def test_constants_of_the_server():
    # S: serverparam.cpp
    p = profile("2005").physics
    assert (p.player_size, p.ball_size, p.kickable_margin) == (0.3, 0.085, 0.7)
    assert (p.player_decay, p.ball_decay, p.player_rand, p.ball_rand) == (0.4, 0.94, 0.1, 0.05)
    assert (p.dash_power_rate, p.kick_power_rate, p.inertia_moment) == (0.006, 0.027, 5.0)
    assert CYCLE_TIME == 0.1


def test_packed_constants_are_in_radians_with_derived_ones():
    c = pack(Task(4, 3, 30.0, 20.0), profile("2005", visible_angle_deg=90.0))
    assert c.visible_angle == approx(math.pi / 2)
    assert c.direction_step == approx(math.radians(1.0))
    assert (c.touch_distance, c.kickable_distance) == approx((0.385, 1.085))
    assert (c.num_keepers, c.num_takers, c.field_length, c.field_width) == (4, 3, 30.0, 20.0)
    # rolling out: 1, 1.94, 2.8236, .. toward 1 / (1 - 0.94)
    assert c.ball_roll[:4] == approx([0.0, 1.0, 1.94, 2.8236])
    assert c.player_roll[:4] == approx([0.0, 1.0, 1.4, 1.56])


def test_types_do_not_depend_on_the_values_given():
    # compiled functions are kept for one set of types
    one = pack(Task(), profile("2005"))
    other = pack(Task(5, 4, 30, 30), profile("v19", visible_angle_deg=90, look_period=1, hearing=0))
    for a, b in zip(one, other, strict=True):
        assert type(a) is type(b)


def test_one_constant_is_changed_by_name():
    config = profile("v19", kick_rand=0.0, hearing=False, hold_distance=0.5)
    assert config.physics == attrs.evolve(PROFILES["v19"], kick_rand=0.0)
    assert config.vision.hearing is False
    assert config.skills.hold_distance == 0.5


def test_a_configuration_survives_json():
    config = noiseless(profile("v19", visible_angle_deg=90.0))
    assert Config.from_dict(json.loads(json.dumps(config.to_dict()))) == config


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: profile("2006"), "profile='2006'.*2005, v19"),
        (lambda: profile("2005", gravity=9.81), "gravity: no such setting"),
        (
            lambda: profile("2005", visible_angle_deg=0.0),
            "visible_angle_deg=0.0: give a number above 0 and up to 360",
        ),
        (lambda: profile("2005", visible_angle_deg=400.0), "visible_angle_deg=400.0"),
        (
            lambda: profile("2005", ball_decay=1.0),
            "ball_decay=1.0: give a number above 0 and below 1",
        ),
        (lambda: profile("2005", player_size=-0.3), "player_size=-0.3: give a number above 0"),
        (lambda: profile("2005", kick_rand=math.nan), "kick_rand=nan: give a number from 0"),
        (lambda: profile("2005", kick_rand="0.1"), "kick_rand='0.1': give a number from 0"),
        (
            lambda: profile("2005", kickable_margin=0.0),
            "kickable_margin=0.0: give a number above 0",
        ),
        (lambda: profile("2005", look_period=0), "look_period=0: give a whole number from 1"),
        (lambda: profile("2005", look_period=1.5), "look_period=1.5: give a whole number"),
        (
            lambda: profile("2005", intercept_horizon=65),
            "intercept_horizon=65: give a whole number from 1 to 64",
        ),
        (lambda: Config.from_dict({"profile": "2005"}), "not a world configuration"),
    ],
)
def test_ill_settings_are_refused_by_name(make, says):
    with pytest.raises(KeepawayError, match=says):
        make()


def test_a_noiseless_configuration_keeps_everything_that_is_no_noise():
    config = profile("v19", visible_angle_deg=90.0)
    exact = noiseless(config)
    assert exact.vision.visible_angle_deg == 90.0
    assert exact.physics.ball_speed_max == config.physics.ball_speed_max
    zeroed = [
        exact.physics.kick_rand, exact.vision.quantize_step, exact.vision.direction_step_deg,
        exact.vision.change_step, exact.vision.speed_step, exact.vision.self_position_error,
        exact.vision.self_yaw_error_deg, exact.vision.hear_step_x, exact.vision.hear_step_velocity,
    ]  # fmt: skip
    assert not np.any(zeroed)
    assert not exact.physics.movement_noise
    assert not exact.physics.turn_noise
