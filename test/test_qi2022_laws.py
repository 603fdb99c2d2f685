"""The laws of qi2022: they cancel what they should, in any state, and never depend on windows or wires."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from test_qi2022_numbers import (
    MEASUREMENT,
    PM_LAW,
    SLIDING_MODE,
    SM_LAW,
    TICKS_PER_SECOND,
    made,
    patient,
    plant_parameters,
    sections,
)
from test_qi2022_plant import HARD, Inertial, states

from etac_ros.laws.qi2022 import PmFeedback, PmFeedbackParameters
from etac_ros.parameters import FloatArray, square

_PM_KNOWS = {key: HARD[key] for key in ("orbit_rate_rad_s", "ncla_disturbance_nm", "disturbance_pm")}
_SM_KNOWS = {key: HARD[key] for key in ("cmg_momentum_nms", "ncla_disturbance_nm", "disturbance_sm")}
_FEEDBACK = PmFeedback(PmFeedbackParameters(), TICKS_PER_SECOND)

# Near half a turn the scalar part, found from the norm of the vector part, loses up to half its digits.
clear_states = states().filter(lambda state: bool(abs(state[0]) > 0.1 and abs(state[7]) > 0.1))
torques_pm = arrays(np.float64, 3, elements=st.floats(-2.0, 2.0))
ticks = st.integers(0, 4000)


def _gains(component: tuple[str, str], variant: str | None = None) -> tuple[FloatArray, FloatArray]:
    given_law = sections(variant)[component[0]][component[1]]
    return np.array(given_law["attitude_gain_nm"]), np.array(given_law["rate_gain_nms"])


def _short(q: FloatArray) -> FloatArray:
    """Vector part of the shortest rotation."""
    return q[1:4] if q[0] >= 0.0 else -q[1:4]


def _rows(*values: FloatArray) -> list[FloatArray]:
    return [np.ascontiguousarray(value[np.newaxis]) for value in values]


def _motion(second: Inertial, tick: int, state: FloatArray, torque_pm: FloatArray, torque_sm: FloatArray) -> Any:
    """``omega_po_dot`` in P, ``omega_sp_dot`` in S, and the panels' ``Delta eta_ddot`` [N m]."""
    t = tick / TICKS_PER_SECOND
    y = second.from_plant(t, state)
    rate_pi, rate_si, eta_ddot = second.accelerations(t, y, torque_pm, torque_sm)
    R_po = y[0:9].reshape(3, 3).T @ second.orbital_frame(t)
    R_sp = y[12:21].reshape(3, 3).T @ y[0:9].reshape(3, 3)
    rate_po = rate_pi + np.cross(state[4:7], R_po @ second.orbit_rate)
    rate_sp = rate_si + np.cross(state[11:14], R_sp @ y[9:12]) - R_sp @ rate_pi
    return rate_po, rate_sp, np.hstack([second.coupling, second.coupling]) @ eta_ddot


@given(state=clear_states, tick=ticks)
@patient
def test_pm_law_linearises_the_pm(state: FloatArray, tick: int) -> None:
    """Eq. (7) in eq. (2) leaves ``J_p omega_po_dot = -K_pp q - K_dp omega``."""
    parameters = plant_parameters(**HARD)
    torque = made(PM_LAW, None, _PM_KNOWS).torque(_FEEDBACK.evaluate(state[np.newaxis]), np.array([tick]))[0]
    rate_po, _, _ = _motion(Inertial(parameters), tick, state, torque, np.zeros(3))
    attitude_gain, rate_gain = _gains(PM_LAW)
    wanted = -attitude_gain * _short(state[0:4]) - rate_gain * state[4:7]
    assert np.allclose(square(parameters.inertia_pm_kg_m2) @ rate_po, wanted, rtol=0.0, atol=1e-10)


@given(state=states(), torque_pm=torques_pm, tick=ticks)
@patient
def test_measurement_is_the_motion_of_the_pm(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    second = Inertial(plant_parameters(**HARD))
    t = tick / TICKS_PER_SECOND
    y = second.from_plant(t, state)
    rate_pi, _, _ = second.accelerations(t, y, torque_pm, np.zeros(3))
    m = made(MEASUREMENT, None, _PM_KNOWS).evaluate(*_rows(state, torque_pm), np.array([tick]))[0]
    assert np.array_equal(m[0:3], _short(state[7:11]))
    assert np.array_equal(m[3:6], state[11:14])
    assert np.array_equal(m[6:9], torque_pm)
    assert np.allclose(m[9:12], y[9:12], rtol=0.0, atol=1e-14)
    assert np.allclose(m[12:15], rate_pi, rtol=0.0, atol=1e-13)


@given(state=clear_states, torque_pm=torques_pm, tick=ticks)
@patient
def test_sm_law_leaves_error_feedback_and_panels(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    """Eq. (12) in eq. (4): ``J_s omega_sp_dot + Delta eta_ddot = -K_ps q - K_ds omega``."""
    parameters = plant_parameters(**HARD)
    m = made(MEASUREMENT, None, _PM_KNOWS).evaluate(*_rows(state, torque_pm), np.array([tick]))
    torque = made(SM_LAW, None, _SM_KNOWS).torque(m, np.array([tick]))[0]
    _, rate_sp, push = _motion(Inertial(parameters), tick, state, torque_pm, torque)
    attitude_gain, rate_gain = _gains(SM_LAW)
    wanted = -attitude_gain * _short(state[7:11]) - rate_gain * state[11:14]
    assert np.allclose(square(parameters.inertia_sm_kg_m2) @ rate_sp + push, wanted, rtol=0.0, atol=1e-9)


@given(state=clear_states, torque_pm=torques_pm, tick=ticks)
@patient
def test_held_error_feedback_and_continuous_feed_forward_make_the_same_law(
    state: FloatArray, torque_pm: FloatArray, tick: int
) -> None:
    """The reading `tuned` splits eq. (12) between law and plant; only ``tau_ds`` is left uncancelled."""
    parameters = plant_parameters(**HARD, continuous_feed_forward=True)
    m = made(MEASUREMENT, None, _PM_KNOWS).evaluate(*_rows(state, torque_pm), np.array([tick]))
    torque = made(SM_LAW, "tuned", _SM_KNOWS).torque(m, np.array([tick]))[0]
    attitude_gain, rate_gain = _gains(SM_LAW)
    wanted = -attitude_gain * _short(state[7:11]) - rate_gain * state[11:14]
    assert np.allclose(torque, wanted, rtol=0.0, atol=1e-13)
    second = Inertial(parameters)
    _, rate_sp, push = _motion(second, tick, state, torque_pm, torque)
    disturbance = second.torque(parameters.disturbance_sm, tick / TICKS_PER_SECOND)
    closed = square(parameters.inertia_sm_kg_m2) @ rate_sp + push
    assert np.allclose(closed, wanted + disturbance, rtol=0.0, atol=1e-9)


@given(state=clear_states, torque_pm=torques_pm, tick=ticks)
@patient
def test_sm_law_with_panels_leaves_error_feedback_alone(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    """The whole of eq. (13) in eqs. (4), (6): ``J_s omega_sp_dot = -K_ps q - K_ds omega``, as eq. (16) has it."""
    parameters = plant_parameters(**HARD, coupling_scale=0.6)
    measured = made(MEASUREMENT, "panels", _PM_KNOWS).evaluate(*_rows(state, torque_pm), np.array([tick]))
    law = made(SM_LAW, "panels", {**_SM_KNOWS, "coupling_scale": 0.6})
    torque = law.torque(measured, np.array([tick]))[0]
    _, rate_sp, _ = _motion(Inertial(parameters), tick, state, torque_pm, torque)
    attitude_gain, rate_gain = _gains(SM_LAW)
    wanted = -attitude_gain * _short(state[7:11]) - rate_gain * state[11:14]
    assert np.allclose(square(parameters.inertia_sm_kg_m2) @ rate_sp, wanted, rtol=0.0, atol=1e-9)
    assert np.array_equal(law.watched(measured, np.array([tick]))[0, :3], torque)


@given(state=clear_states, torque_pm=torques_pm, tick=ticks)
@patient
def test_sliding_mode_foresees_the_panels(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    """Eq. (19) in eqs. (4), (6): ``J_s omega_sp_dot = tau_s - Delta_s``; ``eta_ddot`` is cancelled."""
    parameters = plant_parameters(**HARD, coupling_scale=0.6)
    m = made(MEASUREMENT, None, _PM_KNOWS).evaluate(*_rows(state, torque_pm), np.array([tick]))
    law = made(SLIDING_MODE, "smc", {**_SM_KNOWS, "coupling_scale": 0.6})
    torque = law.torque(m, *_rows(state[14:20]), np.array([tick]))[0]
    _, rate_sp, _ = _motion(Inertial(parameters), tick, state, torque_pm, torque)
    inertia = square(parameters.inertia_sm_kg_m2)
    numbers = sections("smc")["/sm/controller"]["law"]
    s = state[11:14] + numbers["slope_1_s"] * _short(state[7:11])
    wanted = -numbers["alpha"] * np.sign(s) * np.abs(s) ** numbers["exponent"] - numbers["beta_nms"] * s
    wanted -= numbers["slope_1_s"] * inertia @ state[11:14]
    assert np.allclose(inertia @ rate_sp, wanted, rtol=0.0, atol=1e-9)


def test_sliding_mode_at_its_surface_is_finite() -> None:
    """At s = 0 power and sign vanish together."""
    law = made(SLIDING_MODE, "smc", {"disturbance_sm": {}})
    still = law.torque(np.zeros((1, 15)), np.zeros((1, 6)), np.array([0]))
    assert np.array_equal(np.abs(still), np.zeros((1, 3)))


@st.composite
def windows(draw: Any) -> tuple[FloatArray, FloatArray, int]:
    """A window of samples, the PM's torques in it and its first tick."""
    count = draw(st.integers(2, 9))
    rows = np.array([draw(states()) for _ in range(count)])
    torques = draw(arrays(np.float64, (count, 3), elements=st.floats(-2.0, 2.0)))
    return rows, torques, draw(ticks)


@given(window=windows())
@patient
def test_one_formula_for_windows_and_single_samples(window: tuple[FloatArray, FloatArray, int]) -> None:
    """To the last bit: the row of a window is what the single sample gives."""
    rows, torques, start = window
    span = np.arange(start, start + rows.shape[0])
    feedback = _FEEDBACK.evaluate(rows)
    m = made(MEASUREMENT).evaluate(rows, torques, span)
    modes = np.ascontiguousarray(rows[:, 14:20])
    whole = [
        feedback,
        made(PM_LAW).torque(feedback, span),
        m,
        made(SM_LAW).torque(m, span),
        made(SM_LAW).watched(m, span),
        made(SLIDING_MODE, "smc").torque(m, modes, span),
    ]
    for i in range(rows.shape[0]):
        one = slice(i, i + 1)
        single = [
            _FEEDBACK.evaluate(rows[one]),
            made(PM_LAW).torque(feedback[one], span[one]),
            made(MEASUREMENT).evaluate(rows[one], torques[one], span[one]),
            made(SM_LAW).torque(m[one], span[one]),
            made(SM_LAW).watched(m[one], span[one]),
            made(SLIDING_MODE, "smc").torque(m[one], modes[one], span[one]),
        ]
        for of_window, alone in zip(whole, single, strict=True):
            assert np.array_equal(of_window[one], alone)


@given(state=states(), torque_pm=torques_pm, tick=ticks)
@patient
def test_both_quaternions_of_an_attitude_are_sent_alike(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    """No unwinding: q and -q are the same attitude, so they have the same feedback and measurement."""
    other = state.copy()
    other[0:4], other[7:11] = -state[0:4], -state[7:11]
    if state[0] == 0.0 or state[7] == 0.0:
        return  # half a turn is as short one way as the other
    measurement, at = made(MEASUREMENT), np.array([tick])
    assert np.array_equal(_FEEDBACK.evaluate(state[np.newaxis]), _FEEDBACK.evaluate(other[np.newaxis]))
    assert np.array_equal(
        measurement.evaluate(*_rows(state, torque_pm), at), measurement.evaluate(*_rows(other, torque_pm), at)
    )


@given(state=states(), torque_pm=torques_pm, tick=ticks)
@patient
def test_measurement_survives_the_wire(state: FloatArray, torque_pm: FloatArray, tick: int) -> None:
    """float32 may push a vector part beyond norm 1; the law stays finite and close."""
    law, at = made(SM_LAW), np.array([tick])
    m = made(MEASUREMENT).evaluate(*_rows(state, torque_pm), at)
    exact, wired = law.torque(m, at), law.torque(m.astype(np.float32).astype(np.float64), at)
    assert np.isfinite(wired).all()
    if abs(state[7]) > 0.1:
        assert np.allclose(exact, wired, rtol=0.0, atol=1e-3)


def test_a_vector_part_beyond_the_unit_norm_is_half_a_turn() -> None:
    m = np.zeros((1, 15))
    m[0, 0] = np.nextafter(1.0, 2.0)
    assert np.isfinite(made(SM_LAW).torque(m, np.array([0]))).all()


def test_watched_is_torque_rate_and_attitude() -> None:
    m = np.arange(30.0).reshape(2, 15) / 100.0
    span = np.array([3, 4])
    law = made(SM_LAW)
    watched = law.watched(m, span)
    assert np.array_equal(watched[:, 0:3], law.torque(m, span))
    assert np.array_equal(watched[:, 3:6], m[:, 3:6])
    assert np.array_equal(watched[:, 6:9], m[:, 0:3])
    assert watched.flags.c_contiguous


@pytest.mark.parametrize(("component", "variant"), [(PM_LAW, None), (SM_LAW, None), (SLIDING_MODE, "smc")])
def test_sizes_are_those_of_the_signals(component: tuple[str, str], variant: str | None) -> None:
    law = made(component, variant)
    sizes = {PM_LAW: _FEEDBACK.size, SM_LAW: made(MEASUREMENT).size, SLIDING_MODE: made(MEASUREMENT).size}
    assert law.signal_size == sizes[component]
    assert law.command_size == 3
