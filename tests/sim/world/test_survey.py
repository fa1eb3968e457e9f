"""What the server measures of all pairs at once is what it measures of each by itself."""

import math

import numpy as np
import pytest
from scenes import make_record

from keepaway_sim.task import Task
from keepaway_sim.world import survey
from keepaway_sim.world.config import noiseless, profile
from keepaway_sim.world.geometry import TWO_PI, length, quantize, wrap
from keepaway_sim.world.trigonometry import bearing

CONFIGS = {
    "rounded": profile(),
    "narrow": profile(visible_angle=90.0),
    "exact": noiseless(profile()),
}


def measured(w, p, o):
    """The rule for one pair, as it reads in the server: distance, direction and their change."""
    c, position, velocity = w.constants, w.truth.position[0], w.truth.velocity[0]
    x, y = position[o] - position[p]
    vx, vy = velocity[o] - velocity[p]
    distance = max(length(x, y), survey.NEAREST)
    dx, dy = x / distance, y / distance
    direction = wrap(bearing(dx, dy) - (w.truth.yaw[0, p] + w.belief.neck[0, p]))
    radial = quantize((vx * dx + vy * dy) / distance, c.change_step)
    turning = (dx * vy - dy * vx) / distance
    if c.change_step > 0.0:
        turning = quantize(turning, survey.DIRECTION_CHANGE_STEP)
    steps = round(direction / c.direction_step) if c.direction_step > 0.0 else round(direction)
    return distance, dx, dy, direction, steps, radial, turning


def random_scene(w, rng):
    """Anywhere, some of them at the same place or at rest."""
    w.truth.position[:] = rng.uniform(-15.0, 15.0, w.truth.position.shape)
    w.truth.velocity[:] = rng.uniform(-1.0, 1.0, w.truth.velocity.shape)
    w.truth.position[0, 1] = w.truth.position[0, 0]
    w.truth.velocity[0, rng.integers(w.num_players)] = 0.0
    w.truth.position[0, w.ball] = np.round(w.truth.position[0, w.ball])
    w.truth.yaw[:] = rng.uniform(-math.pi, math.pi, w.truth.yaw.shape)
    w.belief.neck[:] = rng.uniform(-0.25 * TWO_PI, 0.25 * TWO_PI, w.belief.neck.shape)
    w.memory.look_phase[:] = rng.integers(0, 3, w.memory.look_phase.shape)


@pytest.mark.parametrize("config", CONFIGS.values(), ids=CONFIGS)
@pytest.mark.parametrize("task", ["2v1", "3v2", "4v3", "5v4"])
def test_every_pair_is_measured_as_by_itself_to_the_last_bit(task, config):
    w, rng = make_record(Task.parse(task), config), np.random.default_rng(8)
    s = w.sights
    for _ in range(40):
        random_scene(w, rng)
        survey.survey(w, 0)
        for p in range(w.num_players):
            for o in range(w.ball + 1):
                if o == p or not survey.looks_now(w, 0, p):
                    continue
                k = s.first[p] + o
                found = s.distance, s.dx, s.dy, s.direction, s.steps, s.radial, s.turning
                assert tuple(row[k] for row in found) == measured(w, p, o)


@pytest.mark.parametrize("value", [0.5, 1.5, -0.5, -2.5, 0.49999999999999994, 1e9 + 0.5, -3e-300])
def test_whole_rounds_as_round_does(value):
    assert survey.whole(value) == round(value)
