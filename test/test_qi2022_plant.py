"""Dynamics of the PM/SM pair against a second formulation, and what physics demands of them."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation
from test_qi2022_numbers import TICKS_PER_SECOND, patient, plant_parameters

from etac_ros.parameters import FloatArray, square
from etac_ros.plants.pm_sm import PmSm, PmSmParameters

# Everything that the scenario leaves at zero, and sizes at which each term matters within 30 s.
HARD: dict[str, Any] = {
    "orbit_rate_rad_s": [0.004, -0.02, 0.007],
    "cmg_momentum_nms": [0.5, -0.8, 0.3],
    "ncla_disturbance_nm": [0.01, 0.02, -0.015],
    "disturbance_pm": {"sine_nm": [0.02, 0.0, 0.01], "cosine_nm": [0.0, 0.03, 0.01],
                       "phase_rad": [1.0, 0.5, -1.0], "frequency_rad_s": [0.3, 0.7, 0.5]},
    "disturbance_sm": {"sine_nm": [0.05, 0.01, 0.03], "cosine_nm": [0.0, 0.04, -0.02],
                       "phase_rad": [0.1, 0.7, 2.0], "frequency_rad_s": [0.9, 0.4, 0.2]},
    "rate_pm_deg_s": [1.0, -2.0, 1.5],
    "rate_sm_deg_s": [-1.5, 1.0, 2.0],
    "modal_coordinates_sqrt_kg_m": [0.02, -0.01, 0.03],
    "modal_rates_sqrt_kg_m_s": [0.01, 0.02, -0.02],
}  # fmt: skip
_QUIET: dict[str, Any] = {
    "orbit_rate_rad_s": [0.0, 0.0, 0.0], "disturbance_pm": {}, "disturbance_sm": {},
}  # fmt: skip
_READINGS: dict[str, dict[str, Any]] = {
    "one panel": {},
    "gyroscopic panels": {"gyroscopic_panels": True},
    "continuous feed-forward": {"continuous_feed_forward": True, "coupling_scale": 0.85},
    "two light panels": {"panels": 2, "coupling_scale": 0.3},
}


class Inertial:
    """The same pair written down anew: inertial attitudes and rates, both panels apart, stacked mass matrix.

    State ``[R_ip (9), omega_pi (3), R_is (9), omega_si (3), eta_1 (3), eta_1_dot (3), eta_2 (3), eta_2_dot (3)]``;
    ``R_ib`` takes components in B to inertial ones. The orbital frame is a given function of time.
    """

    def __init__(self, parameters: PmSmParameters) -> None:
        self.p = parameters
        self.inertia_pm = square(parameters.inertia_pm_kg_m2)
        self.inertia_sm = square(parameters.inertia_sm_kg_m2)
        self.coupling = square(parameters.coupling_sqrt_kg_m) * parameters.coupling_scale**0.5
        if parameters.panels == 1:
            # One panel that stands for both: two with the coupling matrix over sqrt 2 each.
            self.coupling = self.coupling / 2.0**0.5
        self.orbit_rate = np.array(parameters.orbit_rate_rad_s)

    def orbital_frame(self, t: float) -> FloatArray:
        """``R_io``."""
        return np.asarray(Rotation.from_rotvec(self.orbit_rate * t).as_matrix())

    @staticmethod
    def torque(given: Any, t: float) -> FloatArray:
        """An external torque at a time."""
        angles = np.array(given.phase_rad) + np.array(given.frequency_rad_s) * t
        return np.asarray(np.array(given.sine_nm) * np.sin(angles) + np.array(given.cosine_nm) * np.cos(angles))

    def accelerations(
        self, t: float, y: FloatArray, torque_pm: FloatArray, torque_sm: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """``omega_pi_dot``, ``omega_si_dot`` and the panels' ``eta_ddot`` (6)."""
        R_ip, omega_pi = y[0:9].reshape(3, 3), y[9:12]
        R_is, omega_si = y[12:21].reshape(3, 3), y[21:24]
        eta, eta_dot = y[[24, 25, 26, 30, 31, 32]], y[[27, 28, 29, 33, 34, 35]]
        ncla = torque_pm + np.array(self.p.ncla_disturbance_nm)
        pm = ncla + self.torque(self.p.disturbance_pm, t)
        omega_pi_dot = np.linalg.solve(self.inertia_pm, pm - np.cross(omega_pi, self.inertia_pm @ omega_pi))
        both = np.hstack([self.coupling, self.coupling])
        frequency = np.tile(self.p.modal_frequency_rad_s, 2)
        damping = np.tile(self.p.modal_damping, 2)
        momentum = self.inertia_sm @ omega_si + np.array(self.p.cmg_momentum_nms)
        reaction = R_is.T @ R_ip @ ncla
        sm = torque_sm + self.torque(self.p.disturbance_sm, t) - reaction - np.cross(omega_si, momentum)
        if self.p.gyroscopic_panels:
            sm -= np.cross(omega_si, both @ eta_dot)
        if self.p.continuous_feed_forward:
            omega_pi_s = R_is.T @ R_ip @ omega_pi
            turning = R_is.T @ R_ip @ omega_pi_dot - np.cross(omega_si - omega_pi_s, omega_pi_s)
            sm += reaction + np.cross(omega_si, momentum) + self.inertia_sm @ turning
        modal = -2.0 * damping * frequency * eta_dot - frequency**2 * eta
        stacked = np.block([[self.inertia_sm, both], [both.T, np.eye(6)]])
        solved = np.linalg.solve(stacked, np.concatenate([sm, modal]))
        return omega_pi_dot, solved[:3], solved[3:]

    def rate(self, t: float, y: FloatArray, torque_pm: FloatArray, torque_sm: FloatArray) -> FloatArray:
        """Time derivative of the state."""
        omega_pi_dot, omega_si_dot, eta_ddot = self.accelerations(t, y, torque_pm, torque_sm)
        return np.concatenate(
            [
                (y[0:9].reshape(3, 3) @ _cross_matrix(y[9:12])).ravel(),
                omega_pi_dot,
                (y[12:21].reshape(3, 3) @ _cross_matrix(y[21:24])).ravel(),
                omega_si_dot,
                y[27:30],
                eta_ddot[:3],
                y[33:36],
                eta_ddot[3:],
            ]
        )

    def from_plant(self, t: float, state: FloatArray) -> FloatArray:
        """A state of the package's plant, in these coordinates."""
        R_po = _passive(state[0:4])
        R_sp = _passive(state[7:11])
        R_ip = self.orbital_frame(t) @ R_po.T
        omega_pi = state[4:7] + R_po @ self.orbit_rate
        omega_si = state[11:14] + R_sp @ omega_pi
        share = 1.0 if self.p.panels == 2 else 2.0**-0.5
        panel = np.concatenate([state[14:17], state[17:20]]) * share
        if self.p.panels == 2:
            panel = panel / 2.0**0.5  # merged coordinates are sqrt 2 times those of each of two equal panels
        return np.concatenate([R_ip.ravel(), omega_pi, (R_ip @ R_sp.T).ravel(), omega_si, panel, panel])

    def to_plant(self, t: float, y: FloatArray) -> FloatArray:
        """Back again; quaternions with positive scalar part."""
        R_ip, R_is = y[0:9].reshape(3, 3), y[12:21].reshape(3, 3)
        R_po = R_ip.T @ self.orbital_frame(t)
        R_sp = R_is.T @ R_ip
        merged = y[24:30] * 2.0**0.5
        return np.concatenate(
            [
                _quaternion(R_po),
                y[9:12] - R_po @ self.orbit_rate,
                _quaternion(R_sp),
                y[21:24] - R_sp @ y[9:12],
                merged,
            ]
        )


def _cross_matrix(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def _passive(q: FloatArray) -> FloatArray:
    """Eq. (5): the matrix that takes components in the reference to components in the body."""
    return np.asarray(Rotation.from_quat(q, scalar_first=True).as_matrix().T)


def _quaternion(passive: FloatArray) -> FloatArray:
    q = np.asarray(Rotation.from_matrix(passive.T).as_quat(scalar_first=True))
    return q if q[0] >= 0.0 else -q


def _aligned(states: FloatArray) -> FloatArray:
    """States with both scalar parts positive: q and -q are the same attitude."""
    states = states.copy()
    for attitude in (slice(0, 4), slice(7, 11)):
        states[:, attitude] *= np.sign(states[:, attitude.start])[:, np.newaxis]
    return states


@pytest.mark.parametrize("reading", list(_READINGS))
def test_second_formulation_agrees_over_30_s(reading: str) -> None:
    """Piecewise-constant torques, everything switched on: 1e-9 in every component of the state."""
    parameters = plant_parameters(**HARD, **_READINGS[reading], substeps=16)
    plant, second = PmSm(parameters, TICKS_PER_SECOND), Inertial(parameters)
    random = np.random.default_rng(20)
    state = plant.initial_state()
    y = second.from_plant(0.0, state)
    for piece in range(15):
        held = random.uniform(-0.3, 0.3, 6)
        ticks = 2 * TICKS_PER_SECOND
        state = plant.propagate(state, piece * ticks, ticks, held)[-1]
        span = (2.0 * piece, 2.0 * piece + 2.0)
        y = solve_ivp(second.rate, span, y, method="DOP853", rtol=1e-13, atol=1e-14, args=(held[:3], held[3:])).y[:, -1]
        ours, theirs = _aligned(state[np.newaxis])[0], second.to_plant(span[1], y)
        assert np.abs(ours - theirs).max() < 1e-9, f"at {span[1]} s"
    assert np.abs(state[11:14]).max() > 0.01, "the test moves hardly at all"
    assert np.abs(state[14:17]).max() > 0.01, "the panels hardly swing"


def _angular_momentum(parameters: PmSmParameters, state: FloatArray) -> FloatArray:
    """Of PM, SM, CMGs and panels together, in O, which is at rest here [N m s]."""
    R_po, R_sp = _passive(state[0:4]), _passive(state[7:11])
    omega_si = state[11:14] + R_sp @ state[4:7]
    sm = square(parameters.inertia_sm_kg_m2) @ omega_si + parameters.coupling_matrix @ state[17:20]
    sm = sm + np.array(parameters.cmg_momentum_nms)
    pm: FloatArray = square(parameters.inertia_pm_kg_m2) @ state[4:7]
    return np.asarray(R_po.T @ (pm + R_sp.T @ sm))


def test_angular_momentum_is_conserved_whatever_the_ncla_does() -> None:
    """The NCLA's torque is internal. With the panels in the gyroscopic term, nothing at all changes the sum."""
    parameters = plant_parameters(**{**HARD, **_QUIET}, gyroscopic_panels=True, substeps=8)
    plant = PmSm(parameters, TICKS_PER_SECOND)
    random = np.random.default_rng(3)
    state = plant.initial_state()
    before = _angular_momentum(parameters, state)
    for piece in range(30):
        held = np.concatenate([random.uniform(-0.3, 0.3, 3), np.zeros(3)])
        state = plant.propagate(state, 20 * piece, 20, held)[-1]
    assert np.abs(_angular_momentum(parameters, state) - before).max() < 1e-10 * np.linalg.norm(before)
    assert np.abs(state[17:20]).max() > 0.01, "the panels hardly swing"


def test_printed_equation_loses_exactly_the_panels_gyroscopic_term() -> None:
    """Eq. (4) as printed: the momentum drifts by the integral of ``omega_si x Delta eta_dot``."""
    parameters = plant_parameters(**{**HARD, **_QUIET}, substeps=4)
    fine = 200
    plant = PmSm(parameters, fine)
    states = np.vstack([plant.initial_state(), plant.propagate(plant.initial_state(), 0, 10 * fine, np.zeros(6))])
    drift = _angular_momentum(parameters, states[-1]) - _angular_momentum(parameters, states[0])
    terms = []
    for state in states:
        R_po, R_sp = _passive(state[0:4]), _passive(state[7:11])
        omega_si = state[11:14] + R_sp @ state[4:7]
        terms.append(R_po.T @ R_sp.T @ np.cross(omega_si, parameters.coupling_matrix @ state[17:20]))
    weights = np.ones(len(terms))
    weights[1:-1:2], weights[2:-1:2] = 4.0, 2.0
    integral = weights @ np.array(terms) / (3.0 * fine)  # Simpson
    assert np.abs(drift).max() > 1e-4
    assert np.abs(drift - integral).max() < 1e-8


def test_integrator_is_of_fourth_order() -> None:
    """Half the step, a sixteenth of the error."""
    finals = []
    for substeps in (1, 2, 4, 64):
        plant = PmSm(plant_parameters(**HARD, substeps=substeps), TICKS_PER_SECOND)
        state = plant.initial_state()
        finals.append(plant.propagate(state, 0, 10 * TICKS_PER_SECOND, np.full(6, 0.1))[-1])
    errors = [float(np.linalg.norm(final - finals[-1])) for final in finals[:-1]]
    assert 14.0 < errors[0] / errors[1] < 18.0
    assert 14.0 < errors[1] / errors[2] < 18.0


def test_damped_panels_come_to_rest() -> None:
    """Energy of the panels alone, with nothing to drive them, decays at the rate of the slowest mode or faster."""
    start = {
        "modal_coordinates_sqrt_kg_m": [0.1, 0.1, 0.1],
        "rate_pm_deg_s": [0.0] * 3,
        "rate_sm_deg_s": [0.0] * 3,
    }
    plant = PmSm(plant_parameters(**{**_QUIET, **start}), TICKS_PER_SECOND)
    states = plant.propagate(plant.initial_state(), 0, 400 * TICKS_PER_SECOND, np.zeros(6))
    early, late = np.abs(states[:1000, 14:17]).max(), np.abs(states[-1000:, 14:17]).max()
    assert 0.0 < late < 0.2 * early


def _attitude(draw: Any) -> FloatArray:
    q = draw(arrays(np.float64, 4, elements=st.floats(-1.0, 1.0)).filter(lambda q: np.linalg.norm(q) > 0.1))
    return np.asarray(q / np.linalg.norm(q))


@st.composite
def states(draw: Any) -> FloatArray:
    """Any attitude; rates and modes far beyond those of a run."""
    return np.concatenate(
        [
            _attitude(draw),
            draw(arrays(np.float64, 3, elements=st.floats(-0.2, 0.2))),
            _attitude(draw),
            draw(arrays(np.float64, 9, elements=st.floats(-0.2, 0.2))),
        ]
    )


torques = arrays(np.float64, 6, elements=st.floats(-5.0, 5.0))


@given(state=states(), held=torques, tick=st.integers(0, 10**6), count=st.integers(2, 12), data=st.data())
@patient
def test_windows_do_not_change_a_bit(
    state: FloatArray, held: FloatArray, tick: int, count: int, data: st.DataObject
) -> None:
    plant = PmSm(plant_parameters(**HARD), TICKS_PER_SECOND)
    whole = plant.propagate(state, tick, count, held)
    split = data.draw(st.integers(1, count - 1))
    first = plant.propagate(state, tick, split, held)
    second = plant.propagate(first[-1], tick + split, count - split, held)
    assert np.array_equal(whole, np.vstack([first, second]))


@given(state=states(), held=torques)
@patient
def test_attitudes_stay_unit_quaternions(state: FloatArray, held: FloatArray) -> None:
    after = PmSm(plant_parameters(**HARD), TICKS_PER_SECOND).propagate(state, 0, 20, held)
    assert np.isfinite(after).all()
    for attitude in (slice(0, 4), slice(7, 11)):
        assert np.allclose(np.linalg.norm(after[:, attitude], axis=1), 1.0, rtol=0.0, atol=1e-14)


@given(state=states(), held=torques, signs=st.tuples(st.sampled_from([-1.0, 1.0]), st.sampled_from([-1.0, 1.0])))
@patient
def test_both_quaternions_of_an_attitude_move_alike(
    state: FloatArray, held: FloatArray, signs: tuple[float, float]
) -> None:
    plant = PmSm(plant_parameters(**HARD), TICKS_PER_SECOND)
    factors = np.ones(20)
    factors[0:4], factors[7:11] = signs
    assert np.array_equal(plant.propagate(state * factors, 0, 5, held), plant.propagate(state, 0, 5, held) * factors)


@given(state=states(), held=torques, other=torques)
@patient
def test_nothing_done_to_the_sm_moves_the_pm(state: FloatArray, held: FloatArray, other: FloatArray) -> None:
    """Without contact: the PM feels the NCLA's commanded torque and nothing else of the SM."""
    plant = PmSm(plant_parameters(**HARD), TICKS_PER_SECOND)
    torque_pm = held[:3]
    moved = state.copy()
    moved[7:] = PmSm(plant_parameters(), TICKS_PER_SECOND).initial_state()[7:]
    one = plant.propagate(state, 0, 5, held)
    two = plant.propagate(moved, 0, 5, np.concatenate([torque_pm, other[3:]]))
    assert np.array_equal(one[:, :7], two[:, :7])


@given(state=states())
@patient
def test_gap_angles_are_the_rotation_vector(state: FloatArray) -> None:
    plant = PmSm(plant_parameters(), TICKS_PER_SECOND)
    angles = plant.gap_angles(state[np.newaxis])
    expected = Rotation.from_quat(state[7:11], scalar_first=True).as_rotvec()
    if abs(state[7]) > 1e-6:  # at half a turn the axis may point either way
        assert np.allclose(angles[0], expected, rtol=0.0, atol=1e-12)
    assert np.linalg.norm(angles[0]) == pytest.approx(plant.attitude_angle(state[np.newaxis])[0], abs=1e-12)


def test_gap_angles_of_no_rotation() -> None:
    state = PmSm(plant_parameters(), TICKS_PER_SECOND).initial_state()[np.newaxis]
    state[:, 7:11] = [1.0, 0.0, 0.0, 0.0]
    assert np.array_equal(PmSm(plant_parameters(), TICKS_PER_SECOND).gap_angles(state), np.zeros((1, 3)))


def test_measured_errors_are_what_they_are_said_to_be() -> None:
    plant = PmSm(plant_parameters(), TICKS_PER_SECOND)
    true = np.repeat(plant.initial_state()[np.newaxis], 3, axis=0)
    errors = np.random.default_rng(5).normal(0.0, 1e-3, (3, plant.noise_width))
    seen = plant.measured(true, errors)
    assert np.array_equal(plant.measured(true, np.zeros((3, plant.noise_width))), true)
    assert np.array_equal(seen[:, 14:], true[:, 14:])
    for row in range(3):
        for attitude, rate, mine in ((slice(7, 11), slice(11, 14), errors[row, 0:6]),
                                     (slice(0, 4), slice(4, 7), errors[row, 6:12])):  # fmt: skip
            before = Rotation.from_quat(true[row, attitude], scalar_first=True)
            after = Rotation.from_quat(seen[row, attitude], scalar_first=True)
            assert np.allclose((before.inv() * after).as_rotvec(), mine[:3], rtol=1e-5, atol=0.0)
            assert np.allclose(seen[row, rate] - true[row, rate], mine[3:], rtol=1e-12, atol=1e-17)
