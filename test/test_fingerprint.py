"""A fingerprint differs where machine code would, and only there."""

from __future__ import annotations

import enum
from collections import namedtuple
from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from etac_ros.maths.fingerprint import fingerprint

SOURCE = """
import math
import numpy as np
import lib
FACTOR = 0.5
TABLE = np.array([1.0, 2.0])
CHOICES = (1, 2)

def inner(x):
    return x * FACTOR

def other(x):
    return x

def outer(x, scale=2.0):
    steps = [inner(one) for one in (x, x)]
    if x in {"a", "b", "c", "d"}:
        return math.sin(x)
    return lib.deep.apply(steps[0]) + TABLE[0] + CHOICES[0]

def again(x):
    return again(x - 1.0) if x > 0.0 else outer(x)
"""
DEEP = """
LIMIT = 3.0
def apply(x):
    return min(x, LIMIT)
"""


MADE_TWICE = """
def multiply(k):
    def by(x):
        return x * k
    return by
one, two = multiply(1.0), multiply(2.0)
again = lambda x: one(x) + two(x) + chosen(x)
chosen = """
"""Functions of one name."""
NAMED = "P = namedtuple('P', '{} {}')\np = P(1.0, 2.0)\nagain = lambda x: p.a"
STRUCTURED = "t = np.zeros(1, dtype=[('{}', 'f8'), ('{}', 'f8')])\nagain = lambda x: t[0].a"
USED = "from numba import extending, float64, guvectorize, njit, types, vectorize, cfunc\n{}\nagain = lambda x: g(x)"


def made(source: str = SOURCE, deep: str = DEEP) -> dict[str, Any]:
    """The names of a module that has been made anew, with a package that it uses."""
    lib, below = ModuleType("lib"), ModuleType("lib.deep")
    exec(deep, vars(below))
    lib.deep = below  # type: ignore[attr-defined]
    names: dict[str, Any] = {"__name__": "own", "np": np, "enum": enum, "namedtuple": namedtuple}
    exec(source.replace("import lib", ""), names)
    names["lib"] = lib
    return names


def of(names: dict[str, Any]) -> str | None:
    return fingerprint(names["again"])


def test_it_is_the_same_for_the_same() -> None:
    assert of(made()) == of(made())


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("x * FACTOR", "x / FACTOR"),
        ("FACTOR = 0.5", "FACTOR = 0.25"),
        ("[1.0, 2.0]", "[1.0, 2.5]"),
        ("(1, 2)", "(2, 2)"),
        ("scale=2.0", "scale=1.0"),
        ("x - 1.0", "x - 0.5"),
        ("inner(one)", "other(one)"),
        ("math.sin", "math.cos"),
        ('"d"', '"e"'),
    ],
)
def test_it_differs_by_what_the_code_uses(before: str, after: str) -> None:
    assert before in SOURCE
    assert of(made(SOURCE.replace(before, after))) != of(made())


@pytest.mark.parametrize(("before", "after"), [("min", "max"), ("3.0", "4.0")])
def test_it_differs_by_what_modules_have_that_it_uses(before: str, after: str) -> None:
    assert of(made(deep=DEEP.replace(before, after))) != of(made())


@pytest.mark.parametrize("addition", ["UNUSED = 1\n", "def unused(x):\n    return x\n"])
def test_it_does_not_by_what_the_code_has_no_use_for(addition: str) -> None:
    assert of(made(SOURCE + addition, DEEP + addition)) == of(made())


def test_values_that_a_function_has_closed_over_count() -> None:
    def closing(value: Any) -> Callable[[], Any]:
        return lambda: value

    values = [1.0, 2.0, np.array([1.0]), np.array([1]), (1.0,), closing(1.0), closing(2.0), fingerprint]
    assert len({fingerprint(closing(value)) for value in values}) == len(values)
    assert fingerprint(closing(np.array([1.0]))) == fingerprint(closing(np.array([1.0])))


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("g = lambda a, b: len(b)\nagain = lambda x: g(1, x)", "g = lambda a, *b: len(b)\nagain = lambda x: g(1, x)"),
        (MADE_TWICE + "one", MADE_TWICE + "two"),
        (NAMED.format("a", "b"), NAMED.format("b", "a")),
        (STRUCTURED.format("a", "b"), STRUCTURED.format("b", "a")),
        *(
            (source.format("1"), source.format("2"))
            for source in [
                "class Mode(enum.IntEnum):\n    A = {}\nagain = lambda x: x + Mode.A",
                "d = {{'a': np.arange(2000) * {}}}\nagain = lambda x: d['a']",
                USED.format("g = vectorize(lambda x: x * {})"),
                USED.format("g = guvectorize(['(float64[:], float64[:])'], '(n)->(n)')(lambda x, o: o.fill({}))"),
                USED.format("g = cfunc('float64(float64)')(lambda x: x * {})"),
                USED.format("g = lambda x: None\nextending.overload(g)(lambda x: lambda x: x * {})"),
                USED.format("g = extending.intrinsic(lambda context, x: (x(x), {}))"),
                USED.format("g = njit(fastmath={} == 1)(lambda x: x)"),
            ]
        ),
    ],
)
def test_it_differs_by_all_that_numba_builds_in(before: str, after: str) -> None:
    first, second = of(made(before)), of(made(after))
    assert None not in (first, second)
    assert first != second
    assert of(made(before)) == first


@pytest.mark.parametrize("value", ["Own()", "Own", "[].append", "np.array([None])"])
def test_there_is_none_of_what_is_not_known_through_and_through(value: str) -> None:
    assert of(made(f"class Own:\n    value = 1.0\nk = {value}\nagain = lambda x: k")) is None
