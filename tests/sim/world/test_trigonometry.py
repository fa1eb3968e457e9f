"""Sines, cosines and directions without a C library."""

import ast
import math
import random

import numpy as np
import pytest

from keepaway_sim.world import machine_code, trigonometry
from keepaway_sim.world.trigonometry import bearing, unit

ANGLES = [*np.linspace(-10.0, 10.0, 40_001), *(k * math.pi / 4 for k in range(-40, 41))]
EXACT = {"degrees", "float32", "floor", "inf", "int64", "isnan", "nan", "pi", "radians", "sqrt"}
"""What of `math` and `np` gives the same bits everywhere."""


def test_unit_vectors_are_right_to_the_last_bit_but_one() -> None:
    off = [max(abs(x - math.cos(a)), abs(y - math.sin(a))) for a in ANGLES for x, y in [unit(a)]]
    assert max(off) <= 2.3e-16


def test_unit_vectors_of_many_turns_are_as_good_as_their_angle() -> None:
    rng = random.Random(1)
    for _ in range(10_000):
        angle = rng.uniform(-1e6, 1e6)
        assert unit(angle) == pytest.approx((math.cos(angle), math.sin(angle)), abs=1e-10, rel=0)


def test_directions_are_right_to_fourteen_digits() -> None:
    off = [abs(bearing(3.0 * math.cos(a), 3.0 * math.sin(a)) - _wrapped(a)) for a in ANGLES]
    assert max(min(a, 2.0 * math.pi - a) for a in off) < 2e-14


@pytest.mark.parametrize(
    ("x", "y", "direction"),
    [(2, 0, 0), (0, 2, math.pi / 2), (-2, 0, math.pi), (0, -2, -math.pi / 2), (0, 0, 0)],
)
def test_directions_along_the_axes_are_exact(x: float, y: float, direction: float) -> None:
    assert bearing(float(x), float(y)) == direction


def test_polynomial_is_the_nearest_to_atan_that_has_so_many_terms() -> None:
    """Its error is as great at seventeen places, with signs in turn."""
    t = np.linspace(0.0, 1.0, 200_001)[1:]
    terms = np.array(trigonometry._ATAN, dtype=np.longdouble)
    t = t.astype(np.longdouble)
    off = t * np.polynomial.polynomial.polyval(t * t, terms) - np.arctan(t)
    turns = np.flatnonzero(np.diff(np.sign(off)))
    greatest = [np.abs(part).max() for part in np.split(off, turns + 1)]
    assert len(greatest) == 17
    assert np.ptp(greatest) < 0.02 * np.max(greatest)
    assert np.max(greatest) < 1.5e-14


def test_compiled_rules_ask_no_c_library_for_anything_that_differs() -> None:
    found = set()
    for source in machine_code.sources():
        for function in ast.walk(ast.parse(source.read_text())):
            if isinstance(function, ast.FunctionDef) and _is_compiled(function):
                found |= {(source.name, used) for used in _used_of_math(function)}
    assert {(name, used) for name, used in found if used not in EXACT} == set()


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2.0 * math.pi)


def _is_compiled(function: ast.FunctionDef) -> bool:
    return any(
        isinstance(mark, ast.Name) and mark.id.startswith("compiled")
        for mark in function.decorator_list
    )


def _used_of_math(function: ast.FunctionDef) -> set[str]:
    """Names behind `math.` and `np.`, and ** between two numbers that are not known."""
    attributes = (node for node in ast.walk(function) if isinstance(node, ast.Attribute))
    return {
        node.attr
        for node in attributes
        if isinstance(node.value, ast.Name) and node.value.id in ("math", "np")
    } | {"**" for node in ast.walk(function) if isinstance(node, ast.Pow)}
