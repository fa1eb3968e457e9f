"""Settings: declared once, converted and checked when they are made, known by their names."""

import math

import attrs
import numpy as np
import pytest

from keepaway_sim.errors import KeepawayError, SettingError
from keepaway_sim.settings import (
    Range,
    build,
    changed,
    flat,
    group,
    required,
    same,
    setting,
    settings_of,
    table,
)
from keepaway_sim.world.config import Config


@attrs.frozen
class Inner:
    """For the tests."""

    alpha: float = setting(0.5, "step size", "1", "[0, 1]")
    count: int = setting(3, "of them", "", "[1, inf)")


@attrs.frozen
class Outer:
    """For the tests."""

    name: str = setting("red", "colour", choices=("red", "green"))
    angle_deg: float = setting(90.0, "of vision", "deg", "(0, 360]", was=("angle",))
    inner: Inner = group(Inner)
    loud: bool = setting(False, "or not")
    again: float = same(Inner, "alpha")


@attrs.frozen
class FromFile:
    """For the tests."""

    seed: int = required(int, "of all trials", "", "[0, 9]")


@pytest.mark.parametrize(
    ("values", "refusal"),
    [
        ({"alpha": 1.5}, "alpha=1.5: give a number from 0 to 1 [1]"),
        ({"alpha": math.nan}, "alpha=nan: give a number from 0 to 1 [1]"),
        ({"alpha": "1"}, "alpha='1': give a number from 0 to 1 [1]"),
        ({"alpha": True}, "alpha=True: give a number from 0 to 1 [1]"),
        ({"alpha": 10**400}, f"alpha={10**400}: give a number from 0 to 1 [1]"),
        ({"count": 0}, "count=0: give a whole number from 1"),
        ({"count": 1.5}, "count=1.5: give a whole number from 1"),
        ({"count": math.inf}, "count=inf: give a whole number from 1"),
        ({"angle_deg": 0.0}, "angle_deg=0.0: give a number above 0 and up to 360 [deg]"),
        ({"angle": 0}, "angle_deg=0.0: give a number above 0 and up to 360 [deg]"),
        ({"name": "blue"}, "name='blue': give red or green"),
        ({"name": 3}, "name=3: give red or green"),
        ({"loud": 2}, "loud=2: give true or false"),
        ({"again": 2}, "again=2.0: give a number from 0 to 1 [1]"),
        ({"cuont": 2}, "cuont: no such setting; did you mean count?"),
        ({"xyz": 2}, "xyz: no such setting"),
    ],
)
def test_what_is_refused_is_refused_by_name_value_and_way_out(values, refusal):
    with pytest.raises(SettingError) as error:
        build(Outer, values)
    assert str(error.value) == refusal
    assert isinstance(error.value, KeepawayError)


def test_values_are_converted_where_nothing_is_lost():
    made = build(Outer, {"alpha": 1, "count": 4.0, "angle": np.float32(45), "loud": 1})
    assert made == Outer(angle_deg=45.0, inner=Inner(1.0, 4), loud=True)
    assert [type(value) for value in flat(made).values()] == [str, float, float, int, bool, float]


def test_what_is_made_of_flat_values_gives_them_back():
    made = build(Outer, {"alpha": 0.25, "name": "green"})
    assert build(Outer, flat(made)) == made
    assert changed(made, {"alpha": 0.5, "name": "red"}) == Outer()
    assert changed(made, {"angle": 1.0}).inner == made.inner


@pytest.mark.parametrize(
    ("text", "inside", "outside"),
    [
        ("[0, 1]", [0, 0.5, 1], [-0.1, 1.1]),
        ("(0, 1)", [0.5], [0, 1]),
        ("[1, inf)", [1, 1e300], [0.999]),
        ("(-inf, 3]", [-1e300, 3], [3.1]),
    ],
)
def test_ranges_are_intervals(text, inside, outside):
    limits = Range.parse(text)
    assert all(limits.holds(value) for value in inside)
    assert not any(limits.holds(value) for value in outside)


@pytest.mark.parametrize("text", ["", "0, 1", "[0; 1]", "[a, b]"])
def test_a_range_that_is_none_is_a_mistake_of_the_declaration(text):
    with pytest.raises(ValueError, match=r"range|could not convert"):
        Range.parse(text)


def test_a_table_has_a_row_for_each_setting():
    assert table(Outer).splitlines()[2:] == [
        "| `name` | red |  | red, green | colour |",
        "| `angle_deg` | 90.0 | deg | > 0 to 360 | of vision |",
        "| `alpha` | 0.5 | 1 | 0 to 1 | step size |",
        "| `count` | 3 |  | 1 or more | of them |",
        "| `loud` | false |  |  | or not |",
        "| `again` | 0.5 | 1 | 0 to 1 | step size |",
    ]


def test_a_required_setting_is_checked_and_has_no_default():
    assert FromFile(3).seed == 3
    with pytest.raises(SettingError, match=r"^seed=10: give a whole number from 0 to 9$"):
        FromFile(10)
    with pytest.raises(TypeError, match="seed"):
        FromFile()
    assert table(FromFile).splitlines()[2:] == ["| `seed` | required |  | 0 to 9 | of all trials |"]


def test_every_constant_of_the_world_has_a_sentence_and_a_range():
    for name, declared in settings_of(Config).items():
        assert declared.text, name
        assert declared.kind in (bool, str) or math.isfinite(declared.range.high), name
        assert declared.kind is not float or declared.unit, name
