"""The fixed-step integrator on the tick grid: its order, what it conserves, and that windows leave no trace."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.maths.quaternion import dcm
from etac_ros.parameters import FloatArray
from etac_ros.plants.rigid import RigidBody, RigidBodyParameters

INERTIA = [147.0, 6.5, 6.0, 6.5, 158.0, 5.5, 6.0, 5.5, 137.0]
DISTURBANCE = {
    "constant_nm": [1e-4, -1e-4, 2e-4],
    "sine_nm": [2e-4, 0.0, 0.0],
    "cosine_nm": [0.0, -5e-4, -4e-4],
    "frequency_rad_s": 0.005,
}
TICKS = 200
cuts = st.lists(st.integers(0, TICKS), max_size=8).map(lambda some: sorted({0, TICKS, *some}))
torques = st.tuples(*[st.floats(-0.2, 0.2)] * 3).map(np.array)


def body(grid: int = 32, **changes: Any) -> RigidBody:
    values = {
        "inertia_kg_m2": INERTIA,
        "attitude_euler_deg": [10.0, 5.0, -5.0],
        "rate_deg_s": [3.0, -2.0, 1.0],
        **changes,
    }
    return RigidBody(RigidBodyParameters.model_validate(values), grid)


def run(plant: RigidBody, ticks: int, torque: FloatArray) -> FloatArray:
    return plant.propagate(plant.initial_state(), 0, ticks, torque)


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    # Fast and strongly disturbed, so that the error stands above rounding; the sine makes it depend on time.
    fast = {
        "rate_deg_s": [40.0, -30.0, 20.0],
        "disturbance": {**DISTURBANCE, "sine_nm": [20.0, 0.0, 10.0], "frequency_rad_s": 2.0},
    }
    torque = np.array([5.0, -10.0, 3.0])
    exact = run(body(2, substeps=128, **fast), 20, torque)[-1]
    errors = [
        np.linalg.norm(run(body(2, substeps=substeps, **fast), 20, torque)[-1] - exact) for substeps in (4, 8, 16)
    ]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.1)
    assert errors[0] < 1e-3


def test_no_torque_conserves_momentum_and_energy() -> None:
    plant = body(rate_deg_s=[6.0, -9.0, 4.0])
    states = np.vstack([plant.initial_state(), run(plant, 32 * 300, np.zeros(3))])
    J = np.array(INERTIA).reshape(3, 3)
    momentum = np.empty((len(states), 3))
    C = np.empty((3, 3))
    for i, state in enumerate(states):
        dcm(state[0:4], C)
        momentum[i] = C.T @ J @ state[4:7]
    energy = 0.5 * np.einsum("ni,ij,nj->n", states[:, 4:7], J, states[:, 4:7])
    assert np.abs(momentum - momentum[0]).max() < 1e-9 * np.linalg.norm(momentum[0])
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    # The body does tumble meanwhile.
    assert np.ptp(states[:, 4:7], axis=0).min() > np.radians(1.0)


def test_norm_is_one_at_every_tick() -> None:
    states = run(body(rate_deg_s=[40.0, -30.0, 20.0], disturbance=DISTURBANCE), 3000, np.array([0.2, -0.2, 0.1]))
    assert np.abs(np.linalg.norm(states[:, 0:4], axis=1) - 1.0).max() < 3e-16


@given(cuts, torques, st.sampled_from([1, 3]), st.integers(0, 10**6))
def test_windows_leave_no_trace(cuts: list[int], torque: FloatArray, substeps: int, first: int) -> None:
    plant = body(substeps=substeps, disturbance=DISTURBANCE)
    state = plant.initial_state()
    together = plant.propagate(state, first, TICKS, torque)
    parts = []
    for start, end in pairwise(cuts):
        parts.append(plant.propagate(state, first + start, end - start, torque))
        state = parts[-1][-1]
    assert np.concatenate(parts).tobytes() == together.tobytes()


@given(cuts, torques)
def test_windows_that_are_dropped_leave_no_trace(cuts: list[int], torque: FloatArray) -> None:
    plant = body(disturbance=DISTURBANCE)
    start = plant.initial_state()
    state = start.copy()
    together = plant.propagate(state, 0, TICKS, torque)
    for cut in cuts[1:-1]:
        plant.propagate(state, 0, cut, -torque)
    assert state.tobytes() == start.tobytes()
    assert plant.propagate(state, 0, TICKS, torque).tobytes() == together.tobytes()


def test_the_disturbance_belongs_to_the_tick() -> None:
    plant = body(disturbance=DISTURBANCE)
    state = plant.initial_state()
    early, late = (plant.propagate(state, tick, 1, np.zeros(3)) for tick in (0, 32 * 300))
    assert not np.array_equal(early, late)


def test_start_may_be_a_quaternion_or_angles() -> None:
    by_angles = body().initial_state()
    by_quaternion = body(attitude_euler_deg=None, attitude_q=by_angles[0:4].tolist()).initial_state()
    assert by_quaternion == pytest.approx(by_angles, abs=1e-15)
    assert by_angles[4:7] == pytest.approx(np.radians([3.0, -2.0, 1.0]))
    almost_unit = body(attitude_euler_deg=None, attitude_q=[1.0 + 5e-7, 0.0, 0.0, 0.0]).initial_state()
    assert almost_unit[0] == 1.0
