"""Every player of every field answers whose answer is due: what the trainer plays by."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from keepaway_agent.actions import Outcome
from keepaway_agent.compiled import compiled
from keepaway_agent.learning.sarsa import UNIFORMS_PER_CHOICE, Learners
from keepaway_agent.passing import record
from keepaway_agent.playing.policies import (
    Player,
    View,
    end_episode,
    keep_passing,
    keeper_decision,
    taker_decision,
)
from keepaway_sim.world.state import Belief
from keepaway_sim.world.streams import Draws


@record
class Deciders(NamedTuple):
    """The players of all fields, and what they answer."""

    belief: Belief  # of the World
    keepers: Learners  # num_keepers rows for each field
    takers: Learners  # num_takers rows for each field
    policy: np.ndarray  # (num_fields, num_players) int64, each player's policy
    keeper: Player  # what is the same for all keepers
    taker: Player  # what is the same for all takers
    random: Draws  # a stream for each player, field by field
    order: np.ndarray  # (num_players,) int64, scratch
    action: np.ndarray  # (num_fields, num_players) int64, what each asks for
    target: np.ndarray  # (num_fields, num_players) int64, its receiver or marked keeper
    chose: np.ndarray  # (num_fields, num_players) bool: a policy chose it just now


@compiled
def decide_all(d, asked):
    """Let every player answer whose answer is due, and pay those whose episode is over.

    Args:
        d: Deciders; `action`, `target` and `chose` are written.
        asked: (num_fields,) bool, which fields are looked at.
    """
    for f in range(len(asked)):
        if asked[f]:
            decide(d, f)


@compiled
def decide(d, f):
    """Let every player of field f answer whose answer is due, or pay them all at the end."""
    for p in range(d.policy.shape[1]):
        d.chose[f, p] = False
        if d.belief.outcome[f] != Outcome.IN_PLAY:
            _end_episode(d, f, p)
        elif d.belief.decision_due[f, p]:
            _answer(d, f, p)
        elif p < d.keeper.num_keepers:
            keep_passing(d.keepers, f * d.keeper.num_keepers + p, d.belief.cycle[f])


@compiled
def _player(d, f, p):
    team = d.keeper if p < d.keeper.num_keepers else d.taker
    return Player(p, team.num_keepers, d.policy[f, p], team.ordering, team.interval)


@compiled
def _end_episode(d, f, p):
    """Let player p know that its episode ended."""
    outcome, cycle, n = d.belief.outcome[f], d.belief.cycle[f], d.keeper.num_keepers
    if p < n:
        end_episode(d.keepers, f * n + p, _player(d, f, p), cycle, outcome)
    else:
        i = f * (d.policy.shape[1] - n) + p - n
        end_episode(d.takers, i, _player(d, f, p), cycle, outcome)


@compiled
def _answer(d, f, p):
    """Write what player p asks for."""
    belief, n, num_players = d.belief, d.keeper.num_keepers, d.policy.shape[1]
    view = View(
        belief.position[f, p],
        belief.age[f, p],
        belief.cycles_to_ball[f, p],
        belief.ball_kickable[f, p],
        belief.cycle[f],
    )
    stream = f * num_players + p
    at = d.random.cursor[stream]
    draws = d.random.uniforms[stream, at : at + UNIFORMS_PER_CHOICE]
    player = _player(d, f, p)
    if p < n:
        answer = keeper_decision(d.keepers, f * n + p, player, view, draws, d.order)
    else:
        i = f * (num_players - n) + p - n
        answer = taker_decision(d.takers, i, player, view, draws, d.order)
    d.action[f, p], d.target[f, p], d.chose[f, p] = answer
    if d.chose[f, p]:
        d.random.cursor[stream] = at + UNIFORMS_PER_CHOICE
