"""How sure a mean is: 95 % intervals, for the examples' figures."""

import numpy as np
from scipy import stats


def bootstrap(values: np.ndarray) -> tuple[float, float]:
    """Of the mean of (num_episodes,) values of any distribution: its ends."""
    picked = np.random.default_rng(0).integers(len(values), size=(10_000, len(values)))
    low, high = np.percentile(values[picked].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def half_width(values: np.ndarray) -> np.ndarray:
    """Of the mean over the first axis, the trials (Student's t): half of it."""
    num_trials = len(values)
    if num_trials < 2:
        return np.zeros(values.shape[1:])
    sem = values.std(axis=0, ddof=1) / np.sqrt(num_trials)
    return np.asarray(stats.t.ppf(0.975, num_trials - 1) * sem)
