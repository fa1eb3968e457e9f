"""Plane geometry by hand-worked numbers."""

import math

import pytest

from keepaway_sim.world import geometry

approx = pytest.approx


@pytest.mark.parametrize(
    ("degrees", "expected"), [(0, 0), (190, -170), (-190, 170), (540, 180), (-725, -5)]
)
def test_angles_are_wrapped_to_half_a_circle_each_way(degrees, expected):
    wrapped = math.degrees(geometry.wrap(math.radians(degrees)))
    assert abs(wrapped) == approx(abs(expected))
    assert abs(expected) == 180 or wrapped == approx(expected)


@pytest.mark.parametrize(
    ("value", "step", "expected"), [(2.34, 0.1, 2.3), (-2.36, 0.1, -2.4), (0.123, 0.0, 0.123)]
)
def test_values_are_rounded_to_a_step(value, step, expected):
    assert geometry.quantize(value, step) == approx(expected)


@pytest.mark.parametrize(
    ("x", "y", "inside"),
    [
        (5.0, 1.4, True),  # half width there is 0.3 * 5 = 1.5
        (5.0, -1.6, False),
        (0.1, 0.0, True),
        (-0.1, 0.0, False),  # behind the start
        (10.1, 0.0, False),  # beyond the end
        (9.9, 2.0, False),  # before the end, but further from the start than the end is
    ],
)
def test_a_lane_is_a_cone_that_ends_at_its_goal(x, y, inside):
    # P: WorldModel::getNrInSetInCone
    assert geometry.cone_contains(x, y, 0.0, 0.0, 10.0, 0.0, 0.3) == inside
    assert geometry.cone_contains(3 - y, 4 + x, 3.0, 4.0, 3.0, 14.0, 0.3) == inside
