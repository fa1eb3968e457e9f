"""The World: a field is its own whatever runs beside it, requests are checked, nothing explodes."""

import math
import pickle

import numpy as np
import pytest
from scenes import Scene

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import Action, Outcome, Task
from keepaway_sim.world.config import NEVER, Config, noiseless, profile
from keepaway_sim.world.constants import pack
from keepaway_sim.world.cycle import _goes_on_passing, is_legal
from keepaway_sim.world.physics import GRID
from keepaway_sim.world.world import World

approx = pytest.approx
HOLD, PASS, OPEN, GO, MARK = (int(action) for action in Action)


class Requests:
    """Random legal requests, and for each field the same ones wherever it lies."""

    def __init__(self, world: World, numbers: list[int]) -> None:
        self.world = world
        self._random = [np.random.default_rng([99, number]) for number in numbers]

    def draw(self) -> tuple[np.ndarray, np.ndarray]:
        """Action and target of every player of every field."""
        n, num = self.world.task.num_keepers, self.world.task.num_players
        u = np.stack([random.random((2, num)) for random in self._random])
        action = np.where(np.arange(num) < n, (u[:, 0] * 4).astype(int), 3 + (u[:, 0] > 0.7))
        target = (u[:, 1] * n).astype(int)
        own = target == np.arange(num)
        target[own] = (target[own] + 1) % n
        return action, target


def started(task: Task, config: Config, numbers: list[int]) -> World:
    """A world whose fields play trials with these numbers."""
    world = World(task, config, len(numbers))
    for field, number in enumerate(numbers):
        world.start(field, np.random.SeedSequence(7, spawn_key=(number, 0)))
    return world


def snapshot(world: World, field: int) -> list[np.ndarray]:
    """Everything that one field is, copied."""
    return [array[field].copy() for array in (*world.truth, *world.belief)]


def assert_same(one: list[np.ndarray], other: list[np.ndarray]) -> None:
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a, b)


CASES = [
    pytest.param(Task(3, 2), profile("2005"), id="3v2"),
    pytest.param(Task(4, 3, 30, 20), profile("v19"), id="4v3 v19"),
    pytest.param(Task(2, 1), profile("2005", visible_angle_deg=90.0), id="2v1 narrow"),
    pytest.param(Task(11, 11, 10, 10), profile("v19", visible_angle_deg=90.0), id="11v11 crowded"),
]


@pytest.mark.parametrize(("task", "config"), CASES)
def test_a_field_alone_is_that_field_among_many(task, config):
    numbers = [3, 14, 15, 9, 2, 6, 5, 35, 8, 97, 93, 23, 84, 62, 64, 33, 83, 27]
    many = started(task, config, numbers)
    requests = Requests(many, numbers)
    lone_fields = [0, 1, 7, 16, 17]
    alone = {field: started(task, config, [numbers[field]]) for field in lone_fields}
    lone_requests = {field: Requests(alone[field], [numbers[field]]) for field in lone_fields}
    for _ in range(200):
        many.step(*requests.draw())
        for field in lone_fields:
            alone[field].step(*lone_requests[field].draw())
            assert_same(snapshot(many, field), snapshot(alone[field], 0))
    assert many.belief.episode.max() > 0  # kick-offs were among them


def test_requests_may_be_any_arrays_of_whole_numbers_but_of_no_other_shape():
    plain, other = (started(Task(3, 2), profile("2005"), [1, 2]) for _ in range(2))
    requests = Requests(plain, [1, 2])
    for _ in range(50):
        action, target = requests.draw()
        plain.step(action, target)
        other.step(action.astype(np.int8), np.asfortranarray(target))
        assert_same(snapshot(plain, 1), snapshot(other, 1))
    for wrong in (action[:1], action.T, action.ravel(), action.astype(float)):
        with pytest.raises(KeepawayError, match=r"requests of shape .* numbers of shape .2, 5"):
            plain.step(wrong, target)
    assert_same(snapshot(plain, 0), snapshot(other, 0))


@pytest.mark.parametrize(("task", "config"), CASES[:2])
def test_positions_lie_on_a_grid_that_every_place_represents(task, config):
    world = started(task, config, list(range(40)))
    requests = Requests(world, list(range(40)))
    for _ in range(100):
        world.step(*requests.draw())
        for array in (world.truth.position, world.truth.velocity):
            np.testing.assert_array_equal(array * GRID, np.round(array * GRID))


def test_the_same_seed_gives_the_same_episodes_and_another_seed_others():
    snapshots = []
    for number in (1, 1, 2):
        world = started(Task(), profile("2005"), [number])
        requests = Requests(world, [number])
        for _ in range(150):
            world.step(*requests.draw())
        snapshots.append(snapshot(world, 0))
    assert_same(snapshots[0], snapshots[1])
    assert not np.array_equal(snapshots[0][0], snapshots[2][0])


def test_a_field_that_is_started_again_knows_nothing_of_before():
    world, fresh = (started(Task(), profile("2005", visible_angle_deg=90.0), [5]) for _ in range(2))
    requests = Requests(world, [5])
    for _ in range(90):
        world.step(*requests.draw())
    world.start(0, np.random.SeedSequence(7, spawn_key=(5, 0)))
    again, anew = Requests(world, [5]), Requests(fresh, [5])
    for _ in range(90):
        assert_same(snapshot(world, 0), snapshot(fresh, 0))
        world.step(*again.draw())
        fresh.step(*anew.draw())


def test_a_stopped_field_rests_while_others_play():
    world = started(Task(), profile("2005"), [1, 2])
    requests = Requests(world, [1, 2])
    world.stop(0)
    before = snapshot(world, 0)
    for _ in range(20):
        world.step(*requests.draw())
    assert_same(snapshot(world, 0), before)
    assert world.belief.cycle[1] == 20
    assert not world.belief.decision_due[0].any()


def test_an_aborted_episode_is_followed_by_the_next():
    world = started(Task(), profile("2005"), [1])
    requests = Requests(world, [1])
    world.step(*requests.draw())
    world.abort(0)
    assert world.belief.outcome[0] == Outcome.ABORTED
    assert not world.belief.decision_due.any()
    world.step(*requests.draw())
    assert (world.belief.episode[0], world.belief.cycle[0]) == (1, 0)
    assert world.belief.outcome[0] == Outcome.IN_PLAY


@pytest.mark.parametrize(
    ("player", "action", "target"),
    [
        (0, PASS, 0),  # to itself
        (0, PASS, 3),  # to a taker
        (0, PASS, -1),
        (1, MARK, 0),
        (3, HOLD, 0),
        (4, PASS, 0),
        (4, OPEN, 0),
        (4, MARK, 3),  # a taker marks keepers only
        (2, 5, 0),
        (2, -1, 0),
    ],
)
def test_an_illegal_request_is_refused_and_nothing_is_played(player, action, target):
    world = started(Task(), profile("2005"), [1, 2])
    actions, targets = Requests(world, [1, 2]).draw()
    actions[1, player], targets[1, player] = action, target
    before = [snapshot(world, field) for field in range(2)]
    with pytest.raises(KeepawayError) as refusal:
        world.step(actions, targets)
    name = world.task.player_names[player]
    for part in (f"{name} on field 1", f"action={action}", f"target={target}", "takers go"):
        assert part in str(refusal.value)
    for field in range(2):
        assert_same(snapshot(world, field), before[field])


def test_requests_count_only_where_a_decision_is_due():
    world = started(Task(), profile("2005"), [1])
    actions, targets = Requests(world, [1]).draw()
    world.abort(0)
    actions[:] = 77
    world.step(actions, targets)  # kicks off, whatever is asked for
    assert world.belief.cycle[0] == 0


@pytest.mark.parametrize("task", [Task(2, 1), Task(3, 2), Task(5, 4)])
def test_legal_requests_are_those_of_the_roles(task):
    c = pack(task, profile("2005"))
    legal = {
        (player, action, target)
        for player in range(task.num_players)
        for action in range(-1, 7)
        for target in range(-1, task.num_players + 1)
        if is_legal(c, player, action, target)
    }
    n, m, targets = task.num_keepers, task.num_takers, task.num_players + 2
    # hold, get open, go: whatever the target; pass: the other keepers. Go, and mark each keeper.
    assert len(legal) == n * (3 * targets + n - 1) + m * (targets + n)


@pytest.mark.parametrize(("num_fields", "field"), [(0, 0), (-3, 0), (2, 2), (2, -1)])
def test_fields_are_counted_from_nought(num_fields, field):
    with pytest.raises(KeepawayError, match=r"num_fields=|field="):
        World(Task(), profile("2005"), num_fields).start(field, np.random.SeedSequence(0))


def lay_out(world: World, places: list[tuple[float, float]]) -> None:
    """Put players and ball of field 0 where they are wanted, at rest."""
    world.truth.position[0] = places
    world.truth.velocity[0] = 0.0


def test_a_rolling_ball_slows_by_its_decay():
    world = started(Task(2, 1), noiseless(profile("2005")), [1])
    lay_out(world, [(-10, -10), (-10, 10), (10, 10), (-2, 0)])
    world.truth.velocity[0, 3] = 1.0, 0.0
    action = np.array([[OPEN, OPEN, GO]])
    for x, speed in ((-1.0, 0.94), (-0.06, 0.8836), (0.8236, 0.830584)):
        world.step(action, np.zeros_like(action))
        assert world.truth.position[0, 3] == approx([x, 0.0], abs=1e-8)
        assert world.truth.velocity[0, 3] == approx([speed, 0.0], abs=1e-8)


def test_kicks_of_several_players_add_up():
    # both hold the ball toward their own side: S adds their accelerations before limiting them
    world = started(Task(2, 1), noiseless(profile("2005")), [1])
    lay_out(world, [(0, 0), (-10, 10), (1.2, 0), (0.6, 0.3)])
    world.belief.body[0] = world.truth.yaw[0] = 0.0, 0.0, math.pi
    for player in range(3):
        world.belief.position[0, player] = world.truth.position[0]
        world.belief.velocity[0, player] = 0.0
        world.belief.age[0, player] = 0
    world.belief.ball_kickable[0] = [True, False, True]
    action = np.array([[HOLD, OPEN, GO]])
    world.step(action, np.zeros_like(action))
    commands = world.commands[0]
    assert commands[[0, 2], 0].tolist() == [3.0, 3.0]
    total = np.zeros(2)
    for player in (0, 2):
        rel = np.array([(0.6, 0.3), (-0.6, 0.3)][player // 2])
        yaw, distance = world.truth.yaw[0, player], np.linalg.norm(rel)
        off = abs(math.remainder(math.atan2(rel[1], rel[0]) - yaw, 2 * math.pi)) / math.pi
        rate = 0.027 * (1 - 0.25 * off - 0.25 * (distance - 0.385) / 0.7)
        angle = yaw + commands[player, 2]
        total += rate * commands[player, 1] * np.array([math.cos(angle), math.sin(angle)])
    assert np.linalg.norm(total) < 2.7
    assert world.truth.velocity[0, 3] == approx(0.94 * total, abs=1e-6)


def test_a_pass_goes_on_without_asking_until_the_ball_has_left():
    # P keeperWithBall: continuing a pass counts as the last action, however often
    world = started(Task(3, 1), noiseless(profile("2005")), [1])
    action = np.array([[PASS, OPEN, OPEN, GO]])
    for _ in range(3):
        see(world, [(0, 0), (10, 0), (0, 11), (12, 12), (-0.9, 0)])
        world.step(action, np.ones_like(action))  # the ball lies behind: it is set up first
        assert world.belief.ball_kickable[0, 0]
        assert world.belief.decision_due[0].tolist() == [False, True, True, True]
        action = np.array([[77, OPEN, OPEN, GO]])  # who answers all the same is not heard
    world.step(action, np.zeros_like(action))
    assert world.truth.action[0, 0] == PASS
    assert np.linalg.norm(world.truth.velocity[0, 4]) > 1.0
    assert world.belief.decision_due[0].all()


def test_a_pass_is_forgotten_where_somebody_is_lost_from_sight():
    scene = Scene("1 2 o a")
    scene.put("o", 0.5, 0.0)
    scene.belief.cycle[0] = 20
    for passed, lost, goes_on in ((19, 12, True), (18, 12, False), (19, 13, False)):
        scene.memory.pass_cycle[0, 0] = passed
        scene.lose("2", lost)
        assert _goes_on_passing(scene.w, 0, 0) == goes_on


@pytest.mark.parametrize(("by_rank", "receiver"), [(True, 2), (False, 1)])
def test_a_pass_in_two_kicks_goes_to_the_keeper_that_is_of_that_rank_then(by_rank, receiver):
    world = started(Task(3, 1), noiseless(profile("2005", pass_by_rank=by_rank)), [1])
    see(world, [(0, 0), (10, 0), (0, 11), (12, 12), (-0.9, 0)])
    action = np.array([[PASS, OPEN, OPEN, GO]])
    world.step(action, np.ones_like(action))  # to keeper 1, the closest
    world.belief.position[0, 0, 2] = 0.0, 9.0  # now keeper 2 is
    world.step(action, np.ones_like(action))
    assert world.truth.target[0, 0] == receiver


def see(world: World, places: list[tuple[float, float]]) -> None:
    """Lay out field 0, everybody facing +x, and let everybody know all of it."""
    lay_out(world, places)
    world.truth.yaw[0] = 0.0
    world.belief.body[0] = 0.0
    world.belief.position[0] = places
    world.belief.velocity[0] = 0.0
    world.belief.age[0] = 0
    away = np.linalg.norm(world.truth.position[0, :-1] - world.truth.position[0, -1], axis=1)
    world.belief.ball_kickable[0] = away < 1.085


def test_the_ball_is_taken_in_the_fifth_cycle_with_a_taker_near():
    world = started(Task(2, 1), noiseless(profile("2005")), [1])
    see(world, [(-9, 0), (-9, 9), (0, 0), (0.5, 0)])  # the taker holds it, keepers are far
    action = np.array([[OPEN, OPEN, GO]])
    counts = []
    while world.belief.outcome[0] == Outcome.IN_PLAY:
        world.step(action, np.zeros_like(action))
        counts.append(int(world.truth.take_count[0]))
    assert counts == [1, 2, 3, 4, 4]
    assert world.belief.outcome[0] == Outcome.TAKEN_AWAY


def test_a_ball_that_is_taken_may_still_leave_the_field():
    world = started(Task(2, 1), noiseless(profile("2005")), [1])
    see(world, [(-9, 0), (-9, 9), (11, 0), (12.4, 0)])
    world.truth.velocity[0, 3] = 0.5, 0.0
    world.truth.take_count[0] = 4
    action = np.array([[OPEN, OPEN, GO]])
    world.step(action, np.zeros_like(action))
    assert world.belief.outcome[0] == Outcome.OUT_OF_BOUNDS


def test_no_taker_stays_for_ever_where_it_cannot_dash_backward():
    # v19: both takers have the ball 1.3 m behind them, and its keeper holds it there
    world = started(Task(), profile("v19"), [1])
    places = [(-8.7, 7.8), (-7.7, -8.6), (6.49, 5.46), (7.42, 6.41), (6.99, 5.79), (5.65, 5.62)]
    see(world, places)
    world.truth.yaw[0] = 0.0, 0.0, 1.81, 0.34, -0.19
    world.belief.body[0] = world.truth.yaw[0]
    action = np.array([[OPEN, OPEN, HOLD, GO, GO]])
    for _ in range(300):
        world.step(action, np.zeros_like(action))
        if world.belief.outcome[0] != Outcome.IN_PLAY:
            break
    assert world.belief.outcome[0] != Outcome.IN_PLAY


def play(config: Config, numbers: list[int], cycles: int = 60) -> World:
    """A world after some cycles of hold and get open, the same for all fields."""
    world = started(Task(), config, numbers)
    action = np.tile([HOLD, OPEN, OPEN, GO, GO], (len(numbers), 1))
    for _ in range(cycles):
        world.step(action, np.zeros_like(action))
    return world


def test_without_noise_nothing_is_drawn_between_kick_offs():
    world = started(Task(), noiseless(profile("v19", hearing=False)), [1])
    action = np.array([[GO, GO, OPEN, GO, GO]])
    drawn = world._streams.draws.cursor.copy()
    for _ in range(10):
        world.step(action, np.zeros_like(action))
    assert world.belief.cycle[0] == 10
    np.testing.assert_array_equal(world._streams.draws.cursor, drawn)


@pytest.mark.parametrize(
    "switch",
    [
        {"movement_noise": False},
        {"turn_noise": False},
        {"kick_rand": 0.0},
        {"quantize_step": 0.0},
        {"direction_step": 0.0},
        {"change_step": 0.0},
        {"speed_step": 0.0},
        {"self_position_error": 0.0},
        {"self_yaw_error": 0.0},
        {"hearing": False},
        {"whole_commands": False},
        {"visible_angle_deg": 90.0},
    ],
    ids=lambda switch: next(iter(switch)),
)
def test_every_switch_makes_a_difference(switch):
    with_it = play(profile("v19"), [1, 2, 3])
    without = play(profile("v19", **switch), [1, 2, 3])
    assert not np.array_equal(with_it.truth.position, without.truth.position)


def test_an_exact_view_is_the_truth():
    world = started(Task(4, 3), noiseless(profile("2005", look_period=1)), [1])
    requests = Requests(world, [1])
    for _ in range(120):
        world.step(*requests.draw())
        s = world.belief
        if s.outcome[0] != Outcome.IN_PLAY:
            continue
        assert not s.age[0].any()
        truth = np.broadcast_to(world.truth.position[0], s.position[0].shape)
        np.testing.assert_allclose(s.position[0], truth, atol=1e-8)


@pytest.mark.parametrize(("task", "config"), CASES)
def test_a_field_goes_on_from_a_snapshot_as_it_went_on_then(task, config):
    world = started(task, config, [1, 2, 3])
    requests = Requests(world, [1, 2, 3])
    for _ in range(50):
        world.step(*requests.draw())
    kept = pickle.loads(pickle.dumps(world.snapshot(1)))
    further = [requests.draw() for _ in range(150)]
    for action, target in further:
        world.step(action, target)
    expected = snapshot(world, 1)
    elsewhere = started(task, config, [9, 8, 7])  # another World, another place in it
    elsewhere.step(*Requests(elsewhere, [9, 8, 7]).draw())
    for other, field in ((world, 1), (world, 2), (elsewhere, 0)):
        other.restore(field, kept)
        only = np.arange(3) == field
        for action, target in further:
            shift = field - 1  # the requests of field 1 to the field that takes its part
            other.step(np.roll(action, shift, 0), np.roll(target, shift, 0), only)
        assert_same(snapshot(other, field), expected)


def test_pymunk_is_asked_of_few_fields_only():
    world = started(Task(3, 2), profile("2005"), list(range(32)))
    requests, asked = Requests(world, list(range(32))), []
    for _ in range(100):
        world.step(*requests.draw())
        asked.append(int(world.fields.bodies.num_asked[0]))
    assert 0 < np.mean(asked) < 16


def test_fields_that_do_not_play_stand_still():
    world = started(Task(3, 2), profile("v19"), [1, 2])
    requests = Requests(world, [1, 2])
    before = snapshot(world, 1)
    for _ in range(30):
        world.step(*requests.draw(), playing=np.array([True, False]))
    assert_same(snapshot(world, 1), before)
    assert world.truth.time.tolist() == [30, 0]


def test_requests_on_fields_that_do_not_play_are_not_looked_at():
    world = started(Task(3, 2), profile("2005"), [1, 2])
    action, target = Requests(world, [1, 2]).draw()
    action[1] = 77
    world.step(action, target, playing=np.array([True, False]))
    with pytest.raises(KeepawayError, match="keeper_1 on field 1 cannot carry out action=77"):
        world.step(action, target)


def test_a_snapshot_of_another_world_is_refused():
    kept = started(Task(3, 2), profile("2005"), [1]).snapshot(0)
    for other in (World(Task(3, 2), profile("v19")), World(Task(4, 3), profile("2005"))):
        with pytest.raises(KeepawayError, match="a snapshot of another world"):
            other.restore(0, kept)
    with pytest.raises(KeepawayError, match=r"this world has fields 0\.\.0"):
        World(Task(3, 2), profile("2005")).snapshot(1)


def check_limits(world: World) -> None:
    """All that must hold of any field in any cycle."""
    state, s, c = world.truth, world.belief, pack(world.task, world.config)
    half = np.array([c.field_length, c.field_width]) / 2
    playing = s.outcome == Outcome.IN_PLAY
    for array in (*state, *s):
        if array.dtype == np.float64:
            assert np.isfinite(array).all()
    speed = np.linalg.norm(state.velocity, axis=2)
    assert speed[:, :-1].max() <= c.player_speed_max * (1 + c.player_rand) * c.player_decay + 1e-6
    assert speed[:, -1].max() <= c.ball_speed_max * (1 + c.ball_rand) * c.ball_decay + 1e-6
    assert (np.abs(state.position[playing, -1]) < half).all()
    assert (np.abs(state.position[:, :-1]) < half + 15.0).all()  # nobody runs away
    assert np.abs(state.yaw).max() <= math.pi
    assert np.abs(s.neck).max() <= math.pi / 2
    assert s.age.min() >= 0
    assert s.age.max() <= NEVER
    assert np.isin(s.outcome, [Outcome.IN_PLAY, Outcome.TAKEN_AWAY, Outcome.OUT_OF_BOUNDS]).all()
    assert (state.take_count[playing] <= 4).all()
    assert (state.take_count[s.outcome == Outcome.TAKEN_AWAY] == 4).all()
    assert not s.decision_due[~playing].any()


@pytest.mark.parametrize(
    ("task", "config", "steps"),
    [
        pytest.param(Task(3, 2), profile("2005"), 1600, id="3v2 2005"),
        pytest.param(
            Task(3, 2, 20, 20), profile("v19", visible_angle_deg=90.0), 1600, id="3v2 v19"
        ),
        pytest.param(Task(4, 3), profile("v19"), 600, id="4v3 v19"),
        pytest.param(Task(2, 1, 100, 10), profile("2005"), 100, id="2v1 long"),
        pytest.param(Task(11, 11, 10, 10), profile("2005", visible_angle_deg=45.0), 40, id="11v11"),
    ],
)
def test_a_million_random_cycles_stay_finite_and_within_limits(task, config, steps):
    num_fields = 256
    world = started(task, config, list(range(num_fields)))
    random = np.random.default_rng(3)
    n, num = task.num_keepers, task.num_players
    keeps = np.arange(num) < n
    for step in range(steps):
        u = random.random((2, num_fields, num))
        target = (u[1] * n).astype(np.int64)
        target = np.where(target == np.arange(num), (target + 1) % n, target)
        action = np.where(keeps, (u[0] * 4).astype(np.int64), 3 + (u[0] > 0.7))
        world.step(action, target)
        if step % 2 == 0 or step < 100:
            check_limits(world)
    assert world.truth.time.sum() == num_fields * steps
    assert world.belief.episode.min() >= 0
    assert world.belief.episode.max() > 1
