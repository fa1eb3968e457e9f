"""Who reaches the ball first (P: createInterceptFeatures, predictNrCyclesToPoint)."""

import numpy as np
import pytest
from scenes import Scene

from keepaway_sim.world.config import NEVER
from keepaway_sim.world.skills import fastest, prediction
from keepaway_sim.world.skills.prediction import ball_of


def fastest_of(scene: Scene, name: str, first: int, last: int) -> tuple[int, int, int]:
    p = scene.index(name)
    ball = ball_of(scene.w, 0, p)
    player, when, needed = fastest.fastest_to_ball(scene.w, 0, p, first, last, ball, 59)
    return int(player), int(when), int(needed)


def fastest_keeper(scene: Scene, p: int) -> tuple[int, int]:
    player, cycles = fastest.fastest_keeper(scene.w, 0, p, fastest.nobody_asked())
    return int(player), int(cycles)


def scattered(random: np.random.Generator) -> Scene:
    """3v2 anywhere, the ball rolling; some players have not been seen for a while."""
    scene = Scene("1 2 3 . a b . o")
    scene.belief.cycle[0] = 40
    for name in ("1", "2", "3", "a", "b"):
        scene.put(name, *random.uniform(-12.0, 12.0, 2))
        scene.face(name, random.uniform(-180.0, 180.0))
    scene.put("o", *random.uniform(-12.0, 12.0, 2))
    scene.move("o", *random.uniform(-1.5, 1.5, 2))
    for name in ("2", "3", "a", "b"):
        scene.lose(name, int(random.choice([0, 0, 1, 3, 5, 13])))
    return scene


def test_who_is_fastest_is_who_a_search_over_all_players_and_cycles_finds():
    random = np.random.default_rng(5)
    for _ in range(300):
        scene = scattered(random)
        ball = ball_of(scene.w, 0, 0)
        soonest = []
        for j in range(5):
            if j > 0 and scene.belief.age[0, 0, j] > scene.c.player_lost_age:
                continue
            body, lead = fastest.as_last_seen(scene.w, 0, 0, j)
            for i in range(60):
                to = prediction.ball_ahead(scene.c, ball, i)
                needed = max(prediction.cycles_to_point(scene.c, body, *to) - lead, 0)
                if needed <= i:
                    soonest.append((i, needed, j))
                    break
        player, when, needed = fastest_of(scene, "1", 0, 5)
        assert (when, needed, player) == min(soonest, default=(60, NEVER, -1))


def test_the_keeper_is_the_same_whether_the_opponents_were_asked_before_or_not():
    random = np.random.default_rng(6)
    for _ in range(300):
        scene = scattered(random)
        for p in range(5):
            chase = fastest.fastest_opponent(scene.w, 0, p)
            asked = fastest.fastest_keeper(scene.w, 0, p, chase)
            assert asked == fastest.fastest_keeper(scene.w, 0, p, fastest.nobody_asked())


def test_what_was_worked_out_for_another_ball_or_without_an_opponent_does_not_count():
    scene = Scene("1 . . . o . . . . . 2\n. . . . . . a . . . .")
    chase = fastest.fastest_opponent(scene.w, 0, 0)
    scene.move("o", 1.0, 0.0)
    asked = fastest.fastest_keeper(scene.w, 0, 0, chase)
    assert asked == fastest.fastest_keeper(scene.w, 0, 0, fastest.nobody_asked())
    scene.lose("a", 13)
    chase = fastest.fastest_opponent(scene.w, 0, 0)
    scene.lose("a", 0)
    asked = fastest.fastest_keeper(scene.w, 0, 0, chase)
    assert asked == fastest.fastest_keeper(scene.w, 0, 0, fastest.nobody_asked())


def test_who_reaches_the_ball_first_is_the_fastest():
    scene = Scene("1 . . . . . . . o . . . . . 2")  # both face +x: 2 has to turn, but is nearer
    assert fastest_of(scene, "1", 0, 2)[0] == 1
    scene.move("o", -1.5, 0.0)
    assert fastest_of(scene, "1", 0, 2)[0] == 0


def test_equally_fast_players_leave_it_to_the_first():
    scene = Scene("1 . . . . . . . . .\n. . . . o . . . . .\n2 . . . . . . . . .")
    assert fastest_of(scene, "2", 0, 2)[0] == 0


def test_unknown_players_are_left_out_but_not_oneself():
    scene = Scene("1 . . . . . o . . 2")
    scene.lose("2", 13)
    assert fastest_of(scene, "1", 0, 2)[0] == 0
    assert fastest_of(scene, "2", 1, 2)[0] == 1
    scene.lose("1", 13)
    assert fastest_of(scene, "2", 0, 1) == (-1, 60, NEVER)


def test_who_was_seen_a_while_ago_has_been_on_its_way_since():
    scene = Scene("1 . . . . . . . . o")
    scene.belief.cycle[0] = 20
    scene.believe()
    scene.put("2", 18.0, 0.0)
    scene.face("2", 180.0)
    scene.belief.age[0, :, 1] = 0
    assert [fastest_of(scene, name, 0, 2)[0] for name in "12"] == [0, 0]
    seen, needed = fastest_of(scene, "1", 1, 2)[1:]
    for ago in (1, 2, 3):
        scene.lose("2", ago)
        assert fastest_of(scene, "1", 1, 2)[1:] == (seen - ago, needed - ago)
    assert fastest_of(scene, "1", 0, 2)[0] == 1
    assert fastest_of(scene, "2", 0, 2)[0] == 0  # it knows itself better


@pytest.mark.parametrize(("seen_ago", "start"), [(4, 2), (9, 2)])
def test_an_opponent_not_seen_moving_lately_has_a_start(seen_ago, start):
    scene = Scene("1 . . . . . . . . o . . a\n2 . . . . . . . . . . . .")
    scene.belief.cycle[0] = 20
    scene.believe()
    scene.lose("a", seen_ago)
    scene.lose("2", seen_ago)
    body, lead = fastest.as_last_seen(scene.w, 0, 0, scene.index("a"))
    assert (body.ux, body.uy, lead) == (0.0, 0.0, start)
    scene.memory.seen_cycle[0, 0, scene.index("a")] = 20  # it is felt now
    assert fastest.as_last_seen(scene.w, 0, 0, scene.index("a"))[1] == 0
    assert fastest.as_last_seen(scene.w, 0, 0, scene.index("2"))[1] == 0  # no team-mate has


def test_where_a_taker_is_sooner_the_keeper_nearest_to_its_meeting_point_goes():
    # The ball rolls from a's side toward 2. Without a, 2 waits for it and 1 is slower. But a takes
    # it at once, near 1, so 1 is who must go there.
    scene = Scene(
        """
        . . . . . . . . . . . . . . . . . . 2
        . . . a o . . . . . . . . . . . . . .
        . . . . 1 . . . . . . . . . . . . . .
        """
    )
    scene.put("1", 4.0, -3.0)
    scene.move("o", 2.5, 0.0)
    scene.face("2", 180.0)
    assert fastest_keeper(scene, 1)[0] == 0
    scene.lose("a", 13)
    assert fastest_keeper(scene, 1)[0] == 1


def test_takers_ask_only_who_of_the_keepers_is_first():
    scene = Scene("1 . . . . . o a . . . . 2")
    keeper, cycles = fastest_keeper(scene, scene.index("a"))
    assert keeper in (0, 1)
    assert cycles > 0
