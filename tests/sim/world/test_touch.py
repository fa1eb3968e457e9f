"""Whom players with a limited view take those for whom they only feel.

Source: P WorldModelUpdate.cc, processLastSeeMessage and mapUnknownPlayers.
"""

import math

import pytest
from scenes import Scene

from keepaway_sim.world import ghosts, memory, touch
from keepaway_sim.world.config import NEVER, noiseless, profile
from keepaway_sim.world.skills import fastest, kicking, tactics

approx = pytest.approx
NARROW = noiseless(profile("2005", visible_angle=90.0))


def felt_scene() -> Scene:
    """1 faces away from a, which stands two metres behind it; 2 and b are out of sight."""
    scene = Scene("a . 1 . . . . . 2", NARROW)
    scene.put("2", -5.0, -12.0)
    scene.lose("a")
    scene.lose("2")
    return scene


def expect(scene: Scene, name: str, x: float, y: float, age: int) -> None:
    """Let 1 expect somebody at a place, seen `age` cycles ago."""
    j = scene.index(name)
    scene.belief.position[0, 0, j] = x, y
    scene.belief.age[0, 0, j] = age


def test_who_is_felt_is_taken_for_who_is_expected_there():
    scene = felt_scene()
    expect(scene, "a", 0.5, 0.5, 4)
    scene.look("1")
    assert scene.seen("1", "a") == approx([-2.0, 0.0])
    assert scene.belief.age[0, 0, scene.index("a")] == 0
    assert scene.memory.nameless[0, 0, scene.index("a")]


def test_who_is_felt_may_be_taken_for_somebody_else():
    scene = felt_scene()
    expect(scene, "2", 0.5, 0.5, 4)
    scene.look("1")
    assert scene.seen("1", "2") == approx([-2.0, 0.0])
    assert scene.belief.age[0, 0, scene.index("a")] == NEVER


@pytest.mark.parametrize(("age", "taken_for_2"), [(4, True), (3, False)])
def test_nobody_is_expected_to_have_run_faster_than_players_can(age, taken_for_2):
    # 6 m in 4 cycles: 4.8 m at full speed and 2 m for noise; in 3 cycles 5.6 m are too few
    scene = felt_scene()
    expect(scene, "2", 0.0, 6.0, age)
    scene.look("1")
    assert (scene.belief.age[0, 0, scene.index("2")] == 0) == taken_for_2
    # else it fills the place of an opponent of whom nothing is known
    assert (scene.belief.age[0, 0, scene.index("a")] == 0) == (not taken_for_2)


def slots(scene: Scene, name: str) -> list[int]:
    """The phantoms in whom a player believes, by slot."""
    ages = scene.w.phantoms.age[0, scene.index(name)]
    return [slot for slot, age in enumerate(ages.tolist()) if age < NEVER]


def test_who_is_felt_and_can_be_nobody_becomes_an_opponent_that_the_match_has_not():
    scene = felt_scene()
    expect(scene, "a", 9.0, 9.0, 2)
    scene.look("1")
    assert scene.belief.age[0, 0, scene.index("a")] == 2
    assert slots(scene, "1") == [0]
    assert scene.w.phantoms.position[0, 0, 0] == approx([0.0, 0.0])


def test_who_is_felt_at_the_end_of_reach_becomes_nobody():
    # S reports 2.9 m as 3.0; P: nearer than 3.0
    scene = Scene("a . 1 . . . . . 2", profile("2005", visible_angle=90.0))
    scene.put("2", -5.0, -12.0)
    scene.put("a", -0.9, 0.0)
    for name in "a2":
        scene.lose(name)
    scene.look("1", 0.5, 0.5, 0.5)
    assert scene.belief.age[0, 0, scene.index("a")] == NEVER
    assert slots(scene, "1") == []


def test_there_is_room_for_eleven_opponents_and_for_none_but_the_real_ones_all_round():
    scene = felt_scene()
    assert scene.w.phantoms.age.shape[2] == 10
    expect(scene, "a", 9.0, 9.0, 0)
    scene.w.phantoms.age[0, 0] = 1
    scene.w.phantoms.position[0, 0] = 9.0, 9.0
    scene.look("1")
    assert scene.w.phantoms.age[0, 0].tolist() == [1] * 10
    assert Scene("1 a").w.phantoms.age.shape[2] == 0


def believe_in(scene: Scene, name: str, x: float, y: float, age: int = 1) -> None:
    """Let a player have felt a phantom somewhere."""
    phantoms, p = scene.w.phantoms, scene.index(name)
    phantoms.position[0, p, 0] = phantoms.felt[0, p, 0] = x, y
    phantoms.age[0, p, 0], phantoms.felt_cycle[0, p, 0] = age, scene.belief.cycle[0] - age


def test_a_phantom_is_the_nearest_opponent():
    scene = Scene("1 o . . . . . . . . . . . . . a", NARROW)
    believe_in(scene, "1", 3.0, 0.0)
    assert kicking.closest_opponent_to(scene.w, 0, 0, 1.0, 0.0) == (scene.ball + 1, 2.0)
    assert memory.nearest_opponent_to_ball(scene.w, 0, 0) == scene.ball + 1
    believe_in(scene, "1", 3.0, 0.0, age=13)
    assert memory.nearest_opponent_to_ball(scene.w, 0, 0) == scene.index("a")


def test_a_ball_in_reach_of_a_phantom_is_believed_to_lie_still():
    scene = Scene("1 . . . o . . . a", NARROW)
    scene.move("o", 0.5, 0.0)
    believe_in(scene, "1", 4.5, 0.5)
    memory.remember(scene.w, 0, 0)
    assert not scene.belief.velocity[0, 0, scene.ball].any()
    assert scene.w.phantoms.age[0, 0, 0] == 2


def test_a_phantom_is_in_the_way_of_a_pass_and_crowds():
    scene = Scene("2 . o . 1 . . . . . . . . . a", NARROW, corner=(-8.0, -8.0))
    x, y = tactics.open_point(scene.w, 0, 0, -6.0, -8.0)
    believe_in(scene, "1", 0.7 * x - 0.3 * 6.0, 0.7 * y - 0.3 * 8.0)
    assert tactics.open_point(scene.w, 0, 0, -6.0, -8.0) != (x, y)


def test_a_phantom_may_be_first_at_the_ball_and_comes_for_it():
    scene = Scene("1 . . . . o . . . . . . . . a", NARROW)
    scene.belief.cycle[0] = 20
    believe_in(scene, "1", 8.0, 0.0)
    assert fastest.fastest_opponent(scene.w, 0, 0).player == scene.ball + 1
    memory.roll_on(scene.w, 0, 0)
    assert scene.w.phantoms.position[0, 0, 0] == approx([7.7, 0.0])
    assert scene.seen("1", "a") == approx([14.0 - 0.25, 0.0])


def test_a_phantom_where_somebody_must_be_seen_is_forgotten():
    scene = Scene("1 . . . . . . . . . . . . . a", NARROW)
    believe_in(scene, "1", 6.0, 0.5)
    ghosts.remove_ghosts(scene.w, 0, 0)
    assert slots(scene, "1") == []


@pytest.mark.parametrize(("away", "left"), [(2.0, []), (2.6, [0])])
def test_an_opponent_seen_by_name_was_the_phantom_near_there(away, left):
    scene = Scene("1 . . . . a", NARROW)
    believe_in(scene, "1", 5.0 + away, 0.0, age=2)  # may have run 2.4 m
    ghosts.forget_double(scene.w, 0, 0, scene.index("a"))
    assert slots(scene, "1") == left


def test_a_new_episode_has_no_phantoms():
    scene = Scene("1 a", NARROW)
    believe_in(scene, "1", 3.0, 0.0)
    scene.draw(0.5)
    memory.forget(scene.w, 0, 0)
    assert slots(scene, "1") == []


# P: numbers of keepers from 0, of takers from 11; "?" is felt, who is left out is neither
@pytest.mark.parametrize(
    ("who", "named", "felt", "asked", "numbers"),
    [
        ("1", "", "a", "a", (1, 21)),  # whoever but itself
        ("1", "3", "2", "2", (1, 1)),  # nobody else comes before 3
        ("2", "3", "1", "1", (0, 1)),
        ("1", "2", "a", "a", (2, 21)),
        ("1", "a", "b", "b", (12, 21)),  # some taker after the first
        ("1", "b", "2", "2", (1, 11)),
        ("1", "", "23", "3", (2, 21)),
        ("1", "", "23", "2", (1, 20)),
        ("a", "13", "2", "2", (1, 1)),
        ("b", "3", "a", "a", (3, 21)),
        ("b", "123", "a", "a", (3, 21)),
    ],
)
def test_the_order_of_the_message_tells_who_may_be_felt(who, named, felt, asked, numbers):
    scene = Scene("1 2 3 a b", NARROW)
    scene.belief.age[:] = NEVER
    scene.w.scratch.felt[:] = math.nan
    for name in named:
        scene.belief.age[0, :, scene.index(name)] = 0
    for name in felt:
        scene.w.scratch.felt[scene.index(name)] = 0.0, 0.0, 1.0
    assert touch.possible_numbers(scene.w, 0, scene.index(who), scene.index(asked)) == numbers


def test_who_can_have_one_number_only_is_known_by_it():
    scene = Scene("2 . 1 . . . . . 3 . a", NARROW)
    scene.lose("2")
    scene.look("1")
    assert scene.seen("1", "2") == approx([-2.0, 0.0])
    assert scene.belief.age[0, 0, 1] == 0
    assert not scene.memory.nameless[0, 0, 1]


def test_who_must_be_a_taker_is_taken_for_no_team_mate():
    scene = Scene("b . 1 . . a . . . 2 .", NARROW)
    scene.put("2", -9.0, 0.0)
    expect(scene, "2", 0.5, 0.5, 4)
    scene.lose("b")
    scene.look("1")  # a is seen, so b must be a taker
    assert scene.belief.age[0, 0, 1] == 4
    assert scene.seen("1", "b") == approx([-2.0, 0.0])


def test_who_must_be_a_team_mate_is_taken_for_no_opponent():
    scene = Scene("1 . 2 . . . . . 3 . a", NARROW)
    scene.lose("1")
    scene.put("a", -9.0, 0.0)
    expect_of(scene, "2", "a", 0.5, 0.5, 4)
    scene.look("2")  # 3 is seen, so 1 must be a keeper
    assert scene.belief.age[0, 1, scene.index("a")] == 4
    assert scene.seen("2", "1") == approx([-2.0, 0.0])
    assert scene.memory.nameless[0, 1, 0]


def expect_of(scene: Scene, who: str, name: str, x: float, y: float, age: int) -> None:
    """Let a player expect another at a place, seen `age` cycles ago."""
    p, j = scene.index(who), scene.index(name)
    scene.belief.position[0, p, j] = x, y
    scene.belief.age[0, p, j] = age
