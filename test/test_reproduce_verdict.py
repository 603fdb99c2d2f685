"""The rule by which a published figure is judged."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.reproduce.verdict import Spread, Verdict, judge, rounding

figures = st.floats(1e-6, 1e6)


@pytest.mark.parametrize(
    ("value", "half"), [(84.0, 0.5), (2016.0, 0.5), (2.56, 0.005), (91.6, 0.05), (2.6e-4, 0.5e-5), (8000.0, 0.5)]
)
def test_rounding_is_half_a_unit_of_the_last_printed_digit(value: float, half: float) -> None:
    assert rounding(value) == pytest.approx(half)


@pytest.mark.parametrize(
    ("published", "measured", "spread", "verdict"),
    [
        (84.0, 84.0, None, Verdict.REPRODUCED),
        (2.56, 2.5645, None, Verdict.REPRODUCED),  # rounds to it
        (196.0, 210.0, Spread(200.0, 216.0, 200), Verdict.NEAR),  # within twice the span
        (200.0, 210.0, Spread(199.0, 216.0, 200), Verdict.REPRODUCED),
        (384.0, 265.0, Spread(255.0, 268.0, 200), Verdict.NOT_REPRODUCED),
        (95.0, 100.0, None, Verdict.NEAR),  # within 10 %
        (2118.0, 24198.0, Spread(24000.0, 24300.0, 10), Verdict.NOT_REPRODUCED),
        (84.0, None, Spread(79.0, 89.0, 200), Verdict.NOT_TESTABLE),
    ],
)
def test_verdicts(published: float, measured: float | None, spread: Spread | None, verdict: Verdict) -> None:
    assert judge(published, False, measured, spread) is verdict


@pytest.mark.parametrize(
    ("measured", "verdict"),
    [(94.1, Verdict.REPRODUCED), (100.4, Verdict.REPRODUCED), (105.0, Verdict.NEAR), (120.0, Verdict.NOT_REPRODUCED)],
)
def test_a_limit_has_to_be_kept(measured: float, verdict: Verdict) -> None:
    assert judge(100.0, True, measured, Spread(0.0, 1000.0, 200)) is verdict


@given(figures, figures, figures)
def test_a_wider_spread_never_makes_a_verdict_worse(published: float, measured: float, width: float) -> None:
    order = [Verdict.REPRODUCED, Verdict.NEAR, Verdict.NOT_REPRODUCED]
    narrow = judge(published, False, measured, Spread(measured - width, measured + width, 10))
    wide = judge(published, False, measured, Spread(measured - 2 * width, measured + 2 * width, 10))
    assert order.index(wide) <= order.index(narrow)


@given(figures)
def test_what_is_met_exactly_is_reproduced(published: float) -> None:
    assert judge(published, False, published, None) is Verdict.REPRODUCED
    assert judge(published, True, published, None) is Verdict.REPRODUCED
