"""How a match is going, as diagnostic messages (diagnostic_msgs)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from keepaway_sim.match.roster import Seat

RECOVERY = 10.0  # [s] without anything new after which a player's warning ends


def diagnostics(
    simulator: DiagnosticStatus, players: Iterable[DiagnosticStatus], match_id: int, stamp: Time
) -> DiagnosticArray:
    """All statuses of a match; `match_id` is their hardware_id, `stamp` the wall's time."""
    array = DiagnosticArray(status=[simulator, *players])
    for status in array.status:
        status.hardware_id = str(match_id)
    array.header.stamp = stamp
    return array


def simulator_status(
    namespace: str, state: str, figures: dict[str, str], strays: list[str]
) -> DiagnosticStatus:
    """The simulator's own.

    Args:
        namespace: of the match.
        state: of the match, in words.
        figures: of the match, by name.
        strays: topics of its own that another node publishes, too.
    """
    return DiagnosticStatus(
        level=DiagnosticStatus.WARN if strays else DiagnosticStatus.OK,
        name=f"{namespace}simulator",
        message=state,
        values=[
            *(KeyValue(key=key, value=value) for key, value in figures.items()),
            KeyValue(key="published_by_others", value=" ".join(strays)),
        ],
    )


class Troubles:
    """Who had trouble lately: a player's status recovers once nothing new is counted."""

    def __init__(self) -> None:
        """No player yet."""
        self._seen: dict[str, tuple[dict[str, int], float]] = {}  # counts, and since when

    def player_statuses(
        self, namespace: str, seats: Sequence[Seat], num_answering: Sequence[int], now: float
    ) -> list[DiagnosticStatus]:
        """One status for every player.

        Args:
            namespace: of the match.
            seats: the players.
            num_answering: how many nodes answer for each.
            now: the monotonic clock [s].
        """
        return [
            _of_player(namespace, seat, num, self._is_recent(seat, now))
            for seat, num in zip(seats, num_answering, strict=True)
        ]

    def _is_recent(self, seat: Seat, now: float) -> bool:
        """Whether something was counted within the last `RECOVERY`."""
        counts = _counts(seat)
        known, since = self._seen.get(seat.name, (dict.fromkeys(counts, 0), -math.inf))
        if counts != known:
            since = now
        self._seen[seat.name] = counts, since
        return now - since < RECOVERY


def _counts(seat: Seat) -> dict[str, int]:
    return {"late": seat.late, "missed": seat.missed, "rejected": seat.rejected}


def _of_player(
    namespace: str, seat: Seat, num_answering: int, has_trouble: bool
) -> DiagnosticStatus:
    if not seat.present:
        level, message = DiagnosticStatus.ERROR, "unresponsive"
    elif num_answering > 1:
        level, message = DiagnosticStatus.WARN, f"{num_answering} nodes answer for it"
    elif has_trouble:
        level, message = DiagnosticStatus.WARN, "plays, with trouble"
    else:
        level, message = DiagnosticStatus.OK, "plays"
    return DiagnosticStatus(
        level=level,
        name=f"{namespace}{seat.name}",
        message=message,
        values=[KeyValue(key=key, value=str(count)) for key, count in _counts(seat).items()],
    )
