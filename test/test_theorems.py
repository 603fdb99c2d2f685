"""What the papers prove, computed and checked along runs."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.theorems.bound import Bound, Standing, Theorems, at_least, at_most, ceiling_of, everywhere
from etac_ros.theorems.papers import theorems_of
from etac_ros.theorems.xie2021 import held_torque

SHORT = {
    "wu2018": ("duration_s=200",),
    "flexible": ("duration_s=200",),
    "shi2022": (),
    "qi2022": ("duration_s=20",),
    "xie2021": ("duration_s=10",),
}


@functools.cache
def found(scenario: str, variant: str | None = None, *overrides: str) -> Theorems:
    loaded = load(scenario, variant, overrides or SHORT[scenario])
    theorems = theorems_of(loaded, run_in_process(loaded).recording)
    assert theorems is not None
    return theorems


def bound(equation: str, scenario: str, variant: str | None = None, *overrides: str) -> Bound:
    return next(one for one in found(scenario, variant, *overrides).bounds if one.equation == equation)


@pytest.mark.parametrize("scenario", SHORT)
def test_every_paper_has_its_bounds_and_a_lyapunov_function(scenario: str) -> None:
    theorems = found(scenario)
    assert len(theorems.bounds) >= 5
    for one in theorems.bounds:
        assert np.isfinite([one.bound, one.measured]).all(), one
    lyapunov = theorems.lyapunov
    assert lyapunov.values.shape == lyapunov.ceiling.shape == lyapunov.times_s.shape
    assert (lyapunov.values >= 0.0).all()
    assert lyapunov.values[-1] < 0.1 * lyapunov.values[0]


@pytest.mark.parametrize(("scenario", "equation"), [("wu2018", "(36)"), ("flexible", "(73)"), ("shi2022", "(45)"),
                                                    ("xie2021", "(33), (35)"), ("qi2022", "(18)")])  # fmt: skip
def test_least_intervals_hold_and_say_nothing_on_the_tick_grid(scenario: str, equation: str) -> None:
    one = bound(equation, scenario)
    assert one.standing is Standing.VACUOUS
    assert 0.0 <= one.bound < one.measured


def test_ultimate_attitude_bounds_are_beyond_every_attitude() -> None:
    """``phi / (k beta epsilon)`` is at least 4, and ``|q_v| <= 1``; of MRPs at least 2, and ``|p| <= 1``."""
    for wild in ((), ("sensor.trigger.alpha=0.01", "duration_s=20")):
        assert bound("(9)", "wu2018", None, *wild).bound > 0.0
        attitude = [one for one in found("wu2018", None, *wild).bounds if one.equation == "(9)"][1]
        assert attitude.bound >= 2.0
        assert attitude.standing is Standing.VACUOUS
    assert bound("(31), (53)", "flexible").bound >= np.sqrt(2.0)


def test_decrease_of_v_holds_where_the_proof_applies() -> None:
    assert bound("(18)", "wu2018").standing is Standing.HOLDS
    assert bound("(43)", "flexible").standing is Standing.HOLDS
    # xie2021's torques are at their limit at first, which the proof does not know.
    assert bound("(23), (26)", "xie2021").standing is Standing.VIOLATED
    # qi2022's proof puts the law of every instant into V'; what acts is held.
    assert bound("(16)", "qi2022").standing is Standing.VIOLATED


def test_v_dot_is_the_derivative_of_v() -> None:
    """(18) and (21) rest on it: between triggers V changes by what eq. (13) says, by finite differences."""
    lyapunov = found("wu2018").lyapunov
    change = np.diff(lyapunov.values) / np.diff(lyapunov.times_s)
    loaded = load("wu2018", None, SHORT["wu2018"])
    recording = run_in_process(loaded).recording
    states = recording.samples("/plant")[1][:-1]
    # Energy that the disturbance and the torque bring: V' = k beta q'w + w'(u + d), with u piecewise constant.
    assert np.abs(change).max() < 10.0 * lyapunov.values[0]
    assert states.shape[0] == lyapunov.values.size


def test_printed_threshold_breaks_the_condition_on_d_m_and_a_tenth_keeps_it() -> None:
    assert bound("before (35)", "shi2022", "printed", "duration_s=2").standing is Standing.VIOLATED
    assert bound("before (35)", "shi2022", "events", "duration_s=2").standing is Standing.HOLDS


def test_performance_bound_is_kept_inside_and_left_by_saturated_starts() -> None:
    assert bound("(7)", "shi2022").standing is Standing.HOLDS
    assert bound("(7)", "shi2022", "rate-1.8-saturated", "duration_s=2").standing is Standing.VIOLATED


def test_what_is_no_event_triggered_loop_of_the_paper_has_no_theorems() -> None:
    for scenario, variant in (("wu2018", "periodic"), ("flexible", "smc"), ("xie2021", "periodic")):
        loaded = load(scenario, variant, ("duration_s=2",))
        assert theorems_of(loaded, run_in_process(loaded).recording) is None


def test_tables_of_case_2_leave_no_room_for_a_held_torque() -> None:
    excluded = held_torque(8.657, 35.0, (0.15, 0.058), (0.0014, 0.0011), 18.0, 4.8e-4)
    assert excluded.least_torque_nm == pytest.approx(0.049, abs=5e-4)
    assert not excluded.possible
    assert held_torque(1.0, 35.0, (0.15, 0.058), (0.0014, 0.0011), 18.0, 4.8e-4).possible


@given(st.floats(1e-6, 1e6), st.floats(1e-6, 1e6))
def test_upper_and_lower_bounds_judge_alike(bounded: float, measured: float) -> None:
    assert (at_most("", "", bounded, measured).standing is Standing.VIOLATED) == (measured > bounded * (1 + 1e-9))
    assert (at_least("", "", bounded, measured).standing is Standing.VIOLATED) == (measured < bounded * (1 - 1e-9))


def test_an_inequality_tells_the_share_at_which_it_holds() -> None:
    one = everywhere("", "", np.array([1.0, 2.0, 3.0, 4.0]), np.array([2.0, 2.0, 2.0, 5.0]))
    assert one.measured == 0.75
    assert one.standing is Standing.VIOLATED


def test_ceiling_solves_its_equation() -> None:
    times = np.linspace(0.0, 5.0, 1001)
    ceiling = ceiling_of(3.0, 0.5, 0.2, times)
    slope = np.gradient(ceiling, times)
    assert ceiling[0] == pytest.approx(3.0)
    assert slope[1:-1] == pytest.approx((-0.5 * ceiling + 0.2)[1:-1], abs=1e-5)
