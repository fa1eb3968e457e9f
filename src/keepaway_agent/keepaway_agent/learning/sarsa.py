"""SMDP Sarsa(lambda) with replacing traces on a CMAC (Taylor & Stone 2004; Sutton & Barto 1998).

A learner decides now and then; between two decisions time passes, so the problem is a semi-Markov
one (SMDP). Names follow the usual ones: q_tm1 is the value of the action chosen last, r_t and
discount_t are the reward and the discount since then, q_t the value of the action chosen now::

    start(s)            choose a; its active tiles get the trace 1
    step(r, discount, s)  choose a from the weights before the update;
                        delta = r + discount * q_t - q_tm1
                        weights += alpha / num_active * delta * traces
                        the value of a is computed again
                        traces *= discount * lambda; the active tiles of the other actions
                        get the trace 0, those of a the trace 1
    end(r)              delta = r - q_tm1; weights += alpha / num_active * delta * traces

q_tm1 is the value of the last action by the weights right after it was chosen (P LinearSarsaAgent:
the update that goes with the choice moves them). A learner that made no decision in an episode
learns nothing from its end.

With lambda = 0 only the tiles of the last decision have traces, so nothing is kept but that
decision. With lambda > 0 the traces are a dense array with a list of the places that are not 0.

Learners are rows of arrays (`Learners`); every function works on one row. They are compiled, and
a node with one learner and a trainer with thousands call the same ones.
"""

from typing import Final, NamedTuple

import numpy as np

from keepaway_agent.compiled import compiled
from keepaway_agent.errors import AgentError
from keepaway_agent.learning.cmac import (
    NUM_TILINGS,
    Tiling,
    action_value,
    action_values,
    add_to_active,
    tile_cells,
)
from keepaway_agent.learning.config import SarsaConfig
from keepaway_agent.passing import record

NO_ACTION: Final = -1
"""The last action of a learner that has not decided yet in this episode."""
UNIFORMS_PER_CHOICE: Final = 3
"""Random numbers that one choice takes, whether it needs them or not: explore? which? tie."""


class Rates(NamedTuple):
    """The numbers of a SarsaConfig, as compiled functions take them."""

    alpha: float
    gamma: float
    lambda_: float
    epsilon: float
    min_trace: float


@record
class Learners(NamedTuple):
    """What any number of learners know and remember, one row each. Made by `make_learners`."""

    weights: np.ndarray  # (num_tables, num_actions, num_features, num_tiles * 32)
    table: np.ndarray  # (num_learners,) int64, whose weights: an index into the first axis above
    lows: np.ndarray  # (num_features,) the tiling, the same for all
    widths: np.ndarray  # (num_features,)
    rates: Rates  # learning parameters, the same for all
    # the last decision
    state: np.ndarray  # (num_learners, num_features) what it was made on
    values: np.ndarray  # (num_learners, num_actions) of every action then
    action: np.ndarray  # (num_learners,) int64, NO_ACTION before the first of an episode
    value: np.ndarray  # (num_learners,) of the action chosen
    cells: np.ndarray  # (num_learners, num_features) int64, fine cells of the state
    next_cells: np.ndarray  # (num_learners, num_features) int64, those of the decision being made
    cycle: np.ndarray  # (num_learners,) int64 [cycles] when it was made
    target: np.ndarray  # (num_learners,) int64, index of the player whom it named
    # traces; empty rows where lambda = 0
    traces: np.ndarray  # (num_learners, num_actions * num_features * num_tiles * 32)
    traced: np.ndarray  # (num_learners, ditto) int64, flat places of traces that are not 0
    num_traced: np.ndarray  # (num_learners,) int64, how many


def make_learners(
    num_learners: int,
    num_actions: int,
    tiling: Tiling,
    config: SarsaConfig | None = None,
    learners_per_table: int = 1,
) -> Learners:
    """Learners that know nothing: all weights are 0.

    Args:
        num_learners: how many.
        num_actions: what each chooses from.
        tiling: of their state variables.
        config: how they learn.
        learners_per_table: 1 gives each its own weights; n lets n neighbours share one value
            function, each with its own traces and decisions.

    Raises:
        AgentError: learners that do not share out evenly.
    """
    config = config or SarsaConfig()
    if num_learners % learners_per_table:
        raise AgentError(f"{num_learners} learners do not make tables of {learners_per_table}")
    num_weights = tiling.num_tiles * NUM_TILINGS
    num_traces = num_actions * tiling.num_features * num_weights if config.lambda_ > 0 else 0
    num_tables = num_learners // learners_per_table
    per_feature = (num_learners, tiling.num_features)
    return Learners(
        weights=np.zeros((num_tables, num_actions, tiling.num_features, num_weights)),
        table=np.arange(num_learners) // learners_per_table,
        lows=np.array(tiling.lows),
        widths=np.array(tiling.widths),
        rates=Rates(*(float(getattr(config, name)) for name in Rates._fields)),
        state=np.zeros(per_feature),
        values=np.zeros((num_learners, num_actions)),
        action=np.full(num_learners, NO_ACTION),
        value=np.zeros(num_learners),
        cells=np.zeros(per_feature, dtype=np.int64),
        next_cells=np.zeros(per_feature, dtype=np.int64),
        cycle=np.zeros(num_learners, dtype=np.int64),
        target=np.zeros(num_learners, dtype=np.int64),
        traces=np.zeros((num_learners, num_traces)),
        traced=np.zeros((num_learners, num_traces), dtype=np.int64),
        num_traced=np.zeros(num_learners, dtype=np.int64),
    )


@compiled
def random_action(num_actions, uniform):
    """An action drawn evenly by one uniform of [0, 1)."""
    return min(int(uniform * num_actions), num_actions - 1)


@compiled
def greedy_action(values, uniform):
    """The action of the greatest value; among equal ones each is as likely, by one uniform."""
    greatest, num_best = values[0], 1
    for action in range(1, len(values)):
        if values[action] > greatest:
            greatest, num_best = values[action], 1
        elif values[action] == greatest:
            num_best += 1
    wanted = random_action(num_best, uniform)
    for action in range(len(values)):
        if values[action] == greatest:
            if wanted == 0:
                return action
            wanted -= 1
    return 0


@compiled
def epsilon_greedy(values, epsilon, uniforms):
    """An action: with probability epsilon any, else the greatest value's.

    Args:
        values: (num_actions,)
        epsilon: probability of exploring.
        uniforms: (3,) in [0, 1): explore? which action then; which of equal ones.
    """
    if uniforms[0] < epsilon:
        return random_action(len(values), uniforms[1])
    return greedy_action(values, uniforms[2])


@compiled
def look(learners, i):
    """Find the fine cells and action values of the state in `learners.state[i]`."""
    weights = learners.weights[learners.table[i]]
    cells = learners.next_cells[i]
    tile_cells(learners.state[i], learners.lows, learners.widths, weights.shape[2], cells)
    action_values(weights, cells, learners.values[i])


@compiled
def greedy(learners, i, uniforms):
    """Choose by what was learned, without exploring or learning; the state is in `state[i]`."""
    look(learners, i)
    return greedy_action(learners.values[i], uniforms[2])


@compiled
def start(learners, i, uniforms):
    """Make an episode's first decision.

    Args:
        learners: Learners; the state is in `learners.state[i]`.
        i: which of them.
        uniforms: (3,) in [0, 1), see `epsilon_greedy`.

    Returns:
        the action chosen.
    """
    clear_traces(learners, i)
    look(learners, i)
    return remember(
        learners, i, epsilon_greedy(learners.values[i], learners.rates.epsilon, uniforms)
    )


@compiled
def step(learners, i, r_t, discount_t, uniforms):
    """Make a further decision and learn from what the last one led to.

    Args:
        learners: Learners; the new state is in `learners.state[i]`.
        i: which of them.
        r_t: reward since the last decision.
        discount_t: what a reward from now on counts as seen from the last decision.
        uniforms: (3,) in [0, 1), see `epsilon_greedy`.

    Returns:
        the action chosen.
    """
    look(learners, i)
    action = epsilon_greedy(learners.values[i], learners.rates.epsilon, uniforms)
    update(learners, i, r_t + discount_t * learners.values[i, action] - learners.value[i])
    if learners.rates.lambda_ > 0.0:
        decay_traces(learners, i, discount_t * learners.rates.lambda_)
    remember(learners, i, action)
    weights = learners.weights[learners.table[i]]
    learners.value[i] = action_value(weights[action], learners.cells[i])
    return action


@compiled
def end(learners, i, r_t):
    """Learn from the end of an episode, r_t being the reward since the last decision."""
    if learners.action[i] != NO_ACTION:
        update(learners, i, r_t - learners.value[i])
    forget(learners, i)


@compiled
def decide(learners, i, reward, cycle, uniforms):
    """Make a decision, an episode's first or a further one, where every cycle pays `reward`.

    With gamma = 1 the reward since the last decision is `reward` times the cycles since then.

    Args:
        learners: Learners; the state is in `learners.state[i]`.
        i: which of them.
        reward: of one cycle.
        cycle: now, counted from kick-off.
        uniforms: (3,) in [0, 1), see `epsilon_greedy`.

    Returns:
        the action chosen.
    """
    if learners.action[i] == NO_ACTION:
        action = start(learners, i, uniforms)
    else:
        r_t, discount_t = pay(reward, learners.rates.gamma, cycle - learners.cycle[i])
        action = step(learners, i, r_t, discount_t, uniforms)
    learners.cycle[i] = cycle
    return action


@compiled
def resume(learners, i, cycle):
    """The last action continues: its reward counts from `cycle`, not from its decision."""
    if learners.action[i] != NO_ACTION:
        learners.cycle[i] = cycle


@compiled
def finish(learners, i, reward, cycle):
    """Learn from an episode's end at `cycle`, where every cycle paid `reward`."""
    end(learners, i, pay(reward, learners.rates.gamma, cycle - learners.cycle[i])[0])


@compiled
def pay(reward, gamma, num_cycles):
    """The discounted sum of `num_cycles` rewards, and the discount of what comes after them."""
    total, discount = 0.0, 1.0
    for _ in range(num_cycles):
        total += discount * reward
        discount *= gamma
    return total, discount


@compiled
def forget(learners, i):
    """Drop the last decision: what comes is a new episode, what came teaches nothing more."""
    clear_traces(learners, i)
    learners.action[i] = NO_ACTION


@compiled
def remember(learners, i, action):
    """Keep a decision until its consequences are known, and return the action."""
    learners.action[i] = action
    learners.value[i] = learners.values[i, action]
    for feature in range(learners.cells.shape[1]):
        learners.cells[i, feature] = learners.next_cells[i, feature]
    if learners.rates.lambda_ > 0.0:
        replace_traces(learners, i)
    return action


@compiled
def update(learners, i, delta):
    """Add alpha / num_active * delta * traces to the weights."""
    weights = learners.weights[learners.table[i]]
    amount = learners.rates.alpha / (weights.shape[1] * NUM_TILINGS) * delta
    if learners.rates.lambda_ == 0.0:
        add_to_active(weights[learners.action[i]], learners.cells[i], amount)
        return
    flat, traces, traced = weights.reshape(-1), learners.traces[i], learners.traced[i]
    for k in range(learners.num_traced[i]):
        flat[traced[k]] += amount * traces[traced[k]]


@compiled
def decay_traces(learners, i, decay):
    """Multiply the traces by `decay`; those that get less than `min_trace` become 0."""
    traces, traced = learners.traces[i], learners.traced[i]
    num_kept = 0
    for k in range(learners.num_traced[i]):
        place = traced[k]
        trace = traces[place] * decay
        if trace > 0.0 and trace >= learners.rates.min_trace:
            traces[place] = trace
            traced[num_kept] = place
            num_kept += 1
        else:
            traces[place] = 0.0
    learners.num_traced[i] = num_kept


@compiled
def replace_traces(learners, i):
    """Give the active tiles of the last action the trace 1, those of the others the trace 0."""
    traces, traced = learners.traces[i], learners.traced[i]
    num_actions, num_features, num_weights = learners.weights.shape[1:]
    for action in range(num_actions):
        for feature in range(num_features):
            row = (action * num_features + feature) * num_weights
            first = row + learners.cells[i, feature]
            for place in range(first, first + NUM_TILINGS):
                if action != learners.action[i]:
                    traces[place] = 0.0
                    continue
                if traces[place] == 0.0:
                    traced[learners.num_traced[i]] = place
                    learners.num_traced[i] += 1
                traces[place] = 1.0


@compiled
def clear_traces(learners, i):
    """Make all traces 0."""
    for k in range(learners.num_traced[i]):
        learners.traces[i, learners.traced[i, k]] = 0.0
    learners.num_traced[i] = 0


class LearnerSnapshot(NamedTuple):
    """What a learner knows and remembers at one moment; see `snapshot`."""

    weights: np.ndarray  # (num_actions, num_features, num_tiles * 32)
    rows: list[np.ndarray]  # of the other arrays of `Learners`


def snapshot(learners: Learners, i: int) -> LearnerSnapshot:
    """Take down what learner i knows and remembers, a copy."""
    rows = [array[i].copy() for array in _rows(learners)]
    return LearnerSnapshot(learners.weights[learners.table[i]].copy(), rows)


def restore(learners: Learners, i: int, snapshot: LearnerSnapshot) -> None:
    """Let learner i, of the same tiling and rates, resume from a snapshot.

    All who share its weights get those of the snapshot.

    Raises:
        AgentError: a snapshot of a learner of another shape.
    """
    shape = learners.weights.shape[1:]
    if snapshot.weights.shape != shape:
        raise AgentError(f"a snapshot of weights {snapshot.weights.shape}: they are {shape} here")
    learners.weights[learners.table[i]] = snapshot.weights
    for array, row in zip(_rows(learners), snapshot.rows, strict=True):
        array[i] = row


def _rows(learners: Learners) -> list[np.ndarray]:
    """The arrays with a row for each learner."""
    shared = ("weights", "table", "lows", "widths", "rates")
    return [getattr(learners, name) for name in Learners._fields if name not in shared]


def tiles_of(learners: Learners, i: int) -> np.ndarray:
    """Learner i's weights as (num_actions, num_features, num_tiles, num_tilings), a view."""
    weights: np.ndarray = learners.weights[learners.table[i]]
    return weights.reshape(*weights.shape[:2], -1, NUM_TILINGS)
