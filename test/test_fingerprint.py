"""A fingerprint differs where machine code would, and only there."""

from __future__ import annotations

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


def made(source: str = SOURCE, deep: str = DEEP) -> dict[str, Any]:
    """The names of a module that has been made anew, with a package that it uses."""
    lib, below = ModuleType("lib"), ModuleType("lib.deep")
    exec(deep, vars(below))
    lib.deep = below  # type: ignore[attr-defined]
    names: dict[str, Any] = {"__name__": "own"}
    exec(source.replace("import lib", ""), names)
    names["lib"] = lib
    return names


def of(names: dict[str, Any]) -> str:
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
