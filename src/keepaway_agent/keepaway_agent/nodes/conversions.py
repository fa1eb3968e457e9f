"""Messages <-> what a player's functions take: only this module knows the messages' fields."""

import array

import numpy as np

from keepaway_agent.actions import Outcome
from keepaway_agent.agent import Agent, Decision, MatchFacts, Perceived
from keepaway_agent.errors import AgentError
from keepaway_agent.policies import View
from keepaway_msgs.msg import ActionRequest, Match, Perception


def match_facts(message: Match) -> MatchFacts:
    """What a player must know of a match.

    Raises:
        AgentError: a match in which nobody can play.
    """
    if message.num_keepers < 2 or message.num_takers < 1:
        raise AgentError(f"a match of {message.num_keepers} keepers v {message.num_takers} takers")
    return MatchFacts(
        num_keepers=message.num_keepers,
        num_takers=message.num_takers,
        field_length=message.field_length,
        field_width=message.field_width,
        cycle_time=message.cycle_time,
        seed=message.seed,
        code_version=message.code_version,
    )


def perceived(message: Perception, agent: Agent) -> Perceived:
    """A perception, checked to be one that this agent can have.

    Raises:
        AgentError: somebody else's, one of another number of players, or not of finite numbers.
    """
    num = agent.facts.num_players
    if message.player_index != agent.index:
        raise AgentError(f"a perception of player {message.player_index}")
    if len(message.positions) != 2 * (num + 1) or len(message.ages) != num + 1:
        raise AgentError(
            f"a perception of {len(message.positions)} coordinates and {len(message.ages)} ages,"
            f" where {num} players and the ball have {2 * (num + 1)} and {num + 1}"
        )
    if len(message.cycles_to_ball) != num:
        raise AgentError(f"cycles to the ball of {len(message.cycles_to_ball)} players, not {num}")
    positions = np.frombuffer(message.positions)
    if not np.isfinite(positions).all():
        raise AgentError(f"positions that are not finite: {positions}")
    view = View(
        position=positions.reshape(num + 1, 2),
        age=np.frombuffer(message.ages, np.uint16).astype(np.int32),
        cycles_to_ball=np.frombuffer(message.cycles_to_ball, np.uint16).astype(np.int32),
        ball_kickable=message.ball_kickable,
        cycle=message.cycle,
    )
    if message.outcome not in _OUTCOMES:
        raise AgentError(f"outcome={message.outcome}")
    return Perceived(message.episode, message.outcome, message.decision_due, view)


_OUTCOMES = frozenset(Outcome)


def write_request(request: ActionRequest, message: Perception, decision: Decision) -> None:
    """Make `request`, used again and again because making one takes long, answer a perception."""
    request.player_index = message.player_index
    request.episode = message.episode
    request.cycle = message.cycle
    request.action = decision.action
    request.target = decision.target
    request.action_values = array.array("d", decision.values.tobytes())
