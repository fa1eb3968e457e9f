"""Records reach compiled functions whole, however deep their fields lie."""

from typing import NamedTuple

import numpy as np
import pytest
from numba.core.errors import TypingError

from keepaway_sim.world.compiled import Kernel, compiled, compiled_apart
from keepaway_sim.world.passing import record


class _Point(NamedTuple):
    x: float
    y: float


@record
class _Inner(NamedTuple):
    flag: bool
    numbers: np.ndarray
    point: _Point


@record
class _Outer(NamedTuple):
    rows: int
    inner: _Inner
    total: np.ndarray


def _made(flag: bool = True) -> _Outer:
    inner = _Inner(flag, np.arange(6.0).reshape(2, 3), _Point(0.5, 0.25))
    return _Outer(2, inner, np.zeros(1))


@compiled
def _row_sum(inner, row):
    result = inner.point.x if inner.flag else inner.point.y
    for k in range(inner.numbers.shape[1]):
        result += inner.numbers[row, k]
    return result


@compiled_apart
def _add_up(outer, times):
    for row in range(outer.rows):
        outer.total[0] += times * _row_sum(outer.inner, row)
    return outer.inner.numbers.shape[0]


@compiled_apart
def _asks_for_none(outer):
    return outer.inner.nothing


@pytest.mark.parametrize(("flag", "total"), [(True, 32.0), (False, 31.0)])
def test_fields_are_read_and_their_arrays_are_written(flag: bool, total: float) -> None:
    outer = _made(flag)
    assert _add_up(outer, 2.0) == 2
    assert outer.total[0] == total


def test_a_kernel_freezes_a_record() -> None:
    first, second = Kernel(_add_up, _made()), Kernel(_add_up, other := _made(False))
    first(1.0)
    second(1.0)
    second(1.0)
    assert other.total[0] == 31.0


def test_a_field_that_no_record_has_does_not_compile() -> None:
    with pytest.raises(TypingError, match="nothing"):
        _asks_for_none(_made())
