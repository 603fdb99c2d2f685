"""The rigid body in MRPs against another integrator of another formulation, and its error from a moving reference.

The other formulation keeps the angular momentum in the inertial frame and the attitude as a matrix; scipy's DOP853
integrates it with an adaptive step, and scipy turns the matrix into MRPs.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from etac_ros.parameters import FloatArray
from etac_ros.plants.rigid_mrp import RigidMrp, RigidMrpParameters

J = np.array([[15.0, 1.0, -0.5], [1.0, 18.0, 2.0], [-0.5, 2.0, 12.0]])
GRID = 100
REFERENCE = {
    "constant_mrp": [0.1, -0.05, 0.2],
    "sine_mrp": [0.0, 0.3, 0.1],
    "cosine_mrp": [0.2, 0.0, -0.1],
    "frequency_rad_s": [0.7, 1.1, 0.4],
}
TICKS = 120
cuts = st.lists(st.integers(0, TICKS), max_size=8).map(lambda some: sorted({0, TICKS, *some}))
torques = st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array)


def body(grid: int = GRID, **changes: Any) -> RigidMrp:
    values = {
        "inertia_kg_m2": J.ravel().tolist(),
        "attitude_mrp": [-0.2, 0.15, -0.1],
        "rate_rad_s": [0.7, -0.5, 0.4],
        "reference": REFERENCE,
        **changes,
    }
    return RigidMrp(RigidMrpParameters.model_validate(values), grid)


@st.composite
def attitudes(draw: Any) -> FloatArray:
    """MRPs of any direction, up to just below half a turn."""
    direction = draw(arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)).filter(lambda v: np.linalg.norm(v) > 0.1))
    return np.asarray(direction / np.linalg.norm(direction) * draw(st.floats(0.0, 0.99)))


def inertial(y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrix from body to reference components, and the rate in the body."""
    R = y[3:].reshape(3, 3)
    return R, np.linalg.solve(J, R.T @ y[:3])


def motion(t: float, y: FloatArray, torque: FloatArray) -> FloatArray:
    R, w = inertial(y)
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.concatenate([R @ torque, (R @ W).ravel()])


def test_second_formulation_agrees_through_many_shadow_switches() -> None:
    plant = body(substeps=2)
    state = plant.initial_state()
    R = Rotation.from_mrp(state[:3]).as_matrix()
    y = np.concatenate([R @ J @ state[3:], R.ravel()])
    random = np.random.default_rng(5)
    tick = 0
    switches = 0
    for seconds in (7, 13, 10, 20):
        torque = random.uniform(-2.0, 2.0, 3)
        count = seconds * GRID
        ahead = np.arange(tick, tick + count + 1)
        states = np.vstack([state, plant.propagate(state, tick, count, torque)])
        span = (tick / GRID, ahead[-1] / GRID)
        tight = {"rtol": 1e-13, "atol": 1e-14, "t_eval": ahead / GRID}
        theirs = solve_ivp(motion, span, y, method="DOP853", args=(torque,), **tight).y.T
        for ours, other in zip(states, theirs, strict=True):
            R, w = inertial(other)
            sigma = Rotation.from_matrix(R).as_mrp()
            assert ours[3:] == pytest.approx(w, abs=1e-9)
            if abs(np.linalg.norm(sigma) - 1.0) > 1e-8:  # at half a turn itself both sets will do
                assert ours[:3] == pytest.approx(sigma, abs=1e-9)
        switches += int((np.linalg.norm(np.diff(states[:, :3], axis=0), axis=1) > 1.0).sum())
        state, y, tick = states[-1], theirs[-1], tick + count
    assert switches > 5


def test_half_a_turn_is_never_exceeded() -> None:
    plant = body(rate_rad_s=[3.0, -2.0, 1.0])
    states = plant.propagate(plant.initial_state(), 0, 3000, np.zeros(3))
    norms = np.linalg.norm(states[:, :3], axis=1)
    assert norms.max() <= 1.0
    assert norms.max() > 0.99
    assert plant.attitude_angle(states).max() <= np.pi


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    torque = np.array([2.0, -1.0, 0.5])
    finals = []
    for substeps in (1, 2, 4, 64):
        plant = body(5, substeps=substeps, rate_rad_s=[1.4, -1.0, 0.8])
        finals.append(plant.propagate(plant.initial_state(), 0, 50, torque)[-1])
    errors = [float(np.linalg.norm(final - finals[-1])) for final in finals[:-1]]
    assert 1e-7 < errors[2] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.15)


def test_no_torque_conserves_momentum_and_energy() -> None:
    plant = body()
    states = np.vstack([plant.initial_state(), plant.propagate(plant.initial_state(), 0, 100 * GRID, np.zeros(3))])
    momentum = Rotation.from_mrp(states[:, :3]).apply(states[:, 3:] @ J)
    energy = 0.5 * np.einsum("ni,ij,nj->n", states[:, 3:], J, states[:, 3:])
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * np.linalg.norm(momentum[0])
    assert np.abs(energy - energy[0]).max() < 1e-8 * energy[0]
    assert np.ptp(states[:, 3:], axis=0).min() > 0.05  # it tumbles meanwhile


@given(cuts, torques, st.sampled_from([1, 3]), st.integers(0, 10**6))
def test_windows_leave_no_trace(cuts: list[int], torque: FloatArray, substeps: int, first: int) -> None:
    # Fast enough that the shadow set is switched to within the run.
    plant = body(20, substeps=substeps, rate_rad_s=[3.0, -2.0, 1.0])
    state = plant.initial_state()
    together = plant.propagate(state, first, TICKS, torque)
    assert (np.linalg.norm(np.diff(together[:, :3], axis=0), axis=1) > 1.0).any()
    parts = []
    for start, end in pairwise(cuts):
        parts.append(plant.propagate(state, first + start, end - start, torque))
        state = parts[-1][-1]
    assert np.concatenate(parts).tobytes() == together.tobytes()


def test_start_is_as_given() -> None:
    assert body().initial_state().tolist() == [-0.2, 0.15, -0.1, 0.7, -0.5, 0.4]


def reference_quaternion(t: complex) -> Any:
    """``q_d = [1 - |sigma_d|^2, 2 sigma_d] / (1 + |sigma_d|^2)``, of complex times as well."""
    p = (
        np.array(REFERENCE["constant_mrp"])
        + REFERENCE["sine_mrp"] * np.sin(np.array(REFERENCE["frequency_rad_s"]) * t)
        + REFERENCE["cosine_mrp"] * np.cos(np.array(REFERENCE["frequency_rad_s"]) * t)
    )
    square = (p * p).sum()
    return p, np.concatenate([[1.0 - square], 2.0 * p]) / (1.0 + square)


def reference_motion(t: float) -> FloatArray:
    """``[sigma_d, omega_d]``, the rate as ``2 q* q_dot`` with a complex step for the derivative."""
    sigma, q = reference_quaternion(t)
    q_dot = reference_quaternion(t + 1e-30j)[1].imag / 1e-30
    omega = 2.0 * (q[0] * q_dot[1:] - q_dot[0] * q[1:] - np.cross(q[1:], q_dot[1:]))
    return np.concatenate([sigma, omega])


@given(state=arrays(np.float64, 6, elements=st.floats(-1.0, 1.0)), tick=st.integers(0, 10**5))
def test_error_is_the_plain_difference_from_the_moving_reference(state: FloatArray, tick: int) -> None:
    states = np.vstack([state, 2.0 * state, -state])
    error = body().errors(states, tick)
    for k in range(3):
        assert error[k] == pytest.approx(states[k] - reference_motion((tick + k) / GRID), abs=1e-12)


def test_errors_do_not_see_windows() -> None:
    plant = body()
    states = plant.propagate(plant.initial_state(), 30, 50, np.ones(3))
    parts = [plant.errors(states[:17], 31), plant.errors(states[17:18], 48), plant.errors(states[18:], 49)]
    assert plant.errors(states, 31).tobytes() == np.concatenate(parts).tobytes()


def test_error_counts_from_rest_unless_told() -> None:
    plant = body(reference={})
    state = plant.initial_state()[np.newaxis]
    assert np.array_equal(plant.errors(state, 77), state)


@given(
    sigma=attitudes(),
    rate=arrays(np.float64, 3, elements=st.floats(-1.0, 1.0)),
    noise=arrays(np.float64, 6, elements=st.floats(-0.01, 0.01)),
)
def test_sensors_err_in_the_body(sigma: FloatArray, rate: FloatArray, noise: FloatArray) -> None:
    seen = body().measured(np.concatenate([sigma, rate])[np.newaxis], noise[np.newaxis])[0]
    turned = Rotation.from_mrp(sigma) * Rotation.from_quat([*(noise[:3] / 2.0), 1.0])
    difference = (Rotation.from_mrp(seen[:3]).inv() * turned).magnitude()
    assert difference < 1e-12
    assert np.linalg.norm(seen[:3]) <= 1.0
    assert np.array_equal(seen[3:], rate + noise[3:])


def test_sensors_may_see_the_shadow_set() -> None:
    """Just below half a turn, an error that turns it on: the same attitude from the other side."""
    state = np.array([[0.9999, 0.0, 0.0, 0.0, 0.0, 0.0]])
    seen = body().measured(state, np.array([[0.01, 0.0, 0.0, 0.0, 0.0, 0.0]]))
    # tan(angle / 4) grows by a quarter of the error: 1 - 1e-4 + 0.0025 (1 + p^2) = 1.0049 and its shadow.
    assert seen[0, 0] == pytest.approx(-1.0 / 1.0049, abs=1e-4)


def test_ideal_sensors_see_the_state() -> None:
    plant = body()
    states = plant.propagate(plant.initial_state(), 0, 500, np.ones(3))
    assert plant.measured(states, np.zeros((500, 6))) == pytest.approx(states, abs=1e-15)


def test_sensors_do_not_see_windows() -> None:
    plant = body()
    states = plant.propagate(plant.initial_state(), 0, 300, np.ones(3))
    errors = np.random.default_rng(1).normal(size=(300, 6)) * 0.01
    whole = plant.measured(states, errors)
    rows = [plant.measured(states[k : k + 1], errors[k : k + 1]) for k in range(300)]
    assert whole.tobytes() == np.concatenate(rows).tobytes()


def test_angles_of_the_body() -> None:
    """A yaw of 80 deg: ``tan(20 deg)`` about the third axis."""
    state = np.array([[0.0, 0.0, np.tan(np.radians(20.0)), 0.0, 0.0, 0.0]])
    plant = body()
    assert np.degrees(plant.euler_angles(state)[0]) == pytest.approx([0.0, 0.0, 80.0], abs=1e-12)
    assert np.degrees(plant.attitude_angle(state)[0]) == pytest.approx(80.0)
    assert np.array_equal(state[:, plant.attitude_slice], state[:, :3])
    assert np.array_equal(state[:, plant.rate_slice], state[:, 3:])


def test_a_start_beyond_half_a_turn_is_told_its_shadow_set() -> None:
    with pytest.raises(ValidationError, match=r"norm at most 1 \(found 1\.25\).*\[-0\.64, 0, -0\.48\], its shadow set"):
        body(attitude_mrp=[1.0, 0.0, 0.75])


def test_a_reference_beyond_half_a_turn_is_refused() -> None:
    with pytest.raises(ValidationError, match="at most half a turn"):
        body(reference={"constant_mrp": [0.5, 0.0, 0.0], "sine_mrp": [0.4, 0.0, 0.0], "cosine_mrp": [0.4, 0.0, 0.0]})
