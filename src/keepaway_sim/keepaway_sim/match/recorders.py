"""How far recorders have come, so that a match can be played no faster than they follow."""

from __future__ import annotations

from keepaway_sim.wire.messages import CYCLE_NS, read_time

LARGEST_LAG = 50  # [cycles] that a recorder may be behind


class RecorderProgress:
    """The simulated time that each recorder has reached, by its publisher's identity."""

    def __init__(self, is_waited_for: bool) -> None:
        """No recorder is known; with `is_waited_for` a match needs at least one."""
        self._is_waited_for = is_waited_for
        self._reached: dict[bytes, int] = {}  # [ns]

    @property
    def num_reporting(self) -> int:
        """How many of them are known."""
        return len(self._reached)

    def take(self, data: bytes, sender: bytes) -> None:
        """Take a builtin_interfaces/Time's bytes from a recorder.

        Raises:
            struct.error: too few bytes.
        """
        self._reached[sender] = read_time(data)

    def is_missing(self, num_recorders: int) -> bool:
        """Whether one of the recorders in the graph, or the first of all, is still to report."""
        return self._is_waited_for and len(self._reached) < max(1, num_recorders)

    def lag(self, now_ns: int) -> int:
        """How far the slowest one is behind [cycles]; 0 where none is waited for."""
        if not self._is_waited_for or not self._reached:
            return 0
        return (now_ns - min(self._reached.values())) // CYCLE_NS

    def is_behind(self, now_ns: int) -> bool:
        """Whether one of them is too far behind to play on."""
        return self.lag(now_ns) > LARGEST_LAG

    def time_out(self, now_ns: int) -> None:
        """Wait no longer for those that are too far behind."""
        oldest = now_ns - LARGEST_LAG * CYCLE_NS
        self._reached = {who: time for who, time in self._reached.items() if time >= oldest}
