"""What the scoreboard shows of a match."""

import io
from collections.abc import Iterator

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

from keepaway_msgs.msg import Episode
from keepaway_sim.nodes.scoreboard import Scoreboard
from keepaway_sim.task import Outcome


class Terminal(io.StringIO):
    """Takes what is written as a terminal would."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def context(ros_domain: int) -> Iterator[rclpy.Context]:
    made = rclpy.Context()
    rclpy.init(context=made, domain_id=ros_domain)
    yield made
    rclpy.shutdown(context=made)


def play(board: Scoreboard, count: int) -> None:
    for number in range(count):
        episode = Episode(number=number, cycles=50, duration=5.0, outcome=Outcome.TAKEN_AWAY)
        board._on_episode(episode)
        board.show()
    board.conclude()


def test_a_file_gets_lines(context: rclpy.Context) -> None:
    out = io.StringIO()
    board = Scoreboard(4, out=out, context=context)
    play(board, 3)
    first, last = out.getvalue().splitlines()
    assert first == "1 episode, last 1 held 5.00 s, no simulator was found"
    assert last == "3 episodes, last 3 held 5.00 s, no simulator was found"


def test_a_terminal_gets_one_bar(context: rclpy.Context) -> None:
    out = Terminal()
    play(Scoreboard(4, out=out, context=context), 3)
    last = out.getvalue().split("\r")[-1]
    assert "3/4" in last
    assert "last 3 held 5.00 s" in last
    assert out.getvalue().count("\n") == 1


def test_what_others_publish_in_a_matchs_name_is_shown_as_plain_text(
    context: rclpy.Context,
) -> None:
    out = io.StringIO()
    board = Scoreboard(1, out=out, context=context, match_id=7)
    odd = [KeyValue(key="late", value=text) for text in ("2", "\x1b[31m", "1e9", "9" * 5000)]
    pace = [KeyValue(key="cycles_per_second", value="\x1b[2J")]
    status = [
        DiagnosticStatus(name="/simulator", hardware_id="7", message="\x1b[31m\n", values=pace),
        DiagnosticStatus(name="/keeper_1", hardware_id="7", values=odd[1:] + odd[:1]),
    ]
    board._on_diagnostics(DiagnosticArray(status=status))
    assert board.troubles == {"keeper_1": {"late": 2}}
    board._on_episode(Episode(match_id=7, cycles=50, duration=5.0, outcome=Outcome.TAKEN_AWAY))
    board.conclude()
    assert all(line.isprintable() for line in out.getvalue().splitlines())
    assert "\\x1b[2J cycles/s" in out.getvalue()


def test_nothing_is_shown_before_an_episode_has_ended(context: rclpy.Context) -> None:
    out = Terminal()
    board = Scoreboard(0, out=out, context=context)
    board.show()
    board.conclude()
    assert out.getvalue() == ""


def test_the_match_in_numbers(context: rclpy.Context) -> None:
    board = Scoreboard(2, out=io.StringIO(), context=context)
    play(board, 2)
    numbers = board.summary()
    assert (numbers["episodes"], numbers["mean_duration_s"]) == (2, 5.0)
    assert (numbers["episode_cycles"], board.next_episode) == ([50, 50], 2)
