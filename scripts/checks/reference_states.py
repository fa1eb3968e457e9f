"""Draw the states that the level of an action's value is a mean over, and write them down.

    .venv/bin/python scripts/checks/reference_states.py

States in which a keeper has a choice, when keepers choose at random against hand-coded takers on
25 m x 25 m. They are drawn once and kept, so that a level means the same in every version.
"""

import sys

import numpy as np

from keepaway_agent.environments.gym import KeeperVectorEnv
from keepaway_transfer.parts import STATES_FILE

TASKS = ("2v1", "3v1", "3v2", "4v3", "5v4", "6v5")
FIELDS, STEPS, STATES = 20, 200, 250
SEED = 2005


def main() -> int:
    """Replace the file."""
    drawn = {task: states(task) for task in TASKS}
    np.savez_compressed(STATES_FILE, **drawn)  # type: ignore[arg-type]  # numpy's own stub
    print(f"{STATES_FILE}: {STATES} states each of {', '.join(TASKS)}")
    return 0


def states(task: str) -> np.ndarray:
    """(STATES, num_features) float32, drawn from the choices of many fields."""
    env = KeeperVectorEnv(FIELDS, task=task)
    random = np.random.default_rng(SEED)
    seen, _ = env.reset(seed=SEED)
    choices = [seen]
    for _ in range(STEPS):
        actions = random.integers(env.single_action_space.n, size=FIELDS)
        seen, _, ended, cut, _ = env.step(actions)
        choices.append(seen[~(ended | cut)])
    pool = np.concatenate(choices)
    chosen = random.choice(len(pool), STATES, replace=False)
    return np.asarray(pool[np.sort(chosen)], dtype=np.float32)


if __name__ == "__main__":
    sys.exit(main())
