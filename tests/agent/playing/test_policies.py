"""What players ask for: the rules of the facts, each on a scene one can check by eye."""

import math

import numpy as np
import pytest

from keepaway_agent.actions import NO_TARGET, UNREACHABLE, Action, Outcome, Role
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.cmac import make_tiling
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.learning.sarsa import NO_ACTION, make_learners
from keepaway_agent.playing import policies
from keepaway_agent.playing.policies import View, keeper_decision, make_player, taker_decision

HALVES = np.array([0.5, 0.5, 0.5])


def make_view(scene, **changes):
    parts = {
        "position": scene.position,
        "age": scene.age,
        "cycles_to_ball": scene.cycles_to_ball,
        "ball_kickable": True,
        "cycle": 0,
    }
    return View(**(parts | changes))


def keepers(num_keepers=3, num_takers=2, **settings):
    tiling = make_tiling(Role.KEEPER, num_keepers, num_takers)
    return make_learners(1, num_keepers, tiling, SarsaConfig(**settings))


def takers(num_keepers=3, num_takers=2, **settings):
    tiling = make_tiling(Role.TAKER, num_keepers, num_takers)
    return make_learners(1, num_keepers, tiling, SarsaConfig(**settings))


def ask_keeper(view, policy, own=0, uniforms=HALVES, learners=None):
    learners = learners or keepers()
    player = make_player(own, 3, policy)
    return keeper_decision(learners, 0, player, view, uniforms, np.zeros(5, dtype=np.int64))


def ask_taker(view, policy, own, learners, num_keepers=3, uniforms=HALVES, interval=5):
    player = make_player(own, num_keepers, policy, interval=interval)
    order = np.zeros(len(view.age) - 1, dtype=np.int64)
    return taker_decision(learners, 0, player, view, uniforms, order)


# Keepers without the ball


@pytest.mark.parametrize(
    ("cycles", "going"),
    [
        ([4, 9, 20], 0),
        ([9, 4, 20], 1),
        ([9, 4, 4], 1),  # equally fast: the first goes
        ([UNREACHABLE, 7, UNREACHABLE], 1),
        ([UNREACHABLE] * 3, 0),
    ],
)
@pytest.mark.parametrize("policy", ["random", "hold", "hand", "learn", "greedy"])
def test_without_the_ball_the_fastest_goes_for_it_and_the_others_get_open(
    scene, policy, cycles, going
):
    scene.cycles_to_ball[:3] = cycles
    view = make_view(scene, ball_kickable=False)
    asked = [ask_keeper(view, policy, own) for own in range(3)]
    for own, answer in enumerate(asked):
        wanted = Action.GO_TO_BALL if own == going else Action.GET_OPEN
        assert answer == (wanted, NO_TARGET, False)


# Keepers with the ball


def test_a_keeper_that_lost_sight_of_somebody_holds_without_asking_its_policy(scene):
    learners = keepers()
    for player in range(5):
        scene.age[:] = 0
        scene.age[player] = 13
        answer = ask_keeper(make_view(scene), "learn", learners=learners)
        assert answer == (Action.HOLD_BALL, NO_TARGET, False)
    assert learners.action[0] == NO_ACTION
    scene.age[:] = 12
    assert ask_keeper(make_view(scene), "learn", learners=learners)[2]


def test_the_ball_itself_may_be_out_of_sight(scene):
    scene.age[5] = 13
    assert ask_keeper(make_view(scene), "hold") == (Action.HOLD_BALL, NO_TARGET, True)


def test_always_hold_holds(scene):
    assert ask_keeper(make_view(scene), "hold") == (Action.HOLD_BALL, NO_TARGET, True)


def test_random_chooses_evenly_and_passes_to_the_keeper_at_that_rank(scene):
    scene.position[[1, 2]] = scene.position[[2, 1]]  # now the nearer mate is keeper 2
    view = make_view(scene)
    uniforms = ((0.5, u, 0.5) for u in (0.0, 0.33, 0.34, 0.66, 0.67, 0.999))
    asked = [ask_keeper(view, "random", uniforms=np.array(triple)) for triple in uniforms]
    hold = (Action.HOLD_BALL, NO_TARGET, True)
    to_k2, to_k3 = (Action.PASS_BALL, 2, True), (Action.PASS_BALL, 1, True)
    assert asked == [hold, hold, to_k2, to_k2, to_k3, to_k3]


def test_the_hand_coded_keeper_by_hand(scene):
    # T1 4 m away. K2: 4 * sqrt(17) + 53.1 = 69.6; K3: 4 * sqrt(128) + 59.5 = 104.7 > 90
    assert ask_keeper(make_view(scene), "hand") == (Action.PASS_BALL, 2, True)
    scene.position[2] = (-12, -3)  # K3: 4 * sqrt(73) + 36.9 = 71.0 < 90
    assert ask_keeper(make_view(scene), "hand") == (Action.HOLD_BALL, NO_TARGET, True)
    scene.position[3] = (0, 2.01)  # T1 is 5.01 m away: it holds whatever the lanes are like
    scene.position[4] = (0, -9)
    scene.position[2] = (-12, 2)
    assert ask_keeper(make_view(scene), "hand") == (Action.HOLD_BALL, NO_TARGET, True)


def test_the_hand_coded_keeper_takes_the_first_of_equal_lanes():
    distances, angle = [9.0, 9.0], math.radians(80.0)
    state = np.array([0.0] * 3 + [4.0, 4.0] + [0.0] * 4 + distances + [angle, angle])
    assert policies.hand_coded_keeper(state, 3) == 1
    state[-3:-1] = 9.0, math.radians(54.0)  # K2: 4 * 9 + 54 = 90, no more than holding
    state[-1] = 0.0
    assert policies.hand_coded_keeper(state, 3) == 0


def test_a_greedy_keeper_does_what_it_values_most_and_learns_nothing(scene):
    learners = keepers(epsilon=1.0)
    learners.weights[0, 2] = 0.01
    before = learners.weights.copy()
    for cycle in (0, 5):
        answer = ask_keeper(make_view(scene, cycle=cycle), "greedy", learners=learners)
        assert answer == (Action.PASS_BALL, 2, True)
    policies.end_episode(learners, 0, make_player(0, 3, "greedy"), 9, Outcome.TAKEN_AWAY)
    np.testing.assert_array_equal(learners.weights, before)


def test_a_learning_keeper_is_paid_one_for_every_cycle(scene):
    learners = keepers(alpha=1.0, epsilon=0.0)
    player = make_player(0, 3, "learn")
    for cycle in (3, 10):
        ask_keeper(make_view(scene, cycle=cycle), "learn", learners=learners)
    assert learners.weights.sum() == pytest.approx(7)
    learners.weights[:] = 0
    learners.value[0] = 0
    policies.end_episode(learners, 0, player, 12, Outcome.OUT_OF_BOUNDS)
    assert learners.weights.sum() == pytest.approx(2)


def test_an_aborted_episode_teaches_nothing(scene):
    learners = keepers()
    ask_keeper(make_view(scene), "learn", learners=learners)
    player = make_player(0, 3, "learn")
    policies.end_episode(learners, 0, player, 50, Outcome.ABORTED)
    policies.end_episode(learners, 0, player, 50, Outcome.TAKEN_AWAY)
    assert not learners.weights.any()


def test_untrained_learners_choose_each_action_equally_often(scene):
    rng = np.random.default_rng(1)
    learners = keepers(epsilon=0.0)
    view = make_view(scene)
    passes = [
        ask_keeper(view, "greedy", uniforms=rng.random(3), learners=learners)[1] for _ in range(900)
    ]
    counts = np.bincount(passes, minlength=3)  # 0 stands for hold
    assert counts.min() > 240


# Takers: four keepers, three takers
#
#      K1 (0, 8)     T0 (1, 1)
#      K0 (0, 0) with the ball        K2 (8, 0)
#      T1 (-2, 0)    T2 (5, 5)
#      K3 (0, -8)


@pytest.fixture
def four_v_three(scene):
    position = [(0, 0), (0, 8), (8, 0), (0, -8), (1, 1), (-2, 0), (5, 5), (0.3, 0)]
    scene.position = np.array(position, dtype=float)
    scene.age = np.zeros(8, dtype=np.int32)
    scene.cycles_to_ball = np.full(7, UNREACHABLE)
    return make_view(scene, ball_kickable=False)


def test_the_two_takers_nearest_to_the_ball_chase_it(four_v_three):
    learners = takers(4, 3)
    for own in (4, 5):
        answer = ask_taker(four_v_three, "hand", own, learners, num_keepers=4)
        assert answer == (Action.GO_TO_BALL, NO_TARGET, False)


def marked_by(view, taker):
    """Whom a taker of four_v_three marks; -1: it goes to the ball."""
    action, target, _ = ask_taker(view, "hand", taker, takers(4, 3), num_keepers=4)
    return target if action == Action.MARK_KEEPER else -1


def test_the_third_taker_marks_the_keeper_with_the_fewest_takers_in_its_lane(four_v_three):
    # UT Austin's BasicPlayer.cc markMostOpenOpponent: nobody is in the lane to the holder himself
    assert marked_by(four_v_three, 6) == 0
    four_v_three.age[0] = 13  # the holder is out of sight; lanes still begin where he was
    lanes = [
        [policies.in_lane(four_v_three.position, 0, keeper, taker) for taker in (4, 5, 6)]
        for keeper in (1, 2, 3)
    ]
    assert not np.any(lanes)
    assert marked_by(four_v_three, 6) == 1
    four_v_three.position[4] = (0.2, 1)  # T0 into the lane to K1
    assert marked_by(four_v_three, 6) == 2
    four_v_three.age[2] = 13
    assert marked_by(four_v_three, 6) == 3


def test_while_the_ball_flies_the_lanes_begin_at_its_receiver(four_v_three):
    # P: at the opponent fastest to the ball. From K2, T0 is in the lane to K0, T2 in that to K1.
    four_v_three.cycles_to_ball[2] = 3
    assert marked_by(four_v_three, 6) == 2
    four_v_three.age[2] = 13
    assert marked_by(four_v_three, 6) == 3


def test_where_a_taker_is_out_of_sight_the_first_two_of_the_team_chase(four_v_three):
    # P sortClosestTo sorts nothing where somebody is unknown
    four_v_three.age[4] = 13
    four_v_three.position[6] = (0.5, 0.0)  # T2 is nearest
    assert [marked_by(four_v_three, taker) for taker in (4, 5, 6)] == [-1, -1, 0]


def test_a_taker_that_sees_no_keeper_goes_to_the_ball(four_v_three):
    four_v_three.age[:4] = 13
    answer = ask_taker(four_v_three, "hand", 6, takers(4, 3), num_keepers=4)
    assert answer == (Action.GO_TO_BALL, NO_TARGET, False)


@pytest.mark.parametrize("distance", [0.2, 3.0, 30.0])
def test_two_takers_always_chase(scene, distance):
    scene.position[4] = (distance, 0)
    for own in (3, 4):
        answer = ask_taker(make_view(scene, ball_kickable=False), "hand", own, takers())
        assert answer[0] == Action.GO_TO_BALL


@pytest.mark.parametrize(
    ("player", "inside"),
    [
        ((5, 1.4), True),
        ((5, 1.6), False),  # off the line by 0.32 of the way along it
        ((-1, 0), False),  # behind the start
        ((10.1, 0), False),  # beyond the goal
        ((9.9, 1.5), False),  # further from the start than the goal
    ],
)
def test_a_pass_lane_is_a_cone(player, inside):
    position = np.array([(0, 0), (10, 0), player], dtype=float)
    assert policies.in_lane(position, 0, 1, 2) == inside
    assert not policies.in_lane(position, 0, 0, 2)


def test_a_learning_taker_keeps_to_its_choice_until_the_interval_is_over(scene):
    learners = takers(epsilon=0.0)
    learners.weights[0, 2] = 0.01  # it prefers to mark K3, which is keeper 2
    answers = [
        ask_taker(make_view(scene, ball_kickable=False, cycle=cycle), "learn", 4, learners)
        for cycle in range(11)
    ]
    assert {answer[:2] for answer in answers} == {(Action.MARK_KEEPER, 2)}
    assert [cycle for cycle, answer in enumerate(answers) if answer[2]] == [0, 5, 10]


def test_a_marking_taker_sticks_to_the_player_not_to_the_rank(scene):
    learners = takers(epsilon=0.0)
    learners.weights[0, 1] = 0.01
    view = make_view(scene, ball_kickable=False)
    assert ask_taker(view, "learn", 4, learners) == (Action.MARK_KEEPER, 1, True)
    scene.position[[1, 2]] = scene.position[[2, 1]]  # K2 and K3 have changed places
    view = make_view(scene, ball_kickable=False, cycle=4)
    assert ask_taker(view, "learn", 4, learners) == (Action.MARK_KEEPER, 1, False)
    view = make_view(scene, ball_kickable=False, cycle=5)
    assert ask_taker(view, "greedy", 4, learners) == (Action.MARK_KEEPER, 2, True)


def test_a_learning_taker_pays_one_for_every_cycle(scene):
    learners = takers(alpha=1.0, epsilon=0.0)
    for cycle in (0, 5):
        view = make_view(scene, ball_kickable=False, cycle=cycle)
        ask_taker(view, "learn", 4, learners)
    assert learners.weights.sum() == pytest.approx(-5)
    learners.weights[:] = 0
    learners.value[0] = 0
    policies.end_episode(learners, 0, make_player(4, 3, "learn"), 8, Outcome.TAKEN_AWAY)
    assert learners.weights.sum() == pytest.approx(-3)


def test_a_learning_taker_with_the_ball_or_out_of_its_depth_goes_to_the_ball(scene):
    learners = takers()
    assert ask_taker(make_view(scene), "learn", 4, learners)[0] == Action.GO_TO_BALL
    scene.age[1] = 13
    view = make_view(scene, ball_kickable=False)
    assert ask_taker(view, "learn", 4, learners) == (Action.GO_TO_BALL, NO_TARGET, False)
    assert learners.action[0] == NO_ACTION


def test_a_random_taker_marks_and_chases_evenly(scene):
    view = make_view(scene, ball_kickable=False)
    asked = [
        ask_taker(view, "random", 4, takers(), uniforms=np.array([0.5, u, 0.5]))
        for u in (0.1, 0.5, 0.9)
    ]
    wanted = [(Action.GO_TO_BALL, NO_TARGET), (Action.MARK_KEEPER, 1), (Action.MARK_KEEPER, 2)]
    assert [answer[:2] for answer in asked] == wanted
    learners = takers()
    ask_taker(view, "random", 4, learners)
    policies.end_episode(learners, 0, make_player(4, 3, "random"), 9, Outcome.TAKEN_AWAY)
    assert not learners.weights.any()
    assert learners.action[0] == NO_ACTION


# Words


def test_players_described_in_wrong_words_are_refused():
    with pytest.raises(AgentError, match="taker policy 'hold': choose one of random, hand"):
        make_player(3, 3, "hold")
    with pytest.raises(AgentError, match="keeper policy 'best'"):
        make_player(0, 3, "best")
    with pytest.raises(AgentError, match="ordering 'k2': choose one of ball, k1"):
        make_player(0, 3, "learn", ordering="k2")
    with pytest.raises(AgentError, match="interval=0"):
        make_player(3, 3, "learn", interval=0)


def test_a_choice_takes_as_many_uniforms_as_announced():
    assert len(HALVES) == sarsa.UNIFORMS_PER_CHOICE
