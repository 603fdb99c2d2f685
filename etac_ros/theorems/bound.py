"""A statement of a paper beside a run: what it bounds, by how much, and whether that says anything."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from etac_ros.parameters import FloatArray

_ROUNDING = 1e-9
"""Part of the larger side by which an inequality may fail before it counts as violated."""


class Standing(StrEnum):
    """What becomes of a statement."""

    HOLDS = "holds"
    VACUOUS = "vacuous"
    """It holds, and would hold whatever the law did."""
    VIOLATED = "violated"


@dataclass(frozen=True)
class Bound:
    """One statement of a theorem or its proof.

    Attributes
    ----------
    equation
        Number in the paper.
    says
        What is bounded, in words or symbols.
    bound, measured
        The figure on either side; of an inequality at every sample, the share of samples at which it is to hold (1)
        and does.
    unit
        Of both; empty where they have none.
    standing
        What becomes of it.
    note
        What has to be known to read it.
    """

    equation: str
    says: str
    bound: float
    measured: float
    unit: str
    standing: Standing
    note: str = ""


@dataclass(frozen=True)
class Lyapunov:
    """The Lyapunov function of a theorem along a run.

    Attributes
    ----------
    equation
        Number in the paper.
    times_s
        Of the samples.
    values
        The function, shape (n,).
    ceiling
        What the theorem bounds it by at each sample, shape (n,).
    """

    equation: str
    times_s: FloatArray
    values: FloatArray
    ceiling: FloatArray


@dataclass(frozen=True)
class Theorems:
    """All that was computed of one paper along one run."""

    bounds: tuple[Bound, ...]
    lyapunov: Lyapunov


def at_most(
    equation: str, says: str, bound: float, measured: float, unit: str = "", trivial: float = np.inf, note: str = ""
) -> Bound:
    """An upper bound; vacuous from ``trivial`` on, which nothing can exceed."""
    if measured > bound * (1.0 + _ROUNDING):
        standing = Standing.VIOLATED
    else:
        standing = Standing.VACUOUS if bound >= trivial else Standing.HOLDS
    return Bound(equation, says, bound, measured, unit, standing, note)


def at_least(
    equation: str, says: str, bound: float, measured: float, unit: str = "", trivial: float = 0.0, note: str = ""
) -> Bound:
    """A lower bound; vacuous up to ``trivial``, below which nothing can fall."""
    if measured < bound * (1.0 - _ROUNDING):
        standing = Standing.VIOLATED
    else:
        standing = Standing.VACUOUS if bound <= trivial else Standing.HOLDS
    return Bound(equation, says, bound, measured, unit, standing, note)


def everywhere(equation: str, says: str, left: FloatArray, right: FloatArray, note: str = "") -> Bound:
    """An inequality ``left <= right`` at every sample: the share of samples at which it holds."""
    slack = _ROUNDING * np.maximum(np.abs(left), np.abs(right))
    share = float(np.mean(left <= right + slack)) if left.size else 1.0
    return Bound(equation, says, 1.0, share, "of samples", Standing.HOLDS if share == 1.0 else Standing.VIOLATED, note)


def ceiling_of(start: float, rate: float, push: float, times_s: FloatArray) -> FloatArray:
    """What ``V' <= -rate V + push`` bounds ``V`` by: ``(V(0) - push / rate) exp(-rate t) + push / rate``."""
    return np.asarray((start - push / rate) * np.exp(-rate * times_s) + push / rate)
