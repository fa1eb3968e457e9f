"""What transfer is measured by, from the durations of one trial's episodes in playing order.

Time is simulated time: a trial's hours are the sum of its episodes' durations. The measures are
those of Taylor & Stone's survey (JMLR 10, 2009): jumpstart, asymptotic performance, total reward
(area), transfer ratio, time to threshold. A trial that stopped before it reached the threshold is
censored: it keeps the time it ran, marked as not having reached it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

SECONDS_PER_HOUR = 3600.0
WINDOW = 1000  # episodes over which the paper averages the hold time
FIRST_EPISODES = 100  # what counts as the start of a trial

Floats = NDArray[np.float64]


class TimeToThreshold(NamedTuple):
    """When the windowed mean first exceeded the threshold; if never, how long the trial ran."""

    reached: bool
    episodes: int
    hours: float


def hours(durations: ArrayLike) -> float:
    """Simulated hours of a run of episodes with these durations [s]."""
    return float(np.sum(durations)) / SECONDS_PER_HOUR


def windowed_mean(durations: ArrayLike, window: int = WINDOW) -> Floats:
    """Mean of each `window` successive values; entry i is over values i .. i + window - 1.

    >>> windowed_mean([1.0, 2.0, 3.0, 7.0], window=2)
    array([1.5, 2.5, 5. ])
    """
    sums = np.concatenate([[0.0], np.cumsum(durations, dtype=np.float64)])
    means: Floats = (sums[window:] - sums[:-window]) / window
    return means


def time_to_threshold(
    durations: ArrayLike, threshold: float, window: int = WINDOW
) -> TimeToThreshold:
    """When the mean of the last `window` durations [s] was first greater than `threshold` [s].

    >>> time_to_threshold([1800.0, 1800.0, 3600.0, 3600.0], threshold=2000.0, window=2)
    TimeToThreshold(reached=True, episodes=3, hours=2.0)
    >>> time_to_threshold([1800.0, 1800.0], threshold=2000.0, window=2)
    TimeToThreshold(reached=False, episodes=2, hours=1.0)
    """
    durations = np.asarray(durations, dtype=np.float64)
    above = windowed_mean(durations, window) > threshold
    episodes = window + int(np.argmax(above)) if above.any() else len(durations)
    return TimeToThreshold(bool(above.any()), episodes, hours(durations[:episodes]))


def initial_performance(durations: ArrayLike, episodes: int = FIRST_EPISODES) -> float:
    """Mean duration [s] of the first episodes; the jumpstart is the difference of two of these."""
    return float(np.mean(np.asarray(durations, dtype=np.float64)[:episodes]))


def asymptotic_performance(durations: ArrayLike, window: int = WINDOW) -> float:
    """Mean duration [s] of the last `window` episodes played."""
    return float(np.mean(np.asarray(durations, dtype=np.float64)[-window:]))


def learning_curve(
    durations: ArrayLike,
    at_hours: ArrayLike,
    window: int = WINDOW,
    least: int = 1,
    block: int = 1,
) -> Floats:
    """Mean duration [s] of the last `window` episodes that ended by each of `at_hours`.

    At the start it is over fewer episodes, but `least`; NaN where fewer ended and after the trial
    stopped. Durations may be sums of `block` successive episodes each; the mean is then over the
    blocks that ended.
    """
    durations = np.asarray(durations, dtype=np.float64)
    sums = np.concatenate([[0.0], np.cumsum(durations)])
    at_seconds = np.asarray(at_hours, dtype=np.float64) * SECONDS_PER_HOUR
    finished = np.searchsorted(sums[1:], at_seconds, side="right")
    averaged = np.minimum(finished, window // block)
    known = (finished * block >= least) & (finished > 0) & (at_seconds <= sums[-1])
    totals = sums[finished] - sums[finished - averaged]
    return np.where(known, totals / np.maximum(averaged * block, 1), np.nan)


def total_reward(
    durations: ArrayLike, horizon: float, window: int = WINDOW, points: int = 200, block: int = 1
) -> float:
    """Area under the learning curve from 0 to `horizon` hours [s h]; NaN if the trial ran for less.

    The curve is read at the middle of `points` equal spans; before the first episode (or block of
    episodes) ended it is taken to be that one's mean duration.
    """
    middles = (np.arange(points) + 0.5) * horizon / points
    curve = learning_curve(durations, middles, window, block=block)
    first = float(np.asarray(durations, dtype=np.float64)[0])
    curve[middles * SECONDS_PER_HOUR < first] = first / block
    return float(np.mean(curve)) * horizon


def transfer_ratio(transferred: float, scratch: float) -> float:
    """Total reward with transfer over that without, less one: 0 is no gain.

    >>> transfer_ratio(transferred=120.0, scratch=100.0)
    0.2
    """
    return (transferred - scratch) / scratch
