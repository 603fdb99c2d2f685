"""What becomes of a published figure: a rule, so that nobody types a verdict."""

from __future__ import annotations

from dataclasses import dataclass
from decimal import Decimal
from enum import StrEnum

_NEAR = 0.10
RULE = (
    "**reproduced**: the published figure lies within the 5 to 95 % of the dispersed runs, or the measured one rounds "
    "to it as printed; a limit (marked ≤) is kept. **near**: within twice that span, or within 10 % of the measured "
    "figure. **not reproduced**: neither. **not testable**: the run has no such figure."
)
"""The rule in words; the tests hold it against the code."""


class Verdict(StrEnum):
    """What becomes of a published figure."""

    REPRODUCED = "reproduced"
    NEAR = "near"
    NOT_REPRODUCED = "not reproduced"
    NOT_TESTABLE = "not testable"


@dataclass(frozen=True)
class Spread:
    """The 5 to 95 % of a figure over dispersed runs."""

    low: float
    high: float
    runs: int


def rounding(value: float) -> float:
    """Half a unit in the last digit of a figure as it is printed: 0.5 for 84, 0.005 for 2.56."""
    exponent = Decimal(repr(value)).normalize().as_tuple().exponent
    assert isinstance(exponent, int)
    return 0.5 * 10.0 ** min(exponent, 0)


def judge(published: float, is_limit: bool, measured: float | None, spread: Spread | None) -> Verdict:
    """Apply the rule.

    Parameters
    ----------
    published
        The paper's figure.
    is_limit
        Whether it is a limit that the paper says is kept.
    measured
        What the run gave; None if it does not have the figure.
    spread
        Over dispersed runs; None where nothing was dispersed.
    """
    if measured is None:
        return Verdict.NOT_TESTABLE
    tolerance = rounding(published)
    close = abs(measured - published) <= _NEAR * abs(measured)
    if is_limit:
        if measured <= published + tolerance:
            return Verdict.REPRODUCED
        return Verdict.NEAR if close else Verdict.NOT_REPRODUCED
    low, high = (measured, measured) if spread is None else (spread.low, spread.high)
    if abs(measured - published) <= tolerance or low - tolerance <= published <= high + tolerance:
        return Verdict.REPRODUCED
    reach = 0.5 * (high - low)
    if low - reach <= published <= high + reach or close:
        return Verdict.NEAR
    return Verdict.NOT_REPRODUCED
