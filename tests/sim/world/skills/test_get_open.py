"""Where a keeper gets open, worked out for all points at once: what the rule says of each."""

import math

import numpy as np
import pytest
from scenes import make_record

from keepaway_sim.task import Task
from keepaway_sim.world.config import NEVER, profile
from keepaway_sim.world.geometry import cone_contains
from keepaway_sim.world.skills.tactics import open_point

CONFIGS = {"all round": profile(), "narrow": profile(visible_angle=90.0)}


def known(w, p):
    """Places of those whom player p knows: of all others, and of opponents, phantoms included."""
    c, n = w.constants, w.constants.num_keepers
    ages, places = w.belief.age[0, p], w.belief.position[0, p]
    seen = [j for j in range(w.num_players) if j != p and ages[j] <= c.player_lost_age]
    phantoms = [
        place
        for place, age in zip(w.phantoms.position[0, p], w.phantoms.age[0, p], strict=True)
        if age <= c.player_lost_age
    ]
    opponents = [places[j] for j in seen if (j < n) != (p < n)]
    return [*(places[j] for j in seen), *phantoms], [*opponents, *phantoms]


def by_the_rule(w, p, start):
    """P getOpenForPassFromInRectangle: the least crowded point whose lane nobody bars."""
    task, border = Task(w.constants.num_keepers, w.constants.num_takers), w.constants.open_border
    share = [k * (1.0 - 2.0 * border) / 4.0 for k in (-2, -1, 0, 1, 2)]
    points = [(task.field_length * a, -task.field_width * b) for a in share for b in share]
    others, opponents = known(w, p)
    crowd = {point: sum(1.0 / math.dist(point, other) for other in others) for point in points}
    for point in sorted(points, key=crowd.__getitem__):
        if not any(
            cone_contains(*one, *start, *point, w.constants.cone_width) for one in opponents
        ):
            return point
    return 0.0, 0.0


def random_scene(w, rng):
    w.belief.position[:] = rng.uniform(-14.0, 14.0, w.belief.position.shape)
    w.belief.age[:] = rng.choice([0, 3, NEVER], w.belief.age.shape, p=[0.5, 0.3, 0.2])
    w.phantoms.position[:] = rng.uniform(-14.0, 14.0, w.phantoms.position.shape)
    w.phantoms.age[:] = rng.choice([1, NEVER], w.phantoms.age.shape, p=[0.1, 0.9])


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
@pytest.mark.parametrize("task", ["3v2", "4v3", "5v4"])
def test_the_point_is_that_of_the_rule(task, config):
    w, rng = make_record(Task.parse(task), config), np.random.default_rng(5)
    found = set()
    for _ in range(60):
        random_scene(w, rng)
        for p in range(w.constants.num_keepers):
            start = rng.uniform(-12.0, 12.0, 2)
            point = open_point(w, 0, p, *start)
            assert point == pytest.approx(by_the_rule(w, p, start), abs=1e-5)
            found.add(point)
    assert len(found) > 5


def test_it_is_the_centre_where_one_taker_bars_every_lane():
    w = make_record(Task.parse("3v2"), profile())
    w.belief.age[:] = 0
    w.belief.position[0, 0] = 13.0
    w.belief.position[0, 0, 3] = -99.0, 0.0
    assert open_point(w, 0, 0, -100.0, 0.0) == (0.0, 0.0)
