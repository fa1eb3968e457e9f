"""What may be played, and how what may not is refused."""

import pytest

from keepaway_sim.errors import KeepawayError
from keepaway_sim.task import MAX_TEAM_SIZE, Role, Task


@pytest.mark.parametrize("keepers", range(2, MAX_TEAM_SIZE + 1))
@pytest.mark.parametrize("takers", range(1, MAX_TEAM_SIZE + 1))
def test_any_two_or_more_keepers_play_any_takers(keepers, takers):
    task = Task.parse(f"{keepers}v{takers}", "30x20.5")
    assert (task.num_keepers, task.num_takers) == (keepers, takers)
    assert (task.field_length, task.field_width) == (30.0, 20.5)
    assert task == Task.parse(task.name, task.field)
    assert task.num_players == len(task.player_names) == keepers + takers
    roles = [task.role(player) for player in range(task.num_players)]
    assert roles == [Role.KEEPER] * keepers + [Role.TAKER] * takers


def test_players_are_named_in_match_order():
    names = ("keeper_1", "keeper_2", "keeper_3", "taker_1", "taker_2")
    assert Task.parse("3v2").player_names == names


@pytest.mark.parametrize(
    ("name", "field", "says"),
    [
        ("1v1", "25x25", ["num_keepers=1", "2 to 11"]),
        ("3v0", "25x25", ["num_takers=0", "1 to 11"]),
        ("12v2", "25x25", ["num_keepers=12", "2 to 11"]),
        ("3v99", "25x25", ["num_takers=99", "1 to 11"]),
        ("3 against 2", "25x25", ["'3 against 2'", "3v2"]),
        ("v2", "25x25", ["'v2'", "3v2"]),
        ("-3v2", "25x25", ["'-3v2'", "3v2"]),
        ("3v2", "25", ["'25'", "25x25"]),
        ("3v2", "25x-25", ["'25x-25'", "25x25"]),
        ("3v2", "5x25", ["field_length=5", "10 to 100 [m]"]),
        ("3v2", "25x1000", ["field_width=1000", "10 to 100 [m]"]),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_value_and_the_way_out(name, field, says):
    with pytest.raises(KeepawayError) as refusal:
        Task.parse(name, field)
    assert all(part in str(refusal.value) for part in says)


@pytest.mark.parametrize("side", [float("nan"), float("inf"), -25.0])
def test_a_field_has_finite_sides(side):
    with pytest.raises(KeepawayError, match=r"field_width=.*give a number from 10 to 100 \[m\]"):
        Task(field_width=side)
