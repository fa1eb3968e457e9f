"""State variables: what a learner knows of the field, from its own player's perception.

A keeper with the ball sees the 4n + 2m - 3 variables of Taylor & Stone (2004), which are those of
Stone & Sutton (2002) for any n keepers and m takers: 13 for 3v2, 19 for 4v3, 25 for 5v4. K1 is
the keeper with the ball, K2..Kn are the others and T1..Tm the takers, by rank; C is the field's
centre. A learning taker sees the variables of `taker_features`.

Positions are believed ones in the field frame [m]; distances are metres and angles radians
in [0, pi]. Compiled functions write into arrays that are passed in, so that deciding allocates
nothing.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from keepaway_agent.actions import Role
from keepaway_agent.compiled import compiled
from keepaway_agent.trigonometry import bearing

BY_BALL: Final = 0
"""Rank players by distance to the ball: the paper's order, and the default."""
BY_K1: Final = 1
"""Rank players by distance to K1: the order of UT Austin's player framework."""

ORDERINGS: Final = {"ball": BY_BALL, "k1": BY_K1}


class Feature(NamedTuple):
    """One state variable.

    `kind` says what is measured, which decides about tile width and range; `rank` is the rank of
    the player whom it is about (2 for dist_k1_k2).
    """

    name: str
    kind: str
    rank: int


def keeper_features(num_keepers: int, num_takers: int) -> tuple[Feature, ...]:
    """A keeper's state variables, in the order of `keeper_state`.

    >>> [feature.name for feature in keeper_features(2, 1)]  # doctest: +NORMALIZE_WHITESPACE
    ['dist_k1_c', 'dist_k1_k2', 'dist_k1_t1', 'dist_k2_c', 'dist_t1_c', 'min_dist_k2_t',
     'min_ang_k2_t']
    """
    mates, takers = range(2, num_keepers + 1), range(1, num_takers + 1)
    return (
        Feature("dist_k1_c", "keeper_centre", 1),
        *(Feature(f"dist_k1_k{i}", "k1_keeper", i) for i in mates),
        *(Feature(f"dist_k1_t{j}", "k1_taker", j) for j in takers),
        *(Feature(f"dist_k{i}_c", "keeper_centre", i) for i in mates),
        *(Feature(f"dist_t{j}_c", "taker_centre", j) for j in takers),
        *(Feature(f"min_dist_k{i}_t", "min_keeper_taker", i) for i in mates),
        *(Feature(f"min_ang_k{i}_t", "min_angle", i) for i in mates),
    )


def taker_features(num_keepers: int, num_takers: int) -> tuple[Feature, ...]:
    """A learning taker's state variables, in the order of `taker_state`.

    T1 is the taker itself, T2..Tm are the other takers. How far am I from the ball and from the
    pass lanes, how far are the others, and which lanes do they cover? With a single taker the
    variables about others fall away: 3n - 2 + [m > 1] (m - 1 + 2 (n - 1)) in all.

    >>> [feature.name for feature in taker_features(2, 2)]  # doctest: +NORMALIZE_WHITESPACE
    ['dist_t1_b', 'dist_t1_k2', 'dist_k1_k2', 'ang_k2_t1', 'dist_t2_b', 'min_dist_k2_t',
     'min_ang_k2_t']
    """
    mates, others = range(2, num_keepers + 1), range(2, num_takers + 1)
    own = (
        Feature("dist_t1_b", "taker_ball", 1),
        *(Feature(f"dist_t1_k{i}", "k1_taker", i) for i in mates),
        *(Feature(f"dist_k1_k{i}", "k1_keeper", i) for i in mates),
        *(Feature(f"ang_k{i}_t1", "min_angle", i) for i in mates),
    )
    if not others:
        return own
    return (
        *own,
        *(Feature(f"dist_t{j}_b", "taker_ball", j) for j in others),
        *(Feature(f"min_dist_k{i}_t", "min_keeper_taker", i) for i in mates),
        *(Feature(f"min_ang_k{i}_t", "min_angle", i) for i in mates),
    )


def features(role: Role, num_keepers: int, num_takers: int) -> tuple[Feature, ...]:
    """The state variables of a learner of this role."""
    of_role = keeper_features if role == Role.KEEPER else taker_features
    return of_role(num_keepers, num_takers)


def feature_names(role: Role, num_keepers: int, num_takers: int) -> tuple[str, ...]:
    """The names of a learner's state variables, in order."""
    return tuple(feature.name for feature in features(role, num_keepers, num_takers))


@compiled
def distance(position, a, b):
    """Metres between objects a and b of (num_objects, 2) positions."""
    dx = position[a, 0] - position[b, 0]
    dy = position[a, 1] - position[b, 1]
    return math.sqrt(dx * dx + dy * dy)


@compiled
def distance_to_centre(position, a):
    """Metres between object a and the centre of the field."""
    x, y = position[a, 0], position[a, 1]
    return math.sqrt(x * x + y * y)


@compiled
def cos_angle(position, apex, a, b):
    """Cosine of the angle at `apex` between a and b; 1 where one of them stands on the apex.

    (The cosine, because the least of several angles is the one of the greatest cosine.)
    """
    ax, ay = position[a, 0] - position[apex, 0], position[a, 1] - position[apex, 1]
    bx, by = position[b, 0] - position[apex, 0], position[b, 1] - position[apex, 1]
    lengths = math.sqrt((ax * ax + ay * ay) * (bx * bx + by * by))
    if lengths == 0.0:
        return 1.0
    return min(max((ax * bx + ay * by) / lengths, -1.0), 1.0)


@compiled
def sort_by_distance(position, reference, order, first, last):
    """Sort the objects order[first:last] by distance to a reference object, equal ones stably."""
    for i in range(first + 1, last):
        moving = order[i]
        own = distance(position, moving, reference)
        j = i
        while j > first and distance(position, order[j - 1], reference) > own:
            order[j] = order[j - 1]
            j -= 1
        order[j] = moving


@compiled
def put_first(order, first, last, player):
    """Write the players first..last-1 into order[first:last]: `player`, then the others."""
    order[first] = player
    at = first + 1
    for other in range(first, last):
        if other != player:
            order[at] = other
            at += 1


@compiled
def nearest_to_ball(position, first, last):
    """The player of first..last-1 nearest to the ball, the last object; the lowest if equal."""
    ball = len(position) - 1
    nearest = first
    for player in range(first + 1, last):
        if distance(position, player, ball) < distance(position, nearest, ball):
            nearest = player
    return nearest


@compiled
def rank_players(position, num_keepers, k1, t1, ordering, order):
    """Say who is K1, K2.., T1, T2..: the player at each rank, keepers first.

    Args:
        position: (num_players + 1, 2) [m], believed positions in match order, then the ball.
        num_keepers: how many of the players are keepers.
        k1: the keeper that ranks first whatever the distances are.
        t1: the taker that ranks first, or -1 to rank it like the others.
        ordering: BY_BALL or BY_K1.
        order: (num_players,) int64, written: order[0] is K1, order[num_keepers] is T1.
    """
    num_players = len(order)
    reference = num_players if ordering == BY_BALL else k1
    put_first(order, 0, num_keepers, k1)
    sort_by_distance(position, reference, order, 1, num_keepers)
    if t1 >= 0:
        put_first(order, num_keepers, num_players, t1)
        sort_by_distance(position, reference, order, num_keepers + 1, num_players)
    else:
        put_first(order, num_keepers, num_players, num_keepers)
        sort_by_distance(position, reference, order, num_keepers, num_players)


@compiled
def least_distance(position, player, order, first, last):
    """Metres from a player to the nearest of order[first:last]."""
    least = np.inf
    for rank in range(first, last):
        least = min(least, distance(position, player, order[rank]))
    return least


@compiled
def least_angle(position, apex, player, order, first, last):
    """Least angle at `apex` between a player and any of order[first:last] [rad, 0..pi]."""
    greatest = -1.0
    for rank in range(first, last):
        greatest = max(greatest, cos_angle(position, apex, player, order[rank]))
    return bearing(greatest, math.sqrt((1.0 - greatest) * (1.0 + greatest)))


@compiled
def keeper_state(position, order, num_keepers, state):
    """A keeper's state variables (see `keeper_features`).

    Args:
        position: (num_players + 1, 2) [m], as for `rank_players`.
        order: (num_players,) who is K1, K2.., T1..
        num_keepers: how many of the players are keepers.
        state: (4 n + 2 m - 3,) written: metres, then radians.
    """
    n, num_players = num_keepers, len(order)
    m = num_players - n
    k1 = order[0]
    state[0] = distance_to_centre(position, k1)
    for i in range(1, n):
        mate = order[i]
        state[i] = distance(position, k1, mate)
        state[n + m + i - 1] = distance_to_centre(position, mate)
        state[2 * n + 2 * m + i - 2] = least_distance(position, mate, order, n, num_players)
        state[3 * n + 2 * m + i - 3] = least_angle(position, k1, mate, order, n, num_players)
    for j in range(m):
        taker = order[n + j]
        state[n + j] = distance(position, k1, taker)
        state[2 * n + m + j - 1] = distance_to_centre(position, taker)


@compiled
def taker_state(position, order, num_keepers, state):
    """A taker's state variables (see `taker_features`); arguments as for `keeper_state`."""
    n, num_players = num_keepers, len(order)
    m = num_players - n
    k1, own, ball = order[0], order[n], num_players
    state[0] = distance(position, own, ball)
    for i in range(1, n):
        mate = order[i]
        state[i] = distance(position, own, mate)
        state[n + i - 1] = distance(position, k1, mate)
        state[2 * n + i - 2] = least_angle(position, k1, mate, order, n, n + 1)
    if m == 1:
        return
    for j in range(1, m):
        state[3 * n + j - 3] = distance(position, order[n + j], ball)
    for i in range(1, n):
        mate = order[i]
        at = 3 * n + m - 3 + i - 1
        state[at] = least_distance(position, mate, order, n + 1, num_players)
        state[at + n - 1] = least_angle(position, k1, mate, order, n + 1, num_players)
