"""How a match is going, as diagnostic messages (diagnostic_msgs)."""

from __future__ import annotations

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from keepaway_sim.match.roster import Seat


def diagnostics(
    namespace: str,
    stamp: Time,
    state: str,
    figures: dict[str, str],
    seats: list[Seat],
    num_answering: list[int],
) -> DiagnosticArray:
    """One status for the simulator, and one for every player.

    Args:
        namespace: of the match.
        stamp: wall time.
        state: of the match, in words.
        figures: of the match, by name.
        seats: the players.
        num_answering: how many nodes answer for each.
    """
    simulator = DiagnosticStatus(
        level=DiagnosticStatus.OK,
        name=f"{namespace}simulator",
        message=state,
        values=[KeyValue(key=key, value=value) for key, value in figures.items()],
    )
    players = (
        _of_player(namespace, seat, num) for seat, num in zip(seats, num_answering, strict=True)
    )
    array = DiagnosticArray(status=[simulator, *players])
    array.header.stamp = stamp
    return array


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
