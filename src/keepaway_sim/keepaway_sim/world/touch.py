"""What a player with a limited view makes of the players whom it only feels.

Within 3 m a player is felt all round, but only as a player: not which one (S
visualsenderplayer.cpp). Its place in the message tells something of that (P WorldModelUpdate.cc:
processLastSeeMessage), where it is tells the rest (mapUnknownPlayers). Simplified against P: there
are no phantoms among the team-mates.
"""

from __future__ import annotations

import math

from keepaway_sim.world.compiled import compiled
from keepaway_sim.world.constants import OPPONENT_SLOTS
from keepaway_sim.world.geometry import length
from keepaway_sim.world.ghosts import forget_double
from keepaway_sim.world.memory import same_team
from keepaway_sim.world.phantoms import (
    SAME_PLAYER,
    age_of,
    farthest,
    feel,
    num_opponents,
    opponent,
    place_of,
    put,
    set_age,
)

SPARE_WAY = 2.0  # [m] P: beyond what it may have run at full speed, because of noise
FAR_FROM_ALL = 10.0  # [m] P: so much beyond that, it is surely another player


@compiled
def feel_players(w, f, p):
    """Player p makes something of every player whom it feels in this look (`scratch.felt`)."""
    felt, numbers = w.scratch.felt, w.scratch.numbers
    for j in range(w.num_players):
        if not math.isnan(felt[j, 0]):
            numbers[j, 0], numbers[j, 1] = possible_numbers(w, f, p, j)
    for j in range(w.num_players):
        if not math.isnan(felt[j, 0]):
            feel_somebody(w, f, p, felt[j], numbers[j, 0], numbers[j, 1])


@compiled
def possible_numbers(w, f, p, j):
    """The least and the greatest number that player p takes for possible for j, whom it feels.

    S tells of all players in the order of their numbers, keepers first. P counts up from the last
    one before j whose number it knows, and down from the first one after j. Numbers: of keepers
    from 0, of takers from OPPONENT_SLOTS.
    """
    felt, own = w.scratch.felt, _number(w, p)
    low, high = -1, 2 * OPPONENT_SLOTS - 1
    for k in range(j + 1):
        if not math.isnan(felt[k, 0]):
            low += 2 if low + 1 == own else 1
        elif k != p and w.belief.age[f, p, k] == 0:
            low = _number(w, k)
    for k in range(w.num_players - 1, j, -1):
        is_felt = not math.isnan(felt[k, 0])
        if not is_felt and k != p and w.belief.age[f, p, k] == 0:
            high = _number(w, k)
        elif not is_felt:
            continue
        high -= 2 if high == own else 1
    return low, high


@compiled
def _number(w, j):
    num_keepers = w.constants.num_keepers
    return j if j < num_keepers else OPPONENT_SLOTS + j - num_keepers


@compiled
def feel_somebody(w, f, p, felt, low, high):
    """Player p feels a player whose number is one of low..high.

    Where only one is possible it is that one. Else it is who is expected nearest to there, if it
    can have come there; and if none can, an opponent of whom nothing is known. Where both teams
    are possible the last is believed of near ones only.

    Args:
        felt: x, y [m], distance as reported [m].
    """
    x, y, away = felt
    team = low // OPPONENT_SLOTS
    one_team = team == high // OPPONENT_SLOTS
    keeps = p < w.constants.num_keepers
    mates, opponents = not one_team or keeps == (team == 0), not one_team or keeps == (team == 1)
    if low == high:
        _recognize_by_number(w, f, p, low, x, y)
        return
    who, best = _nearest_expected(w, f, p, x, y, mates, opponents)
    reach = farthest(w, f, p, who) if who >= 0 else math.inf
    if who < 0 or best >= min(SAME_PLAYER, reach + SPARE_WAY):
        near = away < w.constants.feel_distance or best - reach > FAR_FROM_ALL
        if not opponents:
            who = _unknown_mate(w, f, p)
        else:
            who = _unknown_opponent(w, f, p) if one_team or near else -1
    if who >= 0:
        feel(w, f, p, who, x, y)


@compiled
def _recognize_by_number(w, f, p, number, x, y):
    """A felt player must be the one of this number; nothing else of it is perceived."""
    n = w.constants.num_keepers
    is_keeper = number < OPPONENT_SLOTS
    k = number if is_keeper else number - OPPONENT_SLOTS
    if is_keeper == (p < n):
        j = k if is_keeper else n + k
        if k >= (n if is_keeper else w.constants.num_takers):
            return
    else:
        j = opponent(w, p, k)
    put(w, f, p, j, x, y)
    set_age(w, f, p, j, 0)
    if j < w.ball:
        w.memory.seen[f, p, j, 0], w.memory.seen[f, p, j, 1] = x, y
        w.memory.seen_cycle[f, p, j] = w.belief.cycle[f]
        w.memory.nameless[f, p, j] = False
        forget_double(w, f, p, j)


@compiled
def _nearest_expected(w, f, p, x, y, mates, opponents):
    """(who, distance) of the known one, not perceived in this look, expected nearest to a point.

    Args:
        mates, opponents: look among them?
    """
    c = w.constants
    who, best = -1, math.inf
    for k in range(w.ball + 1 + c.phantom_slots):
        if k in (p, w.ball) or not 0 < age_of(w, f, p, k) < c.player_lost_age:
            continue
        is_mate = k < w.ball and same_team(c, p, k)
        if not (mates if is_mate else opponents):
            continue
        kx, ky = place_of(w, f, p, k)
        away = length(x - kx, y - ky)
        if away < best:
            who, best = k, away
    return who, best


@compiled
def _unknown_opponent(w, f, p):
    """The first opponent, perhaps a phantom, of whom player p knows nothing; -1: none is left."""
    for k in range(num_opponents(w, p)):
        j = opponent(w, p, k)
        if age_of(w, f, p, j) >= w.constants.player_lost_age:
            return j
    return -1


@compiled
def _unknown_mate(w, f, p):
    """The first team-mate of whom player p knows nothing; -1: there is none."""
    for j in range(w.num_players):
        unknown = w.belief.age[f, p, j] >= w.constants.player_lost_age
        if j != p and unknown and same_team(w.constants, p, j):
            return j
    return -1
