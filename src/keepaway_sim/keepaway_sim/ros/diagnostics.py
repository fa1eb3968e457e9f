"""How a match is going, as diagnostic messages (diagnostic_msgs)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from keepaway_sim.match.roster import Seat


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


def player_statuses(
    namespace: str, seats: Sequence[Seat], num_answering: Sequence[int]
) -> list[DiagnosticStatus]:
    """One for every player; `num_answering` nodes answer for each."""
    return [_of_player(namespace, *each) for each in zip(seats, num_answering, strict=True)]


def _of_player(namespace: str, seat: Seat, num_answering: int) -> DiagnosticStatus:
    if not seat.present:
        level, message = DiagnosticStatus.ERROR, "missing"
    elif num_answering > 1:
        level, message = DiagnosticStatus.WARN, f"{num_answering} nodes answer for it"
    elif seat.missed or seat.late or seat.rejected:
        level, message = DiagnosticStatus.WARN, "plays, with trouble"
    else:
        level, message = DiagnosticStatus.OK, "plays"
    counts = {"late": seat.late, "missed": seat.missed, "rejected": seat.rejected}
    return DiagnosticStatus(
        level=level,
        name=f"{namespace}{seat.name}",
        message=message,
        values=[KeyValue(key=key, value=str(count)) for key, count in counts.items()],
    )
