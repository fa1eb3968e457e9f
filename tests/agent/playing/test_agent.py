"""One player as an object: messages may come twice, late, or never."""

import numpy as np
import pytest

from keepaway_agent.actions import Action, Outcome, Role
from keepaway_agent.errors import AgentError, WeightsError
from keepaway_agent.playing.agent import Agent, AgentConfig, MatchFacts, Perceived, check_config
from keepaway_agent.playing.policies import View
from keepaway_agent.settings import build

FACTS = MatchFacts(3, 2, 25.0, 25.0, cycle_time=0.1, seed=5)
POSITIONS = np.array([[0, 0], [10, 0], [0, 10], [-4, 0], [0, -6], [0.5, 0]], dtype=float)


def perceived(episode=0, cycle=0, outcome=Outcome.IN_PLAY, kickable=True):
    view = View(
        POSITIONS + 0.01 * cycle,
        np.zeros(6, dtype=np.int32),
        np.full(5, 9, dtype=np.int32),
        kickable,
        cycle,
    )
    return Perceived(episode, outcome, outcome == Outcome.IN_PLAY, view)


def decision(agent, *where, **more):
    """Its answer, which is due."""
    answer = agent.perceive(perceived(*where, **more))
    assert answer is not None
    return answer


def learner():
    return Agent(FACTS, 0, AgentConfig(policy="learn"))


def same_weights(one, other):
    return np.array_equal(one.learned("a").values, other.learned("a").values)


def test_a_perception_that_comes_twice_is_answered_twice_and_taught_once():
    careful, plain = learner(), learner()
    for cycle in range(5):
        first = careful.perceive(perceived(cycle=cycle))
        again = careful.perceive(perceived(cycle=cycle))
        assert again is first
        assert first[:2] == plain.perceive(perceived(cycle=cycle))[:2]
    for agent in (careful, careful, plain):
        assert agent.perceive(perceived(cycle=5, outcome=Outcome.TAKEN_AWAY)) is None
    assert same_weights(careful, plain)
    assert careful.episodes == plain.episodes == 1


def test_a_view_may_be_made_of_any_kinds_of_arrays():
    plain, other = learner(), learner()
    for cycle in range(20):
        usual = perceived(cycle=cycle)
        answer = other.perceive(usual._replace(view=spread(usual.view)))
        assert answer[:2] == plain.perceive(usual)[:2]
    assert same_weights(plain, other)
    fastest = perceived(cycle=30, kickable=False).view._replace(
        cycles_to_ball=np.array([3, 9, 9, 9, 9], dtype=np.int32)
    )
    answer = other.perceive(Perceived(0, Outcome.IN_PLAY, True, spread(fastest)))
    assert answer.action == Action.GO_TO_BALL
    ages = np.array([0, 0, 0, 13, 0, 0], dtype=np.int32)
    somebody_lost = perceived(cycle=31).view._replace(age=ages)
    answer = other.perceive(Perceived(0, Outcome.IN_PLAY, True, spread(somebody_lost)))
    assert not answer.values.size  # so no learner was asked


def spread(view):
    """The same view in wider numbers, with others between them in memory."""
    position = np.ones((6, 4))
    position[:, ::2] = view.position
    age, cycles = np.zeros(12, dtype=np.int64), np.ones(10, dtype=np.int32)
    age[::2], cycles[::2] = view.age, view.cycles_to_ball
    return view._replace(position=position[:, ::2], age=age[::2], cycles_to_ball=cycles[::2])


def test_a_perception_from_the_past_is_not_answered():
    agent = learner()
    agent.perceive(perceived(episode=1, cycle=3))
    assert agent.perceive(perceived(episode=1, cycle=2)) is None
    assert agent.perceive(perceived(episode=0, cycle=9)) is None


def test_an_end_that_was_never_perceived_teaches_nothing_and_is_counted():
    agent = learner()
    agent.perceive(perceived(episode=0, cycle=0))
    agent.perceive(perceived(episode=1, cycle=0))
    assert (agent.cut_off, agent.episodes) == (1, 0)
    assert not agent.learned("a").values.any()


def test_an_aborted_episode_teaches_nothing_and_is_counted():
    agent = learner()
    agent.perceive(perceived(cycle=0))
    agent.perceive(perceived(cycle=9, outcome=Outcome.ABORTED))
    assert (agent.cut_off, agent.episodes) == (1, 0)
    assert not agent.learned("a").values.any()


def test_an_end_teaches_and_is_counted_with_its_time():
    agent = learner()
    agent.perceive(perceived(cycle=0))
    agent.perceive(perceived(cycle=36, outcome=Outcome.TAKEN_AWAY))
    assert agent.learned("a").values.any()
    assert (agent.episodes, agent.hours) == (1, pytest.approx(0.001))


def test_a_cycle_in_which_nothing_is_due_goes_on_with_the_last_action():
    agent, plain = learner(), learner()
    agent.perceive(perceived(cycle=0))
    assert agent.perceive(perceived(cycle=2)._replace(decision_due=False)) is None
    agent.perceive(perceived(cycle=9, outcome=Outcome.TAKEN_AWAY))
    plain.perceive(perceived(cycle=0))
    plain.perceive(perceived(cycle=7, outcome=Outcome.TAKEN_AWAY))
    assert same_weights(agent, plain)  # paid for the seven cycles after it went on


def test_a_learners_values_come_with_its_choice_and_others_have_none():
    assert decision(learner()).values.tolist() == [0.0, 0.0, 0.0]
    assert len(decision(learner(), kickable=False).values) == 0
    hand = Agent(FACTS, 0, AgentConfig(policy="hand"))
    assert len(decision(hand).values) == 0


def test_players_of_equal_seed_and_place_are_equal_and_others_are_not():
    def choices(facts, index):
        agent = Agent(facts, index, AgentConfig(policy="random"))
        return [decision(agent, cycle=cycle)[:2] for cycle in range(50)]

    other = MatchFacts(3, 2, 25.0, 25.0, cycle_time=0.1, seed=6)
    assert choices(FACTS, 0) == choices(FACTS, 0)
    assert choices(FACTS, 0) != choices(other, 0)
    assert choices(FACTS, 0) != choices(FACTS, 1)


def test_it_goes_on_from_what_it_learned():
    first = learner()
    first.perceive(perceived(cycle=0))
    first.perceive(perceived(cycle=40, outcome=Outcome.TAKEN_AWAY))
    second = learner()
    second.use(first.learned("keeper_1"))
    assert same_weights(first, second)
    assert (second.episodes, second.hours) == (first.episodes, first.hours)


def test_weights_of_another_task_are_refused():
    larger = Agent(MatchFacts(4, 3, 25.0, 25.0, 0.1, 0), 0)
    with pytest.raises(WeightsError, match="in 3v2, not of a keeper in 4v3"):
        larger.use(learner().learned("keeper_1"))


@pytest.mark.parametrize(
    ("role", "settings", "why"),
    [
        (Role.KEEPER, {"policy": "cheat"}, "cheat"),
        (Role.TAKER, {"policy": "hold"}, "hold"),
        (Role.KEEPER, {"alpha": 2.0}, "alpha=2.0"),
        (Role.KEEPER, {"ordering": "age"}, "age"),
        (Role.KEEPER, {"tile_widths": "wide"}, "wide"),
        (Role.TAKER, {"decision_interval": 0}, "interval=0"),
    ],
)
def test_settings_that_make_no_player_are_refused(role, settings, why):
    with pytest.raises(AgentError, match=why):
        check_config(role, build(AgentConfig, settings))


def test_there_is_no_sixth_player_among_five():
    with pytest.raises(AgentError, match=r"0\.\.4"):
        Agent(FACTS, 5)


def test_a_taker_plays_too():
    taker = Agent(FACTS, 3)
    assert decision(taker, kickable=False).action == Action.GO_TO_BALL
