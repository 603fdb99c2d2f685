"""Dynamics of the flexible spacecraft against a second formulation, and what physics demands of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from test_flexible_numbers import DAMPING, DELTA, DJ, FREQUENCY, GRID, J0, OMEGA0, P0, plant_parameters

from etac_ros.parameters import FloatArray
from etac_ros.plants.flexible import Flexible, FlexibleParameters
from etac_ros.plants.rigid import RigidBody, RigidBodyParameters

J = J0 + DJ
QUIET: dict[str, Any] = {"disturbance": {}}
FREE: dict[str, Any] = {**QUIET, "modal_damping": [0.0, 0.0, 0.0, 0.0]}
TUMBLING: dict[str, Any] = {
    "rate_rad_s": [0.2, -0.15, 0.1],
    "modal_coordinates_sqrt_kg_m": [0.3, -0.2, 0.1, 0.2],
    "modal_rates_sqrt_kg_m_s": [0.1, 0.2, -0.2, 0.1],
}
# Sizes at which each term of the disturbance matters within 40 s.
STRONG = {
    "constant_nm": [0.3, -0.2, 0.1],
    "sine_nm": [0.5, 0.4, -0.6],
    "cosine_nm": [-0.3, 0.6, 0.2],
    "frequency_rad_s": 0.7,
}


def flexible(grid: int = GRID, **changes: Any) -> Flexible:
    return Flexible(plant_parameters(**changes), grid)


def history(plant: Flexible, ticks: int, torque: FloatArray | None = None) -> FloatArray:
    """States at ticks 0 .. ticks."""
    start = plant.initial_state()
    held = np.zeros(3) if torque is None else torque
    return np.vstack([start, plant.propagate(start, 0, ticks, held)])


def motion(t: float, y: FloatArray, torque: FloatArray) -> FloatArray:
    """Eqs. (7) and (8) as they stand, in one stacked mass matrix; the attitude is a matrix from B to N."""
    R, w, eta, eta_dot = y[:9].reshape(3, 3), y[9:12], y[12:16], y[16:20]
    external = np.array(STRONG["constant_nm"]) + np.array(STRONG["sine_nm"]) * np.sin(0.7 * t)
    external = external + np.array(STRONG["cosine_nm"]) * np.cos(0.7 * t)
    hub = torque + external - np.cross(w, J @ w + DELTA.T @ eta_dot)
    modal = -np.diag(2.0 * DAMPING * FREQUENCY) @ eta_dot - np.diag(FREQUENCY**2) @ eta
    stacked = np.block([[J, DELTA.T], [DELTA, np.eye(4)]])
    solved = np.linalg.solve(stacked, np.concatenate([hub, modal]))
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.concatenate([(R @ W).ravel(), solved[:3], eta_dot, solved[3:]])


def test_second_formulation_agrees_over_40_s_and_several_shadow_switches() -> None:
    parameters = {**TUMBLING, "attitude_mrp": [0.6, -0.5, 0.6], "disturbance": STRONG, "substeps": 4}
    plant = flexible(**parameters)
    state = plant.initial_state()
    y = np.concatenate([Rotation.from_mrp(state[:3]).as_matrix().ravel(), state[3:]])
    random = np.random.default_rng(20)
    switches, tick = 0, 0
    for seconds in (3, 7, 10, 20):
        torque = random.uniform(-5.0, 5.0, 3)
        count = seconds * GRID
        states = plant.propagate(state, tick, count, torque)
        switches += int((np.abs(np.diff(states[:, :3], axis=0)).max(axis=1) > 0.5).sum())
        begin, end = tick / GRID, (tick + count) / GRID
        solution = solve_ivp(motion, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14, args=(torque,))
        y, state, tick = solution.y[:, -1], states[-1], tick + count
        expected = Rotation.from_matrix(y[:9].reshape(3, 3)).as_mrp()
        assert np.abs(state[:3] - expected).max() < 1e-9, f"attitude at {end} s"
        assert np.abs(state[3:] - y[9:]).max() < 1e-9, f"rates and modes at {end} s"
        assert np.linalg.norm(states[:, :3], axis=1).max() <= 1.0 + 1e-15
    assert switches >= 2
    assert np.abs(state[6:10]).max() > 0.05, "the modes hardly swing"


def test_no_torque_conserves_inertial_momentum_and_energy() -> None:
    """``h = J omega + delta' eta_dot`` in N, and kinetic with elastic energy; through the shadow switches."""
    states = history(flexible(**FREE, **TUMBLING, substeps=4), 100 * GRID)
    p, w, eta, eta_dot = states[:, :3], states[:, 3:6], states[:, 6:10], states[:, 10:]
    momentum = Rotation.from_mrp(p).apply(w @ J + eta_dot @ DELTA)
    assert np.abs(momentum - momentum[0]).max() < 1e-9 * np.linalg.norm(momentum[0])
    energy = 0.5 * np.einsum("ni,ij,nj->n", w, J, w) + np.einsum("ni,ij,nj->n", eta_dot, DELTA, w)
    energy += 0.5 * np.sum(eta_dot**2, axis=1) + 0.5 * np.sum((FREQUENCY * eta) ** 2, axis=1)
    assert np.abs(energy - energy[0]).max() < 1e-9 * energy[0]
    assert np.ptp(w, axis=0).min() > 0.01, "it hardly tumbles"
    assert np.ptp(eta, axis=0).min() > 0.01, "the modes hardly swing"
    assert (np.abs(np.diff(p, axis=0)).max(axis=1) > 0.5).any(), "no shadow switch"


def test_damping_takes_exactly_its_energy() -> None:
    """``dE/dt = -eta_dot' C eta_dot``, by Simpson's rule."""
    states = history(flexible(**QUIET, **TUMBLING, modal_damping=[0.05, 0.1, 0.02, 0.2], substeps=2), 20 * GRID)
    w, eta, eta_dot = states[:, 3:6], states[:, 6:10], states[:, 10:]
    energy = 0.5 * np.einsum("ni,ij,nj->n", w, J, w) + np.einsum("ni,ij,nj->n", eta_dot, DELTA, w)
    energy += 0.5 * np.sum(eta_dot**2, axis=1) + 0.5 * np.sum((FREQUENCY * eta) ** 2, axis=1)
    power = np.sum(2.0 * np.array([0.05, 0.1, 0.02, 0.2]) * FREQUENCY * eta_dot**2, axis=1)
    weights = np.ones(len(power))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    lost = weights @ power / (3.0 * GRID)
    assert lost > 0.01
    assert energy[0] - energy[-1] == pytest.approx(lost, rel=1e-7)


def test_a_small_steady_torque_bends_the_modes_as_statics_has_it() -> None:
    """Once the swing is damped out, ``K eta = -delta omega_dot`` with ``omega_dot = J^-1 u``."""
    torque = np.array([2e-6, -1e-6, 3e-6])
    start: dict[str, Any] = {"attitude_mrp": [0.0, 0.0, 0.0], "rate_rad_s": [0.0, 0.0, 0.0], "modal_damping": [0.5] * 4}
    last = history(flexible(**QUIET, **start), 60 * GRID, torque)[-1]
    acceleration = np.linalg.solve(J, torque)
    assert last[6:10] == pytest.approx(-(DELTA @ acceleration) / FREQUENCY**2, rel=1e-4)
    assert last[3:6] == pytest.approx(60.0 * acceleration + np.linalg.solve(J, DELTA.T @ -last[10:]), rel=1e-4)


def test_turning_the_hub_excites_each_mode_by_its_row() -> None:
    """A jerk from rest: in the first instant ``eta_ddot = -delta omega_dot``, ``(J - delta' delta) omega_dot = u``."""
    torque = np.array([10.0, -20.0, 15.0])
    plant = flexible(10**4, **QUIET, rate_rad_s=[0.0, 0.0, 0.0])
    first = plant.propagate(plant.initial_state(), 0, 1, torque)[0]
    acceleration = np.linalg.solve(J - DELTA.T @ DELTA, torque)
    assert first[3:6] * 10**4 == pytest.approx(acceleration, rel=1e-6)
    assert first[10:] * 10**4 == pytest.approx(-DELTA @ acceleration, rel=1e-3)


def test_without_coupling_it_is_a_rigid_body_beside_four_oscillators() -> None:
    """The rigid plant of the package, with a quaternion; the oscillators by their closed solution."""
    disturbance = {**STRONG, "frequency_rad_s": 0.3}
    rate, torque, substeps = [0.2, -0.1, 0.15], np.array([1.0, -2.0, 0.5]), 4
    plant = flexible(
        coupling_sqrt_kg_m=[0.0] * 12, disturbance=disturbance, rate_rad_s=rate, substeps=substeps,
        attitude_mrp=None, attitude_euler_deg=[20.0, -10.0, 40.0], modal_coordinates_sqrt_kg_m=[1.0, -2.0, 0.5, 1.0],
    )  # fmt: skip
    rigid = RigidBody(
        RigidBodyParameters.model_validate(
            {
                "inertia_kg_m2": J.ravel().tolist(),
                "attitude_euler_deg": [20.0, -10.0, 40.0],
                "rate_deg_s": np.degrees(rate).tolist(),
                "disturbance": disturbance,
                "substeps": substeps,
            }
        ),
        GRID,
    )
    states = history(plant, 30 * GRID, torque)[1:]
    other = rigid.propagate(rigid.initial_state(), 0, 30 * GRID, torque)
    q = Rotation.from_mrp(states[:, :3]).as_quat(scalar_first=True)
    q *= np.sign(np.sum(q * other[:, :4], axis=1, keepdims=True))
    assert np.abs(q - other[:, :4]).max() < 1e-9
    assert np.abs(states[:, 3:6] - other[:, 4:7]).max() < 1e-10
    t = np.arange(1, 30 * GRID + 1)[:, np.newaxis] / GRID
    damped = FREQUENCY * np.sqrt(1.0 - DAMPING**2)
    swing = np.cos(damped * t) + DAMPING * FREQUENCY / damped * np.sin(damped * t)
    expected = np.array([1.0, -2.0, 0.5, 1.0]) * np.exp(-DAMPING * FREQUENCY * t) * swing
    assert np.abs(states[:, 6:10] - expected).max() < 1e-8


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    changes = {**TUMBLING, "disturbance": {**STRONG, "frequency_rad_s": 2.0}}
    torque = np.array([5.0, -4.0, 3.0])
    exact = history(flexible(2, **changes, substeps=256), 20, torque)[-1]
    errors = [
        np.linalg.norm(history(flexible(2, **changes, substeps=substeps), 20, torque)[-1] - exact)
        for substeps in (4, 8, 16)
    ]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.1)
    assert errors[0] < 0.1


def test_grid_of_the_scenario_is_fine_enough() -> None:
    """One RK4 step of 10 ms against 16 over 100 s of swinging: far below the smallest threshold of 1e-6."""
    once, often = (history(flexible(**QUIET, substeps=substeps), 100 * GRID)[-1] for substeps in (1, 16))
    assert np.abs(once - often).max() < 1e-9


def test_the_disturbance_is_equation_76() -> None:
    """Torque impulse over one tick at rest, from the rate that it leaves."""
    plant = flexible(coupling_sqrt_kg_m=[0.0] * 12, rate_rad_s=[0.0, 0.0, 0.0])
    for second in (0, 100, 300, 900):
        after = plant.propagate(plant.initial_state(), second * GRID, 1, np.zeros(3))[0]
        sine, cosine = np.sin(0.005 * second), np.cos(0.005 * second)
        printed = 1e-4 * np.array([1.0 + 2.0 * sine, -1.0 - 5.0 * cosine, 2.0 - 4.0 * sine])
        assert J @ after[3:6] * GRID == pytest.approx(printed, abs=2e-8)


rows = arrays(np.float64, 14, elements=st.floats(-0.5, 0.5))
torques = arrays(np.float64, 3, elements=st.floats(-5.0, 5.0))


@given(rows, torques, st.integers(0, 10**6), st.integers(2, 40), st.sampled_from([1, 3]), st.data())
def test_windows_do_not_change_a_bit(
    state: FloatArray, held: FloatArray, tick: int, count: int, substeps: int, data: st.DataObject
) -> None:
    plant = flexible(substeps=substeps)
    before = state.copy()
    whole = plant.propagate(state, tick, count, held)
    split = data.draw(st.integers(1, count - 1))
    first = plant.propagate(state, tick, split, held)
    second = plant.propagate(first[-1], tick + split, count - split, held)
    assert whole.tobytes() == np.vstack([first, second]).tobytes()
    assert state.tobytes() == before.tobytes()


@given(arrays(np.float64, 3, elements=st.floats(-5.0, 5.0)).filter(lambda p: np.linalg.norm(p) > 1e-3))
def test_start_beyond_half_a_turn_is_its_shadow(p: FloatArray) -> None:
    start = flexible(attitude_mrp=p.tolist()).initial_state()
    assert start[:3] == pytest.approx(Rotation.from_mrp(p).as_mrp(), abs=1e-12) or np.isclose(np.linalg.norm(p), 1.0)
    assert np.linalg.norm(start[:3]) <= 1.0 + 1e-15


def test_start_is_the_papers() -> None:
    start = flexible().initial_state()
    assert np.array_equal(start[:3], P0)
    assert start[3:6] == pytest.approx(OMEGA0, rel=1e-15)
    assert not start[6:].any()


@pytest.mark.parametrize("angles", [[10.0, 5.0, -5.0], [170.0, -20.0, 100.0], [-120.0, 80.0, 179.0]])
def test_start_may_be_euler_angles(angles: list[float]) -> None:
    plant = flexible(attitude_mrp=None, attitude_euler_deg=angles)
    start = plant.initial_state()
    expected = Rotation.from_euler("ZYX", angles[::-1], degrees=True)
    assert start[:3] == pytest.approx(expected.as_mrp(), abs=1e-14)
    assert np.degrees(plant.euler_angles(start[np.newaxis]))[0] == pytest.approx(angles, abs=1e-10)
    assert plant.attitude_angle(start[np.newaxis])[0] == pytest.approx(expected.magnitude(), abs=1e-14)


def test_start_after_a_full_turn_is_the_reference() -> None:
    """There the quaternion is -1, and its own MRPs are infinite."""
    start = flexible(attitude_mrp=None, attitude_euler_deg=[360.0, 0.0, 0.0]).initial_state()
    assert np.abs(start[:3]).max() < 1e-15


def test_measured_errors_are_what_they_are_said_to_be() -> None:
    plant = flexible()
    random = np.random.default_rng(5)
    true = random.normal(0.0, 0.3, (20, 14))
    true[:, :3] /= np.maximum(1.0, 1.0001 * np.linalg.norm(true[:, :3], axis=1, keepdims=True))
    errors = random.normal(0.0, 1e-3, (20, plant.noise_width))
    seen = plant.measured(true, errors)
    assert np.array_equal(plant.measured(true, np.zeros((20, 6))), true)
    assert np.array_equal(seen[:, 6:], true[:, 6:])
    assert seen[:, 3:6] - true[:, 3:6] == pytest.approx(errors[:, 3:], rel=1e-9)
    turned = Rotation.from_mrp(true[:, :3]).inv() * Rotation.from_mrp(seen[:, :3])
    assert turned.as_rotvec() == pytest.approx(errors[:, :3], rel=1e-5)


def test_measured_attitude_near_half_a_turn_stays_within_one() -> None:
    """An error that leads across ``|p| = 1`` brings the shadow set with it."""
    row = np.zeros((1, 14))
    row[0, :3] = [0.0, 1.0 - 1e-9, 0.0]
    seen = flexible().measured(row, np.array([[0.0, 1e-3, 0.0, 0.0, 0.0, 0.0]]))
    assert seen[0, 1] < 0.0
    assert np.linalg.norm(seen[0, :3]) <= 1.0


def test_watches_report_norms_and_end_nothing() -> None:
    state = np.array([[0.3, 0.0, -0.4, 1e-3, 2e-3, 2e-3, 1.0, -1.0, 1.0, 1.0, *[9.0] * 4], [0.0] * 14])
    watches = flexible().watches(state)
    assert [watch.axes for watch in watches] == [("norm",)] * 3
    assert [watch.bound for watch in watches] == [None] * 3
    found = np.hstack([watch.values for watch in watches])
    assert found == pytest.approx(np.array([[0.5, 3e-3, 2.0], [0.0, 0.0, 0.0]]), rel=1e-15)


def test_the_plant_offers_what_the_modules_ask_for() -> None:
    plant = flexible()
    assert len(plant.labels) == plant.initial_state().size == 14
    assert plant.inputs == {"torque": 3}
    assert plant.noise_width == 6
    assert plant.initial_state()[plant.attitude_slice] == pytest.approx(P0)
    assert plant.initial_state()[plant.rate_slice] == pytest.approx(OMEGA0)


SKEW = [350.0, 3.0, 4.0, 3.5, 270.0, 10.0, 4.0, 10.0, 190.0]


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"inertia_kg_m2": SKEW}, "symmetric"),
        ({"inertia_uncertainty_kg_m2": SKEW}, "symmetric"),
        ({"inertia_uncertainty_kg_m2": [0.0] * 8 + [-200.0]}, "takes more from inertia_kg_m2 than there is"),
        (
            {"coupling_sqrt_kg_m": [3.0 * value for value in DELTA.ravel()]},
            "J - delta' delta must be positive definite",
        ),
        ({"coupling_sqrt_kg_m": [1.0] * 11}, "at least 12"),
        ({"modal_frequency_rad_s": [1.0, 1.0, 0.0, 1.0]}, "greater than 0"),
        ({"modal_damping": [-0.01, 0.01, 0.01, 0.01]}, "greater than or equal to 0"),
        ({"attitude_euler_deg": [1.0, 2.0, 3.0]}, "exactly one of attitude_mrp, attitude_euler_deg"),
        ({"attitude_mrp": None}, "exactly one of attitude_mrp, attitude_euler_deg"),
        ({"rate_rad_s": [0.0, float("nan"), 0.0]}, "finite number"),
        ({"substeps": 0}, "greater than 0"),
        ({"inertia": 3.0}, "Extra inputs"),
    ],
)
def test_wrong_plants_are_refused(change: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValidationError, match=reason):
        plant_parameters(**change)


def test_the_uncertainty_may_make_the_difference() -> None:
    """The mass matrix is that of J0 + dJ: the same appendages fit with one uncertainty and not with another."""
    heavy = [2.0 * value for value in DELTA.ravel()]
    bare = FlexibleParameters.model_validate(
        {**plant_parameters().model_dump(exclude_none=True), "coupling_sqrt_kg_m": heavy}
    )
    assert np.linalg.eigvalsh(bare.mass_matrix_kg_m2)[0] > 0.0
    less = [-180.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(ValidationError, match="J - delta' delta"):
        plant_parameters(coupling_sqrt_kg_m=heavy, inertia_uncertainty_kg_m2=less)
