"""What players with a limited view believe of whom they should see, and do not.

Source: P WorldModelUpdate.cc, processNewObjectInfo and removeGhosts.
"""

import math

import pytest
from scenes import Scene

from keepaway_sim.world import ghosts
from keepaway_sim.world.config import NEVER, noiseless, profile

approx = pytest.approx
NARROW = noiseless(profile("2005", visible_angle=90.0))


def expect(scene: Scene, name: str, x: float, y: float, age: int) -> None:
    """Let 1 expect somebody at a place, seen `age` cycles ago."""
    j = scene.index(name)
    scene.belief.position[0, 0, j] = x, y
    scene.belief.age[0, 0, j] = age


@pytest.mark.parametrize(("away", "forgotten"), [(2.0, True), (2.6, False)])
def test_who_is_seen_by_name_is_not_there_twice(away, forgotten):
    scene = Scene("1 . . . . a . . b", NARROW)
    expect(scene, "b", 5.0 + away, 3.0, 2)  # may have run 2.4 m
    scene.belief.position[0, 0, scene.index("b"), 1] = 0.0
    scene.memory.nameless[0, 0, scene.index("b")] = True
    ghosts.forget_double(scene.w, 0, 0, scene.index("a"))
    assert (scene.belief.age[0, 0, scene.index("b")] == NEVER) == forgotten


def at(degrees: float, away: float) -> tuple[float, float]:
    return away * math.cos(math.radians(degrees)), away * math.sin(math.radians(degrees))


@pytest.mark.parametrize(("degrees", "known"), [(29.0, False), (30.0, True), (-29.0, False)])
def test_a_team_mate_who_is_not_well_inside_the_cone_is_forgotten(degrees, known):
    scene = Scene("1 2", NARROW)
    expect(scene, "2", *at(degrees, 6.0), 3)
    ghosts.remove_ghosts(scene.w, 0, 0)
    assert (scene.belief.age[0, 0, 1] == 3) == known


@pytest.mark.parametrize(
    ("degrees", "age", "believed"),
    [
        (9.0, 9, None),  # in the middle of the cone: nobody knows
        (10.0, 9, 45.0),  # it has run out of the cone by the nearer edge,
        (-10.0, 9, -45.0),
        (10.0, 2, 10.0),  # if it can have come so far
        (30.0, 9, 30.0),
    ],
)
def test_an_opponent_who_is_not_inside_the_cone_has_left_it(degrees, age, believed):
    scene = Scene("1 a", NARROW)
    expect(scene, "a", *at(degrees, 6.0), age)
    scene.memory.motion_cycle[:] = -NEVER
    ghosts.remove_ghosts(scene.w, 0, 0)
    assert scene.belief.age[0, 0, scene.index("a")] == (NEVER if believed is None else age)
    if believed is not None:
        assert scene.seen("1", "a") == approx(at(believed, 6.0))


def test_near_the_middle_an_opponent_leaves_by_the_side_it_faced():
    scene = Scene("1 a", NARROW)
    scene.change(visible_angle=math.radians(80.0))  # everything inside 26, forgotten inside 6
    for yaw, edge in ((90.0, 40.0), (-90.0, -40.0)):
        expect(scene, "a", *at(8.0, 6.0), 5)
        scene.belief.body[0, 0, scene.index("a")] = math.radians(yaw)
        ghosts.remove_ghosts(scene.w, 0, 0)
        assert scene.seen("1", "a") == approx(at(edge, 6.0))


def test_an_opponent_who_is_not_felt_is_just_out_of_touch():
    scene = Scene("1 a", NARROW)
    expect(scene, "a", -1.0, 0.0, 3)
    ghosts.remove_ghosts(scene.w, 0, 0)
    assert scene.seen("1", "a") == approx([-3.0, 0.0])


@pytest.mark.parametrize(
    ("ball", "taker", "seen_ago", "place"),
    [
        ((4.0, 0.0), (9.0, 0.0), 1, None),  # not where it must be seen: nobody knows
        ((4.0, 0.0), (4.0, 1.9), 1, (4.0, 1.9)),  # close to a taker who is unseen too
        ((4.0, 0.0), (4.0, 1.9), 0, None),  # he is seen, and has not got it
        ((5.0, 0.0), (5.0, 1.9), 1, None),  # he is too far away
        ((-2.6, 0.0), (-2.6, 1.9), 0, (-2.6, 1.9)),  # not where it must be felt
        ((-2.8, 0.0), (-2.8, 1.9), 0, (-2.8, 0.0)),  # behind, and not surely in touch
        ((2.0, 0.0), (2.0, 1.9), 1, (2.0, 1.9)),  # neither seen nor felt
        ((2.0, 0.0), (2.0, 1.9), 0, None),  # and the taker that is seen there has not got it
    ],
)
def test_a_ball_that_is_not_where_it_must_be(ball, taker, seen_ago, place):
    scene = Scene("1 a o", NARROW)
    expect(scene, "o", ball[0], ball[1], 3)
    expect(scene, "a", taker[0], taker[1], seen_ago)
    ghosts._remove_ghost_ball(scene.w, 0, 0)
    assert scene.belief.age[0, 0, scene.ball] == (NEVER if place is None else 3)
    if place:
        assert scene.seen("1", "o") == approx(place)
