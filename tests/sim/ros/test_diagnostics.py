"""Diagnostics: a player's trouble is reported, and is over once nothing new is counted."""

from diagnostic_msgs.msg import DiagnosticStatus

from keepaway_sim.match.roster import Roster
from keepaway_sim.ros.diagnostics import RECOVERY, Troubles
from keepaway_sim.task import Task
from keepaway_sim.world.config import Config

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


def test_a_status_recovers() -> None:
    seats = Roster(Task.parse("3v2"), Config(), 1).seats
    troubles = Troubles()

    def levels(now: float) -> list[bytes]:
        statuses = troubles.player_statuses("/a/", seats, [1] * len(seats), now)
        assert [status.name for status in statuses] == [f"/a/{seat.name}" for seat in seats]
        return [status.level for status in statuses]

    assert levels(0.0) == [ERROR] * 5  # nobody has come
    for seat in seats:
        seat.present = True
    assert levels(1.0) == [OK] * 5
    seats[1].missed += 1
    assert levels(2.0) == [OK, WARN, OK, OK, OK]
    seats[1].late += 1
    assert levels(2.0 + RECOVERY / 2) == [OK, WARN, OK, OK, OK]
    assert levels(2.0 + RECOVERY) == [OK, WARN, OK, OK, OK]  # counted from the last of them
    assert levels(2.0 + 1.5 * RECOVERY) == [OK] * 5
    seats[1].present = False
    assert levels(2.0 + 1.5 * RECOVERY) == [OK, ERROR, OK, OK, OK]
    seats[1].present = True
    assert levels(2.0 + 1.5 * RECOVERY) == [OK] * 5


def test_two_nodes_for_one_player_are_a_warning() -> None:
    seats = Roster(Task.parse("3v2"), Config(), 1).seats
    for seat in seats:
        seat.present = True
    statuses = Troubles().player_statuses("/", seats, [1, 2, 1, 1, 1], 0.0)
    assert [status.level for status in statuses] == [OK, WARN, OK, OK, OK]
    assert statuses[1].message == "2 nodes answer for it"
