"""The one rule of the verdicts, and the tricks that it withstands."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.metrics.verdict import Paper, Spread, Verdict, half_unit, judge
from etac_ros.scenario.schema import FigureKind

RANK = {Verdict.REPRODUCED: 2, Verdict.NEAR: 1, Verdict.NOT_REPRODUCED: 0}
numbers = st.floats(1.0, 1000.0)


def spread(mean: float, sd: float) -> Spread:
    return Spread(mean=mean, sd=sd, p5=mean - 1.6 * sd, p95=mean + 1.6 * sd, runs=12)


def verdict(printed: str, measured: float | None, band: Spread | None = None, kind: str = "continuous") -> Verdict:
    return judge(Paper(printed, FigureKind(kind)), measured, band).verdict


@pytest.mark.parametrize(
    ("printed", "half"), [("84", 0.5), ("97.50", 0.005), ("97.5", 0.05), ("2e-4", 0.5e-4), ("2.0e-4", 0.05e-4)]
)
def test_half_a_unit_of_the_last_printed_digit(printed: str, half: float) -> None:
    assert half_unit(printed) == pytest.approx(half, rel=1e-12)


@given(numbers, numbers, numbers, st.floats(0.0, 500.0))
def test_a_better_reading_has_no_worse_verdict(paper: float, one: float, other: float, sd: float) -> None:
    better, worse = sorted((one, other), key=lambda value: abs(value - paper))
    printed = f"{paper:.3f}"
    ranks = [RANK[verdict(printed, value, spread(value, sd))] for value in (better, worse)]
    assert ranks[0] >= ranks[1] or abs(abs(better - paper) - abs(worse - paper)) < 1e-2


@given(numbers, numbers, st.floats(0.0, 1e6))
def test_a_narrow_spread_does_not_harm_and_a_wide_one_helps_to_a_tenth_only(
    paper: float, measured: float, sd: float
) -> None:
    off = abs(measured / paper - 1.0)
    found = verdict(repr(paper), measured, spread(measured, sd))
    if off < 0.0199:
        assert found is Verdict.REPRODUCED
    if off > 0.1001:
        assert found is not Verdict.REPRODUCED
    if off > 0.2001:
        assert found is Verdict.NOT_REPRODUCED


def test_neither_a_lucky_run_nor_a_lucky_mean_suffices() -> None:
    assert verdict("100", 100.0, spread(130.0, 2.0)) is Verdict.NOT_REPRODUCED
    assert verdict("100", 130.0, spread(100.0, 2.0)) is Verdict.NOT_REPRODUCED
    assert verdict("100", 101.0, spread(99.0, 2.0)) is Verdict.REPRODUCED


def test_a_percentage_is_measured_by_what_it_leaves() -> None:
    assert verdict("99.00", 98.0, kind="percentage") is Verdict.NOT_REPRODUCED  # twice the messages
    assert verdict("99.00", 98.0) is Verdict.REPRODUCED  # of a quantity that is no percentage it would be 1 %
    found = judge(Paper("97.50", FigureKind.PERCENTAGE), 97.25, None)
    assert found.percent == pytest.approx(-10.0)


def test_zeros_count() -> None:
    assert verdict("97.50", 97.56, kind="percentage") is not Verdict.REPRODUCED
    assert verdict("97.5", 97.549, kind="percentage") is Verdict.REPRODUCED


@pytest.mark.parametrize(
    ("measured", "mean", "wanted"),
    [(0.5, 0.5, Verdict.KEPT), (0.5000001, 0.4, Verdict.NOT_KEPT), (0.4, 0.51, Verdict.NOT_KEPT)],
)
def test_a_limit_is_kept_to_the_last_bit(measured: float, mean: float, wanted: Verdict) -> None:
    assert verdict("0.5", measured, spread(mean, 0.2), "limit") is wanted


def test_what_was_fitted_or_constructed_is_never_reproduced() -> None:
    assert verdict("84", 84.0, kind="fitted") is Verdict.FITTED
    assert verdict("84", 84.0, kind="constructed") is Verdict.CONSTRUCTED
    assert verdict("84", 100.0, kind="fitted") is Verdict.MISSED


def test_what_is_not_measured_or_declared_otherwise_is_not_testable() -> None:
    assert verdict("84", None) is Verdict.NOT_TESTABLE
    assert judge(Paper("84", FigureKind.LIMIT, "kind is limit, and was count"), 3.0, None).verdict is (
        Verdict.NOT_TESTABLE
    )
