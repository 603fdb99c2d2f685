"""The rigid plant against another integrator of another formulation of the same mechanics.

Here the angular momentum is kept in the inertial frame, where only torques change it, and the attitude as a matrix;
scipy's DOP853 integrates them with an adaptive step. Nothing of etac_ros takes part.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from etac_ros.parameters import FloatArray
from etac_ros.plants.rigid import RigidBody, RigidBodyParameters

J = np.array([[147.0, 6.5, 6.0], [6.5, 158.0, 5.5], [6.0, 5.5, 137.0]])
GRID = 32


def disturbance(t: float) -> FloatArray:
    """Eq. (38) of wu2018."""
    w = 0.005
    return np.array(
        [
            1e-4 + 2e-4 * np.sin(w * t),
            -1e-4 - 5e-4 * np.cos(w * t),
            2e-4 - 4e-4 * np.cos(w * t),
        ]
    )


def inertial(y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Matrix from body to reference components, and the rate in the body."""
    R = y[3:].reshape(3, 3)
    return R, np.linalg.solve(J, R.T @ y[:3])


def motion(t: float, y: FloatArray, torque: FloatArray) -> FloatArray:
    R, w = inertial(y)
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    return np.concatenate([R @ (torque + disturbance(t)), (R @ W).ravel()])


@pytest.mark.parametrize(("scale", "substeps"), [(0.05, 1), (1.0, 4)])
def test_states_agree(scale: float, substeps: int) -> None:
    rate = scale * np.array([4.0, -3.0, 2.0])
    plant = RigidBody(
        RigidBodyParameters.model_validate(
            {
                "inertia_kg_m2": J.ravel().tolist(),
                "attitude_euler_deg": [10.0, 5.0, -5.0],
                "rate_deg_s": rate.tolist(),
                "disturbance": {
                    "constant_nm": [1e-4, -1e-4, 2e-4],
                    "sine_nm": [2e-4, 0.0, 0.0],
                    "cosine_nm": [0.0, -5e-4, -4e-4],
                    "frequency_rad_s": 0.005,
                },
                "substeps": substeps,
            }
        ),
        GRID,
    )
    R = Rotation.from_euler("ZYX", [-5.0, 5.0, 10.0], degrees=True).as_matrix()
    y = np.concatenate([R @ J @ np.radians(rate), R.ravel()])
    state = plant.initial_state()
    tick = 0
    torques = scale * np.array([[0.2, -0.1, 0.05], [-0.2, 0.2, 0.2], [0.0, 0.0, 0.0], [0.1, 0.2, -0.2]])
    for torque, seconds in zip(torques, [7, 13, 10, 20], strict=True):
        count = GRID * seconds
        states = plant.propagate(state, tick, count, torque)
        begin, end = tick / GRID, (tick + count) / GRID
        solution = solve_ivp(motion, (begin, end), y, method="DOP853", rtol=1e-13, atol=1e-14, args=(torque,))
        y = solution.y[:, -1]
        R, w = inertial(y)
        q = Rotation.from_matrix(R).as_quat(scalar_first=True)
        state, tick = states[-1], tick + count
        assert state[0:4] * np.sign(state[0:4] @ q) == pytest.approx(q, abs=1e-9)
        assert state[4:7] == pytest.approx(w, abs=1e-9)
    # It has turned far enough to tell.
    assert scale < 1.0 or np.linalg.norm(states[:, 4:7], axis=1).mean() * 50.0 > np.pi
