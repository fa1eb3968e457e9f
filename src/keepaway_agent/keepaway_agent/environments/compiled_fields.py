"""Compiled loops over fields: choices from outside become requests, beliefs become observations."""

from typing import NamedTuple

import numpy as np

from keepaway_agent.actions import NO_TARGET, Action, Outcome
from keepaway_agent.compiled import compiled, compiled_apart
from keepaway_agent.learning.features import (
    BY_BALL,
    keeper_state,
    nearest_to_ball,
    rank_players,
    taker_state,
)
from keepaway_agent.training.deciding import decide
from keepaway_sim.world.cycle import begin_cycle, end_cycle

NO_CHOICE = -1
"""The choice of a player who has none to make."""


class KeeperBooks(NamedTuple):
    """What a vector environment keeps of every field; each (num_fields,)."""

    keeper: np.ndarray  # int64, who has the choice, or had the last one
    choosing: np.ndarray  # bool, there is a choice
    steps: np.ndarray  # int64, choices since kick-off
    cycles: np.ndarray  # int64, since the last choice
    is_paid: np.ndarray  # bool, there was a choice since kick-off
    in_play: np.ndarray  # bool, an episode was running when the step began


class Results(NamedTuple):
    """What a step of a vector environment gives; made anew for each."""

    observations: np.ndarray  # (num_fields, num_variables) float32
    rewards: np.ndarray  # (num_fields,) float64
    ended: np.ndarray  # (num_fields,) bool
    truncated: np.ndarray  # (num_fields,) bool
    choosing: np.ndarray  # (num_fields,) bool
    cycles: np.ndarray  # (num_fields,) int64
    cycle: np.ndarray  # (num_fields,) int64
    keeper: np.ndarray  # (num_fields,) int64


@compiled_apart
def choose_all(d, choice):
    """Turn choices made from outside into requests.

    Args:
        d: Deciders; `action` and `target` are written where a choice is made, and the last
            choice of takers.
        choice: (num_fields, num_players) int64, NO_CHOICE for who makes none.
    """
    for f in range(choice.shape[0]):
        for p in range(choice.shape[1]):
            if choice[f, p] != NO_CHOICE:
                choose(d, f, p, choice[f, p])


@compiled
def choose(d, f, p, choice):
    """Make one player's choice."""
    n, num_players = d.keeper.num_keepers, d.policy.shape[1]
    if p < n:
        rank_as_keeper(d, f, p)
        d.action[f, p] = Action.PASS_BALL if choice else Action.HOLD_BALL
    else:
        rank_as_taker(d, f, p)
        d.action[f, p] = Action.MARK_KEEPER if choice else Action.GO_TO_BALL
        i = f * (num_players - n) + p - n
        d.takers.action[i], d.takers.target[i] = choice, d.order[choice]
    d.target[f, p] = d.order[choice] if choice else NO_TARGET


@compiled
def rank_as_keeper(d, f, p):
    """Write into `d.order` who is K1, K2.., T1.. to keeper p, who is K1 itself."""
    rank_players(d.belief.position[f, p], d.keeper.num_keepers, p, -1, d.keeper.ordering, d.order)


@compiled
def rank_as_taker(d, f, p):
    """Write into `d.order` who is K1.. to taker p, who is T1: K1 is nearest to the ball."""
    position, n = d.belief.position[f, p], d.keeper.num_keepers
    holder = nearest_to_ball(position, 0, n)
    rank_players(position, n, holder, p, BY_BALL, d.order)


class Play(NamedTuple):
    """The arguments of `play` for every field; each (num_fields,)."""

    moving: np.ndarray  # bool, it is played, and has had nothing to stop for yet
    in_play: np.ndarray  # bool, the end of the episode is something to stop for as well
    left: np.ndarray  # int64, cycles to play at most
    cycles: np.ndarray  # int64, counts those that are played


@compiled_apart
def play(w, d, outside, latest, choosing, plays):
    """Play every moving field on, each at its own pace, as far as possible in compiled code.

    A field stops where a player has a choice to make from outside. It waits where discs may touch,
    until they are moved (`Bodies.move`), and where random numbers run short. Then this is called
    again.

    Args:
        w: Fields of the World.
        d: Deciders.
        outside: (num_players,) bool, whose choices are made from outside.
        latest: (2,) int64, `RandomStreams.latest` of the world and of the players.
        choosing: (num_fields, num_players) bool, written: who has a choice to make from outside.
        plays: Play, updated.

    Returns:
        how many fields have come to a stop, whether discs are to be moved, whether random numbers
        are short.
    """
    num_stopped, is_short = 0, False
    for begins in (False, True):  # first what waited for its discs, whose slots are then free
        w.bodies.num_asked[0] *= not begins
        for f in range(len(plays.moving)):
            while plays.moving[f] and plays.left[f] > 0:
                if w.bodies.slot[f] < 0:
                    if not begins:
                        break
                    if runs_short(w, d, f, latest):
                        is_short = True
                        break
                    begin_cycle(w, f, d.action, d.target)
                    if w.bodies.slot[f] >= 0:
                        break
                end_cycle(w, f)
                w.bodies.slot[f] = -1
                decide(d, f)
                num_stopped += note_choices(d, f, outside, choosing, plays)
    return num_stopped, w.bodies.num_asked[0] > 0, is_short


@compiled
def runs_short(w, d, f, latest):
    """Are there too few random numbers for another cycle of field f?"""
    if w.random.cursor[f] > latest[0]:
        return True
    num_players = d.policy.shape[1]
    for stream in range(f * num_players, (f + 1) * num_players):
        if d.random.cursor[stream] > latest[1]:
            return True
    return False


@compiled
def note_choices(d, f, outside, choosing, plays):
    """After a cycle of field f: who has a choice to make from outside? Whether it stops."""
    stops = plays.in_play[f] and d.belief.outcome[f] != Outcome.IN_PLAY
    for p in range(len(outside)):
        choosing[f, p] = d.chose[f, p] and outside[p]
        stops = stops or choosing[f, p]
    plays.cycles[f] += 1
    plays.left[f] -= 1
    plays.moving[f] = not stops
    return stops


@compiled_apart
def observe_keepers(d, who, high, state, observations):
    """What one keeper of every field sees, itself being K1.

    Args:
        d: Deciders.
        who: (num_fields,) int64, the keeper.
        high: (num_variables,) float32, what an observation is at most.
        state: (num_variables,) float64, scratch.
        observations: (num_fields, num_variables) float32, written.
    """
    for f in range(len(who)):
        observe_keeper(d, f, who[f], high, state, observations)


@compiled
def observe_keeper(d, f, p, high, state, observations):
    """What keeper p sees; arguments as of `observe_keepers`."""
    rank_as_keeper(d, f, p)
    keeper_state(d.belief.position[f, p], d.order, d.keeper.num_keepers, state)
    for k in range(len(state)):
        observations[f, k] = min(state[k], high[k])


@compiled_apart
def observe_takers(d, who, high, state, observations):
    """What one taker of every field sees, itself being T1; arguments as of `observe_keepers`."""
    for f in range(len(who)):
        rank_as_taker(d, f, who[f])
        taker_state(d.belief.position[f, who[f]], d.order, d.keeper.num_keepers, state)
        for k in range(len(state)):
            observations[f, k] = min(state[k], high[k])


@compiled_apart
def begin_step(d, books, actions):
    """Make the choice of every field that has one.

    Args:
        d: Deciders.
        books: KeeperBooks.
        actions: (num_fields,) int64; where there is no choice it is not looked at, but checked.

    Returns:
        the first field whose action is none, and then nothing was done; else -1.
    """
    for f in range(len(actions)):
        if not 0 <= actions[f] < d.keeper.num_keepers:
            return f
    for f in range(len(actions)):
        books.in_play[f] = d.belief.outcome[f] == Outcome.IN_PLAY
        if not books.in_play[f]:
            books.steps[f], books.is_paid[f] = 0, False
        elif books.choosing[f]:
            choose(d, f, books.keeper[f], actions[f])
            books.steps[f] += 1
            books.is_paid[f] = True
    return -1


@compiled_apart
def end_step(d, books, choosing, most_steps, high, state, results):
    """Write what a step gives: where there is a choice again, or the end, its cycles are paid.

    Args:
        d: Deciders.
        books: KeeperBooks.
        choosing: (num_fields, num_players) bool, see `note_choices`.
        most_steps: choices after which an episode is cut off.
        high: (num_variables,) float32, what an observation is at most.
        state: (num_variables,) float64, scratch.
        results: Results, written.

    Returns:
        how many episodes are to be cut off.
    """
    num_truncated = 0
    for f in range(len(books.keeper)):
        books.choosing[f] = False
        for p in range(d.keeper.num_keepers):
            if choosing[f, p] and not books.choosing[f]:
                books.keeper[f], books.choosing[f] = p, True
        observe_keeper(d, f, books.keeper[f], high, state, results.observations)
        ended = d.belief.outcome[f] != Outcome.IN_PLAY
        is_due = books.choosing[f] or ended
        cycles = books.cycles[f] if is_due and books.is_paid[f] else 0
        if is_due:
            books.cycles[f] = 0
        truncated = is_due and books.is_paid[f] and books.steps[f] >= most_steps
        num_truncated += truncated
        results.rewards[f], results.cycles[f] = cycles, cycles
        results.ended[f], results.truncated[f] = ended, truncated
        results.choosing[f], results.keeper[f] = books.choosing[f], books.keeper[f]
        results.cycle[f] = d.belief.cycle[f]
    return num_truncated
