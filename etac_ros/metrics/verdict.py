"""What becomes of a published figure: one rule for every table, so that nobody types a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field

from etac_ros.scenario.schema import FigureKind

_LEAST, _MOST = 0.02, 0.10
_SDS = 2.0
RULE = (
    "A figure stands beside two: the one that the run gave, and the mean of runs with dispersed starts. What counts is "
    "the larger distance of the two from the paper's. **reproduced**: it is within two standard deviations of the "
    "dispersed runs, but these count as no less than 2 % and no more than 10 % of the paper's figure, so that neither "
    "a wide spread helps nor a narrow one harms; or it rounds to the digits that are printed. **near**: within twice "
    "that, or 10 %. **not reproduced**: neither. Per cent of a percentage are of what is missing to 100: 97.50 % fewer "
    "messages are 2.50 % that are left. A **limit** is kept or not, to the last bit. **fitted** and **constructed** "
    "figures come out because something was chosen so, or prescribed: they say nothing, and where they do not come out "
    "they are **missed**. **not testable**: a run does not have the figure, or the scenario declares it otherwise than "
    "when the dispersed runs were stored."
)
"""The rule in words; the tests hold it against the code."""


class Verdict(StrEnum):
    """What becomes of a published figure."""

    REPRODUCED = "reproduced"
    KEPT = "kept"
    NEAR = "near"
    NOT_REPRODUCED = "not reproduced"
    NOT_KEPT = "not kept"
    FITTED = "fitted"
    CONSTRUCTED = "constructed"
    MISSED = "missed"
    NOT_TESTABLE = "not testable"


GOOD = frozenset({Verdict.REPRODUCED, Verdict.KEPT, Verdict.FITTED, Verdict.CONSTRUCTED})
"""Verdicts of figures that come out, for whatever reason."""


class Spread(BaseModel):
    """A figure over runs with dispersed starts."""

    model_config = ConfigDict(defer_build=True, extra="forbid", frozen=True)

    mean: float
    sd: float = Field(description="standard deviation of the sample")
    p5: float
    p95: float
    runs: int = Field(description="that have the figure")


@dataclass(frozen=True)
class Paper:
    """A figure of the paper as it is judged.

    Attributes
    ----------
    printed
        Its digits as they stand there.
    kind
        What it says when it is met.
    changed
        In what it is declared otherwise than when its spread was stored; empty if in nothing.
    """

    printed: str
    kind: FigureKind
    changed: str = ""


@dataclass(frozen=True)
class Judgement:
    """What becomes of a figure, and how far it is from the paper's.

    Attributes
    ----------
    verdict
        By the rule.
    sds
        Distance of the mean of the dispersed runs from the paper's figure, in their standard deviations; None without
        a spread.
    percent
        Distance of the measured figure from the paper's, in per cent of it; None where that is zero, and without one.
    """

    verdict: Verdict
    sds: float | None
    percent: float | None


def half_unit(printed: str) -> float:
    """Half a unit in the last digit of a figure as it is printed: 0.5 for 84, 0.005 for 2.50."""
    exponent = Decimal(printed).as_tuple().exponent
    assert isinstance(exponent, int)
    return float(Decimal(5).scaleb(exponent - 1))


def judge(paper: Paper, measured: float | None, spread: Spread | None) -> Judgement:
    """Apply the rule.

    Parameters
    ----------
    paper
        The published figure.
    measured
        What the run gave; None if it does not have the figure.
    spread
        Over dispersed runs; None where none are stored.
    """
    value = float(paper.printed)
    sds = None if spread is None or spread.sd == 0.0 else (spread.mean - value) / spread.sd
    if measured is None:
        return Judgement(Verdict.NOT_TESTABLE, sds, None)
    whole = abs(100.0 - value) if paper.kind is FigureKind.PERCENTAGE else abs(value)
    percent = 100.0 * (measured - value) / whole if whole else None
    if paper.changed:
        return Judgement(Verdict.NOT_TESTABLE, sds, percent)
    found = (measured,) if spread is None else (measured, spread.mean)
    if paper.kind is FigureKind.LIMIT:
        return Judgement(Verdict.KEPT if max(found) <= value else Verdict.NOT_KEPT, sds, percent)
    distance = max(abs(one - value) for one in found)
    width = 0.0 if spread is None else _SDS * spread.sd
    reach = max(half_unit(paper.printed), min(max(width, _LEAST * whole), _MOST * whole))
    return Judgement(_by_distance(paper.kind, distance, reach, max(2.0 * reach, _MOST * whole)), sds, percent)


def _by_distance(kind: FigureKind, distance: float, reach: float, far: float) -> Verdict:
    if kind in (FigureKind.FITTED, FigureKind.CONSTRUCTED):
        met = Verdict.FITTED if kind is FigureKind.FITTED else Verdict.CONSTRUCTED
        return met if distance <= reach else Verdict.MISSED
    if distance <= reach:
        return Verdict.REPRODUCED
    return Verdict.NEAR if distance <= far else Verdict.NOT_REPRODUCED
