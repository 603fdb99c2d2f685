"""The manoeuvring body against another integrator of another formulation, and its error against absolute attitudes.

The independent one keeps the absolute attitude as a matrix and the angular momentum in the inertial frame; scipy's
DOP853 integrates them with an adaptive step. The error comes from rotation matrices only at the end.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from etac_ros.parameters import FloatArray
from etac_ros.plants.manoeuvre import Manoeuvre, ManoeuvreParameters
from etac_ros.plants.plant import Plant, watches_of

GRID = 100
INERTIA = [30.0, 0.5, -0.3, 0.5, 20.0, 0.2, -0.3, 0.2, 10.0]
START = [-np.sqrt(0.91), 0.1, 0.2, -0.2]
DESIRED = [-np.sqrt(0.7), -0.1, 0.5, 0.2]
DISTURBANCE = {"sine_nm": [0.005, 0.0, 0.005], "cosine_nm": [0.0, 0.005, 0.0], "frequency_rad_s": [0.1, 0.1, 0.05]}
J = np.array(INERTIA).reshape(3, 3)


def body(grid: int = GRID, **changes: Any) -> Manoeuvre:
    values = {
        "inertia_kg_m2": INERTIA,
        "attitude_q": START,
        "desired_attitude_q": DESIRED,
        "disturbance": DISTURBANCE,
        **changes,
    }
    return Manoeuvre(ManoeuvreParameters.model_validate(values), grid)


def rotation(q: Any) -> Rotation:
    """From components in the body to components in the reference."""
    return Rotation.from_quat(q, scalar_first=True)


def inertial(y: FloatArray) -> tuple[FloatArray, FloatArray]:
    R = y[3:].reshape(3, 3)
    return R, np.linalg.solve(J, R.T @ y[:3])


def motion(t: float, y: FloatArray, torque: FloatArray) -> FloatArray:
    R, w = inertial(y)
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    d = 0.005 * np.array([np.sin(t / 10.0), np.cos(t / 10.0), np.sin(t / 20.0)])
    return np.concatenate([R @ (torque + d), (R @ W).ravel()])


@pytest.mark.parametrize("rate", [[0.0, 0.0, 0.0], [0.18, 0.18, -0.18], [-0.3, 0.2, 0.35]])
def test_error_follows_the_absolute_attitude(rate: list[float]) -> None:
    plant = body(rate_rad_s=rate)
    R0 = rotation(START).as_matrix()
    y = np.concatenate([R0 @ J @ np.array(rate), R0.ravel()])
    state, tick = plant.initial_state(), 0
    turned = 0.0
    torques = np.array([[1.0, -2.0, 0.5], [-2.0, 2.0, 1.0], [0.0, 0.0, 0.0], [0.3, 1.0, -1.5]])
    for torque, seconds in zip(torques, [2, 3, 5, 4], strict=True):
        states = plant.propagate(state, tick, GRID * seconds, torque)
        turned += float(np.linalg.norm(states[:, 4:7], axis=1).mean()) * seconds
        begin, end = tick / GRID, tick / GRID + seconds
        y = solve_ivp(motion, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14, args=(torque,)).y[:, -1]
        state, tick = states[-1], tick + GRID * seconds
        R, w = inertial(y)
        # The body relative to the desired attitude: what Q_d* Q means.
        error = rotation(DESIRED).as_matrix().T @ R
        assert rotation(state[0:4]).as_matrix() == pytest.approx(error, abs=1e-9)
        assert state[4:7] == pytest.approx(w, abs=1e-9)
    assert turned > 2.0  # rad: far enough to tell


def test_start_is_the_error_of_section_4() -> None:
    """Eq. (3) by hand, with ``Q_d*``: vector ``q_d0 q - q_0 q_d - q_d x q``, scalar ``q_d0 q_0 + q_d . q``."""
    qd, q = np.array(DESIRED[1:]), np.array(START[1:])
    state = body(rate_rad_s=[0.1, -0.2, 0.3]).initial_state()
    assert state[0] == pytest.approx(DESIRED[0] * START[0] + qd @ q, abs=1e-15)
    assert state[1:4] == pytest.approx(DESIRED[0] * q - START[0] * qd - np.cross(qd, q), abs=1e-15)
    assert np.linalg.norm(state[0:4]) == pytest.approx(1.0, abs=1e-15)
    assert state[4:7].tolist() == [0.1, -0.2, 0.3]


def test_at_the_destination_there_is_no_error() -> None:
    state = body(attitude_q=DESIRED).initial_state()
    assert state == pytest.approx([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-15)


def test_halving_the_step_divides_the_error_by_sixteen() -> None:
    fast = {"rate_rad_s": [0.9, -0.6, 0.5], "disturbance": {"sine_nm": [5.0, 3.0, 2.0], "frequency_rad_s": [2.0] * 3}}
    torque = np.array([2.0, -1.0, 0.5])

    def end(substeps: int) -> FloatArray:
        plant = body(2, substeps=substeps, **fast)
        return plant.propagate(plant.initial_state(), 0, 20, torque)[-1]

    errors = [np.linalg.norm(end(substeps) - end(128)) for substeps in (4, 8, 16)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(16.0, rel=0.1)
    assert errors[2] > 1e-9  # above rounding


cuts = st.lists(st.integers(0, 200), max_size=6).map(lambda some: sorted({0, 200, *some}))


@given(cuts, st.tuples(*[st.floats(-2.0, 2.0)] * 3).map(np.array), st.integers(0, 10**6))
def test_windows_leave_no_trace(cuts: list[int], torque: FloatArray, first: int) -> None:
    plant = body(rate_rad_s=[0.1, 0.2, -0.1])
    state = plant.initial_state()
    together = plant.propagate(state, first, 200, torque)
    parts = []
    for start, end in pairwise(cuts):
        parts.append(plant.propagate(state, first + start, end - start, torque))
        state = parts[-1][-1]
    assert np.concatenate(parts).tobytes() == together.tobytes()


def test_rate_is_watched_on_each_axis() -> None:
    states = np.zeros((3, 7))
    states[:, 0] = 1.0
    states[1, 4:7] = [0.1, -0.45, 0.2]
    _, watch = watches_of(body(rate_limit_rad_s=0.4), states)
    assert (watch.name, watch.unit, watch.bound) == ("angular velocity", "rad/s", 0.4)
    assert watch.values.tolist() == states[:, 4:7].tolist()
    assert watches_of(body(), states)[1].bound is None


def test_sensors_add_their_errors() -> None:
    plant = body()
    states = np.tile(plant.initial_state(), (2, 1))
    errors = np.array([[0.0] * 6, [1e-3, -2e-3, 3e-3, 0.1, 0.2, 0.3]])
    seen = plant.measured(states, errors)
    assert seen[0] == pytest.approx(states[0], abs=1e-15)
    between = (rotation(states[1, 0:4]).inv() * rotation(seen[1, 0:4])).as_rotvec()
    assert between == pytest.approx(errors[1, 0:3], rel=1e-4)
    assert seen[1, 4:7] == pytest.approx(states[1, 4:7] + [0.1, 0.2, 0.3])


def test_angles_are_those_of_the_error() -> None:
    states = body().initial_state()[np.newaxis]
    error = rotation(DESIRED).inv() * rotation(START)
    assert body().attitude_angle(states)[0] == pytest.approx(error.magnitude())
    assert body().euler_angles(states)[0] == pytest.approx(error.as_euler("ZYX")[::-1])


def test_the_printed_start_is_no_attitude() -> None:
    """Section 4 prints the scalar part ``-sqrt(0.95)``."""
    with pytest.raises(ValidationError, match=r"unit quaternion.*1\.0198"):
        body(attitude_q=[-np.sqrt(0.95), 0.1, 0.2, -0.2])


@pytest.mark.parametrize(
    "change",
    [
        {"rate_limit_rad_s": 0.0},
        {"substeps": 0},
        {"inertia_kg_m2": [-1.0, *INERTIA[1:]]},
        {"desired_attitude_q": [2.0, 0, 0, 0]},
    ],
)
def test_wrong_parameters_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        body(**change)


def test_nothing_of_the_protocol_is_missing() -> None:
    members = {name for name in (*Plant.__annotations__, *vars(Plant)) if not name.startswith("_")}
    plant = body()
    assert [name for name in sorted(members) if not hasattr(plant, name)] == []
    assert len(plant.labels) == plant.initial_state().size
