"""Policies: a player's perception -> what it asks for.

Keepers (Stone & Sutton 2002): a keeper without the ball runs to it if it is the fastest of its
team, and gets open if not. With the ball it holds it, or passes to one of the others: this
macro-action is what a policy chooses, and what a learner learns. Takers go to the ball or mark a
keeper.

One player decides at a time: `keeper_decision` and `taker_decision` are compiled functions of its
`View`, called alike by a ROS node with its one player and by the trainer with thousands. Every
choice of a policy takes three random numbers of that player's own generator, used or not, so that
the numbers of later choices do not depend on what was chosen before.
"""

import math
from typing import Final, NamedTuple

import numpy as np

from keepaway_agent.actions import NO_TARGET, UNREACHABLE, Action, Outcome, Role
from keepaway_agent.compiled import compiled
from keepaway_agent.errors import AgentError
from keepaway_agent.learning import sarsa
from keepaway_agent.learning.features import (
    BY_BALL,
    ORDERINGS,
    distance,
    keeper_state,
    nearest_to_ball,
    rank_players,
    taker_state,
)

RANDOM: Final = 0  # any choice, evenly
HOLD: Final = 1  # keepers: always hold
HAND: Final = 2  # written by hand: UT Austin's hand-coded keeper and taker
LEARN: Final = 3  # Sarsa(lambda), learning as it plays
GREEDY: Final = 4  # what was learned, without learning or exploring

KEEPER_POLICIES: Final = {
    "random": RANDOM,
    "hold": HOLD,
    "hand": HAND,
    "learn": LEARN,
    "greedy": GREEDY,
}
TAKER_POLICIES: Final = {"random": RANDOM, "hand": HAND, "learn": LEARN, "greedy": GREEDY}

MAX_KNOWN_AGE: Final = 12
"""A player last perceived more cycles ago has no known position (confidence 0.88)."""
TAKER_DECISION_INTERVAL: Final = 5
"""Cycles between two choices of a learning or random taker. One cycle moves none: a choice must
last for a while before it makes a difference that can be learned."""

KEEPER_REWARD: Final = 1.0  # for every cycle that the ball stays in play
TAKER_REWARD: Final = -1.0  # a taker wants episodes to be short

HAND_SAFE_DISTANCE: Final = 5.0  # [m] the hand-coded keeper holds while T1 is further away
HAND_HOLD_SCORE: Final = 90.0  # what a pass must score to be preferred to holding
HAND_DISTANCE_SCORE: Final = 4.0  # score per metre of a receiver's distance to the nearest taker
CONE_WIDTH: Final = 0.3  # half-width of a pass lane per metre along it


class Player(NamedTuple):
    """Who decides, and how; fixed for a match."""

    own: int  # its index in match order: keepers first
    num_keepers: int
    policy: int  # RANDOM .. GREEDY
    ordering: int  # BY_BALL or BY_K1, for keepers
    interval: int  # cycles between a taker's choices


class View(NamedTuple):
    """What one player perceives at one moment; see the Perception message."""

    position: np.ndarray  # (num_players + 1, 2) [m] players in match order, then the ball
    age: np.ndarray  # (num_players + 1,) [cycles] since each was last perceived
    cycles_to_ball: np.ndarray  # (num_players,) of the fastest keeper, else UNREACHABLE
    ball_kickable: bool
    cycle: int  # since kick-off


def make_player(
    index: int,
    num_keepers: int,
    policy: str,
    ordering: str = "ball",
    interval: int = TAKER_DECISION_INTERVAL,
) -> Player:
    """A player described in words.

    Raises:
        AgentError: a policy or an ordering that there is not, or no interval.
    """
    role = Role.KEEPER if index < num_keepers else Role.TAKER
    policies = KEEPER_POLICIES if role == Role.KEEPER else TAKER_POLICIES
    if policy not in policies:
        raise AgentError(
            f"{role.name.lower()} policy {policy!r}: choose one of {', '.join(policies)}"
        )
    if ordering not in ORDERINGS:
        raise AgentError(f"ordering {ordering!r}: choose one of {', '.join(ORDERINGS)}")
    if interval < 1:
        raise AgentError(f"interval={interval}: a taker decides every 1 or more cycles")
    return Player(index, num_keepers, policies[policy], ORDERINGS[ordering], interval)


@compiled
def knows_everyone(age):
    """Whether no player's perceived position is too old; (num_players + 1,) ages [cycles]."""
    oldest = 0
    for k in range(len(age) - 1):
        oldest = max(oldest, age[k])
    return oldest <= MAX_KNOWN_AGE


@compiled
def keeper_decision(learners, i, player, view, uniforms, order):
    """What a keeper asks for, given what it perceives.

    Args:
        learners: Learners of keepers.
        i: which of them this player is.
        player: Player.
        view: View; a decision is due.
        uniforms: (3,) in [0, 1), of this player's own generator.
        order: (num_players,) int64, written where a policy chooses: who is K1, K2.., T1..

    Returns:
        action, target, and whether a policy chose (and so used up the uniforms).
    """
    if not view.ball_kickable:
        return receive(player, view), NO_TARGET, False
    if not knows_everyone(view.age):
        return Action.HOLD_BALL, NO_TARGET, False
    rank_players(view.position, player.num_keepers, player.own, -1, player.ordering, order)
    keeper_state(view.position, order, player.num_keepers, learners.state[i])
    choice = choose_as_keeper(learners, i, player, view.cycle, uniforms)
    if choice == 0:
        return Action.HOLD_BALL, NO_TARGET, True
    return Action.PASS_BALL, order[choice], True


@compiled
def keep_passing(learners, i, cycle):
    """No decision is due, because a pass that still needs another kick continues.

    P KeepawayPlayer.cc: that counts as the last action again, so the pass is paid from its last
    kick on.
    """
    sarsa.resume(learners, i, cycle)


@compiled
def receive(player, view):
    """What a keeper without the ball does: the fastest of the team goes for the ball.

    Equally fast ones leave it to the one that comes first in match order.
    """
    own = view.cycles_to_ball[player.own]
    for mate in range(player.num_keepers):
        cycles = view.cycles_to_ball[mate]
        if cycles < own or (cycles == own and mate < player.own):
            return Action.GET_OPEN
    return Action.GO_TO_BALL


@compiled
def choose_as_keeper(learners, i, player, cycle, uniforms):
    """A keeper's macro-action by its policy: 0 to hold, k to pass to K(k+1)."""
    if player.policy == HOLD:
        return 0
    if player.policy == HAND:
        return hand_coded_keeper(learners.state[i], player.num_keepers)
    if player.policy == RANDOM:
        return sarsa.random_action(player.num_keepers, uniforms[1])
    if player.policy == GREEDY:
        return sarsa.greedy(learners, i, uniforms)
    return sarsa.decide(learners, i, KEEPER_REWARD, cycle, uniforms)


@compiled
def hand_coded_keeper(state, num_keepers):
    """UT Austin's hand-coded keeper: hold while T1 is far, else the best of the pass lanes.

    A lane scores 4 points a metre between receiver and nearest taker and 1 a degree between the
    pass and the nearest taker; holding scores 90. The first of equal ones is taken.
    """
    n = num_keepers
    num_takers = (len(state) + 3 - 4 * n) // 2
    if state[n] > HAND_SAFE_DISTANCE:
        return 0
    min_distances = state[2 * n + 2 * num_takers - 1 :]
    min_angles = min_distances[n - 1 :]
    best, best_score = 0, HAND_HOLD_SCORE
    for k in range(n - 1):
        score = HAND_DISTANCE_SCORE * min_distances[k] + math.degrees(min_angles[k])
        if score > best_score:
            best, best_score = k + 1, score
    return best


@compiled
def taker_decision(learners, i, player, view, uniforms, order):
    """What a taker asks for, given what it perceives.

    A learning taker (after Iscen & Erogul 2008) chooses every `player.interval` cycles between
    going to the ball and marking one of K2..Kn, and keeps to it in between. With the ball, or
    when it has lost sight of a player, it goes to the ball without asking the learner.

    Arguments and results are those of `keeper_decision`.
    """
    if player.policy == HAND:
        action, target = hand_coded_taker(player, view)
        return action, target, False
    if view.ball_kickable or not knows_everyone(view.age):
        return Action.GO_TO_BALL, NO_TARGET, False
    chooses = taker_chooses(learners, i, player, view.cycle)
    if chooses:
        holder = nearest_to_ball(view.position, 0, player.num_keepers)
        rank_players(view.position, player.num_keepers, holder, player.own, BY_BALL, order)
        taker_state(view.position, order, player.num_keepers, learners.state[i])
        choice = choose_as_taker(learners, i, player, view.cycle, uniforms)
        learners.action[i], learners.cycle[i] = choice, view.cycle
        learners.target[i] = order[choice]
    if learners.action[i] == 0:
        return Action.GO_TO_BALL, NO_TARGET, chooses
    return Action.MARK_KEEPER, learners.target[i], chooses


@compiled
def taker_chooses(learners, i, player, cycle):
    """Whether a taker's last choice has lasted long enough."""
    return learners.action[i] == sarsa.NO_ACTION or cycle - learners.cycle[i] >= player.interval


@compiled
def choose_as_taker(learners, i, player, cycle, uniforms):
    """A taker's macro-action by its policy: 0 to go to the ball, k to mark K(k+1)."""
    if player.policy == RANDOM:
        return sarsa.random_action(player.num_keepers, uniforms[1])
    if player.policy == GREEDY:
        return sarsa.greedy(learners, i, uniforms)
    return sarsa.decide(learners, i, TAKER_REWARD, cycle, uniforms)


@compiled
def hand_coded_taker(player, view):
    """UT Austin's taker: the two nearest to the ball chase it, the others block pass lanes.

    Returns:
        action, target.
    """
    if num_nearer_takers(player, view) < 2:
        return Action.GO_TO_BALL, NO_TARGET
    marked = most_open_keeper(player, view)
    if marked < 0:
        return Action.GO_TO_BALL, NO_TARGET
    return Action.MARK_KEEPER, marked


@compiled
def num_nearer_takers(player, view):
    """How many other takers are believed nearer to the ball.

    Where one of them is unknown they stand in match order (UT Austin's sort then sorts nothing).
    """
    ball = len(view.position) - 1
    own = distance(view.position, player.own, ball)
    nearer = 0
    for taker in range(player.num_keepers, ball):
        if view.age[taker] > MAX_KNOWN_AGE:
            return player.own - player.num_keepers
        other = distance(view.position, taker, ball)
        if other < own or (other == own and taker < player.own):
            nearer += 1
    return nearer


@compiled
def most_open_keeper(player, view):
    """The keeper with the fewest takers in the pass lane to it; -1: none known.

    The lanes begin at the keeper who is believed to reach the ball first: the holder, or the
    receiver while the ball flies. The lane to that one itself has no length, so no player is in it.
    The first of equal ones. The deciding taker counts too, as in UT Austin's framework.
    """
    origin = passing_keeper(player, view)
    best, fewest = -1, len(view.position)
    for keeper in range(player.num_keepers):
        if view.age[keeper] > MAX_KNOWN_AGE:
            continue
        blockers = 0
        for taker in range(player.num_keepers, len(view.position) - 1):
            known = view.age[taker] <= MAX_KNOWN_AGE
            if known and in_lane(view.position, origin, keeper, taker):
                blockers += 1
        if blockers < fewest:
            best, fewest = keeper, blockers
    return best


@compiled
def passing_keeper(player, view):
    """The keeper believed to reach the ball first; the one nearest to it where that is unknown."""
    first = 0
    for keeper in range(1, player.num_keepers):
        if view.cycles_to_ball[keeper] < view.cycles_to_ball[first]:
            first = keeper
    if view.cycles_to_ball[first] == UNREACHABLE:
        return nearest_to_ball(view.position, 0, player.num_keepers)
    return first


@compiled
def in_lane(position, start, goal, player):
    """Whether a player stands in the cone from object `start` to `goal`.

    That is: off the line by less than CONE_WIDTH times the way along it, and nearer to the start
    than the goal is.
    """
    gx, gy = position[goal, 0] - position[start, 0], position[goal, 1] - position[start, 1]
    px, py = position[player, 0] - position[start, 0], position[player, 1] - position[start, 1]
    length = math.sqrt(gx * gx + gy * gy)
    if length == 0.0:
        return False
    along = (px * gx + py * gy) / length
    off = abs(px * gy - py * gx) / length
    return along > 0.0 and off < CONE_WIDTH * along and px * px + py * py < length * length


@compiled
def end_episode(learners, i, player, cycle, outcome):
    """Let a player know that the episode ended at `cycle`: learners get their final reward.

    An aborted episode teaches nothing.
    """
    if player.policy == LEARN and outcome != Outcome.ABORTED:
        is_keeper = player.own < player.num_keepers
        sarsa.finish(learners, i, KEEPER_REWARD if is_keeper else TAKER_REWARD, cycle)
    else:
        sarsa.forget(learners, i)
