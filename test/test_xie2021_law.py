"""Coordination error and torque of xie2021 against the paper's equations in matrices, and what they do to a body."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from pydantic import ValidationError

from etac_ros.laws.xie2021 import (
    CoordinationError,
    CoordinationErrorParameters,
    CoordinationTorque,
    CoordinationTorqueParameters,
)
from etac_ros.maths.mrp import omega_of_mrp_rate
from etac_ros.parameters import FloatArray
from etac_ros.plants.mrp_reference import (
    MrpReference,
    mrp_reference,
    mrp_reference_acceleration,
    omega_dot_of_mrp_acceleration,
)
from etac_ros.plants.rigid_mrp import RigidMrp, RigidMrpParameters

GRID = 1000
# Section 4: sigma_d = 1e-3 [2 cos 0.1 t + 3, 3 sin 0.2 t + 1, sin 0.1 t + 2].
PAPER = {
    "constant_mrp": [3e-3, 1e-3, 2e-3],
    "sine_mrp": [0.0, 3e-3, 1e-3],
    "cosine_mrp": [2e-3, 0.0, 0.0],
    "frequency_rad_s": [0.1, 0.2, 0.1],
}
INERTIAS = [np.diag(d) for d in ([15.0, 18.0, 17.0], [16.0, 19.0, 14.0], [16.0, 17.0, 16.0], [17.0, 19.0, 15.0])]
A = np.array([[0, 0, 1, 0], [1, 0, 1, 0], [1, 1, 0, 0], [1, 0, 0, 0]], dtype=float)

patient = settings(deadline=None, suppress_health_check=[HealthCheck.too_slow])


def three(limit: float) -> st.SearchStrategy[FloatArray]:
    return arrays(np.float64, 3, elements=st.floats(-limit, limit).map(lambda x: round(x, 6)))


@st.composite
def references(draw: Any) -> MrpReference:
    """Up to 0.9 in norm, up to 1.5 rad/s."""
    return MrpReference(
        constant_mrp=tuple(draw(three(0.2))),
        sine_mrp=tuple(draw(three(0.2))),
        cosine_mrp=tuple(draw(three(0.2))),
        frequency_rad_s=tuple(draw(three(1.5))),
    )


@st.composite
def inertias(draw: Any) -> FloatArray:
    """Symmetric positive definite, eigenvalues from 5 to about 40 kg m^2."""
    root = draw(arrays(np.float64, (3, 3), elements=st.floats(-3.0, 3.0).map(lambda x: round(x, 3))))
    return np.asarray(root @ root.T + 5.0 * np.eye(3))


states = st.tuples(three(0.5), three(0.5)).map(np.concatenate)


def error_of(grid: int = GRID, **values: Any) -> CoordinationError:
    values = {"inertia_kg_m2": np.eye(3).ravel().tolist(), "r": 2.0, **values}
    return CoordinationError(CoordinationErrorParameters.model_validate(values), grid)


def torque_of(inertia: FloatArray, r: float = 2.0, k0: float = 5.0) -> CoordinationTorque:
    values = {"inertia_kg_m2": inertia.ravel().tolist(), "r": r, "k0": k0}
    return CoordinationTorque(CoordinationTorqueParameters.model_validate(values), GRID)


def alone(signal: CoordinationError, states: FloatArray, tick: int) -> FloatArray:
    """Signal of a spacecraft without neighbours."""
    none = np.zeros(0)
    return signal.evaluate(states, tick, np.zeros((0, 6)), none.astype(np.int64), none)


# The paper's equations, written anew with matrices.


def skew(v: FloatArray) -> FloatArray:
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rate_matrix(sigma: FloatArray) -> FloatArray:
    """Eq. (2)."""
    return 0.5 * ((1.0 - sigma @ sigma) / 2.0 * np.eye(3) + skew(sigma) + np.outer(sigma, sigma))


def desired(reference: MrpReference, t: float) -> tuple[FloatArray, FloatArray]:
    """``sigma_d`` and ``omega_d``, from eq. (1) solved for it; the derivative is a complex step."""

    def sigma(at: complex) -> Any:
        angle = np.array(reference.frequency_rad_s) * at
        return reference.constant_mrp + reference.sine_mrp * np.sin(angle) + reference.cosine_mrp * np.cos(angle)

    rate = sigma(t + 1e-30j).imag / 1e-30
    return sigma(t), np.linalg.solve(rate_matrix(sigma(t)), rate)


def desired_acceleration(reference: MrpReference, t: float) -> FloatArray:
    """``omega_d_dot`` from differences of sixth order."""
    h = 0.02
    omega = [desired(reference, t + k * h)[1] for k in (-3, -2, -1, 1, 2, 3)]
    weights = [-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]
    return np.asarray(sum(w * o for w, o in zip(weights, omega, strict=True))) / (60.0 * h)


@given(reference=references(), t=st.floats(0.0, 100.0))
@patient
def test_reference_and_its_derivatives(reference: MrpReference, t: float) -> None:
    packed = reference.packed()
    sigma, rate, acceleration, omega, omega_dot = np.empty((5, 3))
    mrp_reference(packed, t, sigma, rate)
    mrp_reference_acceleration(packed, t, acceleration)
    omega_of_mrp_rate(sigma, rate, omega)
    omega_dot_of_mrp_acceleration(sigma, rate, acceleration, omega, omega_dot)
    expected = desired(reference, t)
    assert sigma == pytest.approx(expected[0], abs=1e-13)
    assert omega == pytest.approx(expected[1], abs=1e-12)
    assert rate == pytest.approx(rate_matrix(sigma) @ expected[1], abs=1e-13)
    assert omega_dot == pytest.approx(desired_acceleration(reference, t), abs=1e-8)
    step = 1e-30j
    angle = np.array(reference.frequency_rad_s) * (t + step)
    sine, cosine = np.array(reference.sine_mrp), np.array(reference.cosine_mrp)
    rate_of = np.array(reference.frequency_rad_s) * (sine * np.cos(angle) - cosine * np.sin(angle))
    assert acceleration == pytest.approx(rate_of.imag / 1e-30, abs=1e-13)


def test_the_papers_reference_by_hand() -> None:
    """At t = 5 pi: 0.1 t = pi / 2 and 0.2 t = pi."""
    packed = MrpReference.model_validate(PAPER).packed()
    sigma, rate, acceleration = np.empty((3, 3))
    mrp_reference(packed, 5.0 * np.pi, sigma, rate)
    mrp_reference_acceleration(packed, 5.0 * np.pi, acceleration)
    assert sigma == pytest.approx([3e-3, 1e-3, 3e-3], abs=1e-15)
    assert rate == pytest.approx([-2e-4, -6e-4, 0.0], abs=1e-15)
    assert acceleration == pytest.approx([0.0, 0.0, -1e-5], abs=1e-15)


@given(
    reference=references(),
    bodies=st.lists(states, min_size=4, max_size=4).map(np.array),
    turned=inertias(),
    tick=st.integers(0, 10**5),
    r=st.floats(0.1, 5.0),
)
@patient
def test_errors_of_a_formation_are_the_papers(
    reference: MrpReference, bodies: FloatArray, turned: FloatArray, tick: int, r: float
) -> None:
    """All four at once, with the Laplacian matrix: ``e = (L + I) sigma - 1 sigma_d`` and alike for its rate."""
    weights = A * np.array([[1.0], [0.5], [2.0], [3.0]])
    laplacian = np.diag(weights.sum(axis=1)) - weights
    sigma, omega = bodies[:, :3], bodies[:, 3:]
    rates = np.array([rate_matrix(s) @ w for s, w in zip(sigma, omega, strict=True)])
    sigma_d, omega_d = desired(reference, tick / GRID)
    omega_d_dot = desired_acceleration(reference, tick / GRID)
    e = (laplacian + np.eye(4)) @ sigma - sigma_d
    e_dot = (laplacian + np.eye(4)) @ rates - rate_matrix(sigma_d) @ omega_d
    chi = omega - omega_d + r * e
    for i, inertia in enumerate([*INERTIAS[:3], turned]):
        heard = np.flatnonzero(weights[i])
        signal = error_of(
            inertia_kg_m2=inertia.ravel().tolist(), r=r, weights=weights[i][heard].tolist(), reference=reference
        )
        broadcasts = signal.broadcast(bodies)
        assert broadcasts == pytest.approx(np.hstack([sigma, rates]), abs=1e-14)
        ticks = np.full(heard.size, tick)
        found = signal.evaluate(bodies[i : i + 1], tick, broadcasts[heard], ticks, np.ones(heard.size))[0]
        eta = skew(omega[i]) @ inertia @ omega[i] + inertia @ omega_d_dot
        assert found[0:3] == pytest.approx(chi[i], abs=1e-11)
        assert found[3:6] == pytest.approx(e_dot[i], abs=1e-11)
        assert found[6:9] == pytest.approx(eta, abs=1e-6)


@given(
    state=states,
    known=st.lists(states, min_size=3, max_size=3).map(np.array),
    tick=st.integers(500, 2000),
    ages=st.tuples(*[st.integers(0, 500)] * 3).map(np.array),
)
@patient
def test_knowledge_of_neighbours(state: FloatArray, known: FloatArray, tick: int, ages: Any) -> None:
    """Extrapolating old messages is holding new ones; held ones do not age. The rate is the last one in either case."""
    weights: dict[str, Any] = {"weights": [1.0, 0.5, 2.0]}
    heard = np.ones(3)
    moved = known.copy()
    moved[:, :3] += known[:, 3:] * (ages / GRID)[:, np.newaxis]
    now = np.full(3, tick)
    row = state[np.newaxis]
    extrapolated = error_of(**weights, knowledge="extrapolated").evaluate(row, tick, known, tick - ages, heard)
    held = error_of(**weights, knowledge="held")
    assert extrapolated == pytest.approx(held.evaluate(row, tick, moved, now, heard), abs=1e-13)
    assert np.array_equal(
        held.evaluate(row, tick, known, tick - ages, heard), held.evaluate(row, tick, known, now, heard)
    )
    assert np.array_equal(
        extrapolated[:, 3:], error_of(**weights, knowledge="held").evaluate(row, tick, known, now, heard)[:, 3:]
    )
    assert np.array_equal(extrapolated, error_of(**weights).evaluate(row, tick, known, tick - ages, heard))


def test_ages_count_on_the_grid_given() -> None:
    """By hand: r = 2, one neighbour that turned away at 0.1 1/s, 30 ticks of 1/20 s ago: chi grows by -2 0.1 1.5."""
    known = np.array([[0.0, 0.0, 0.0, 0.1, 0.0, 0.0]])
    signal = error_of(20, weights=[1.0])
    found = signal.evaluate(np.zeros((1, 6)), 100, known, np.array([70]), np.ones(1))[0]
    assert found == pytest.approx([-0.3, 0.0, 0.0, -0.1, 0.0, 0.0, 0.0, 0.0, 0.0], abs=1e-15)


@given(
    state=states,
    known=st.lists(states, min_size=3, max_size=3).map(np.array),
    heard=st.tuples(*[st.booleans()] * 3).map(np.array),
)
@patient
def test_neighbours_not_heard_are_left_out(state: FloatArray, known: FloatArray, heard: Any) -> None:
    weights = np.array([1.0, 0.5, 2.0])
    now = np.full(3, 7)
    fewer = error_of(weights=weights[heard].tolist(), reference=PAPER)
    expected = fewer.evaluate(state[np.newaxis], 7, known[heard], now[heard], np.ones(heard.sum()))
    known = known.copy()
    known[~heard] = np.nan
    whole = error_of(weights=weights.tolist(), reference=PAPER)
    assert np.array_equal(whole.evaluate(state[np.newaxis], 7, known, now, heard), expected)
    assert np.array_equal(whole.evaluate(state[np.newaxis], 7, known, now, heard.astype(float)), expected)


@given(
    rows=arrays(np.float64, st.tuples(st.integers(2, 20), st.just(6)), elements=st.floats(-0.5, 0.5)),
    tick=st.integers(0, 10**5),
    knowledge=st.sampled_from(["held", "extrapolated"]),
)
@patient
def test_windows_do_not_change_a_bit(rows: FloatArray, tick: int, knowledge: str) -> None:
    inertia = [15.0, 1.0, -0.5, 1.0, 18.0, 2.0, -0.5, 2.0, 12.0]
    signal = error_of(inertia_kg_m2=inertia, weights=[1.0, 0.3], reference=PAPER, knowledge=knowledge)
    known = np.array([[0.1, 0.2, 0.3, 0.01, 0.02, 0.03], [-0.2, 0.1, 0.0, 0.03, -0.02, 0.01]])
    ticks = np.array([tick - 40, tick - 3])
    whole = signal.evaluate(rows, tick, known, ticks, np.ones(2))
    singles = [
        signal.evaluate(np.ascontiguousarray(rows[k : k + 1]), tick + k, known, ticks, np.ones(2))
        for k in range(len(rows))
    ]
    assert whole.tobytes() == np.concatenate(singles).tobytes()
    broadcasts = [signal.broadcast(np.ascontiguousarray(rows[k : k + 1])) for k in range(len(rows))]
    assert signal.broadcast(rows).tobytes() == np.concatenate(broadcasts).tobytes()


def test_gains_by_hand() -> None:
    """``k0 + r |J| + 1`` with the largest moment of inertia: 5 + 2 x 18 + 1, and alike."""
    chi = np.array([1.0, 0, 0, 0, 0, 0, 0, 0, 0])
    found = [-torque_of(inertia).command(chi)[0] for inertia in INERTIAS]
    assert found == pytest.approx([42.0, 44.0, 40.0, 44.0], rel=1e-14)


def test_the_norm_of_the_inertia_is_the_spectral_one() -> None:
    """Moments 10, 20 and 40 about axes that are turned: |J| = 40, whatever the axes."""
    axes = np.array([[2.0, -2.0, 1.0], [1.0, 2.0, 2.0], [2.0, 1.0, -2.0]]) / 3.0
    law = torque_of(axes @ np.diag([10.0, 20.0, 40.0]) @ axes.T, r=0.5, k0=3.0)
    assert law.command(np.array([0, 0, 1.0, 0, 0, 0, 0, 0, 0])) == pytest.approx([0.0, 0.0, -24.0], rel=1e-13)


@given(signal=arrays(np.float64, 9, elements=st.floats(-1.0, 1.0)), inertia=inertias(), r=st.floats(0.1, 5.0))
@patient
def test_torque_is_the_papers(signal: FloatArray, inertia: FloatArray, r: float) -> None:
    k = 5.0 + r * np.sqrt(np.linalg.eigvalsh(inertia @ inertia)[-1]) + 1.0
    expected = -k * signal[0:3] - r * inertia @ signal[3:6] + signal[6:9]
    assert torque_of(inertia, r).command(signal) == pytest.approx(expected, rel=1e-11, abs=1e-11)


@given(
    state=states,
    known=st.lists(states, min_size=2, max_size=2).map(np.array),
    inertia=inertias(),
    reference=references(),
    seconds=st.integers(0, 20),
    r=st.floats(0.5, 3.0),
)
@patient
def test_plant_and_law_together_give_the_proofs_equation(
    state: FloatArray, known: FloatArray, inertia: FloatArray, reference: MrpReference, seconds: int, r: float
) -> None:
    """Eq. (8) with (11) of this very instant is ``J chi_dot = -k chi``; chi_dot is differenced along the motion."""
    values: dict[str, Any] = {"inertia_kg_m2": inertia.ravel().tolist(), "reference": reference}
    fast = 20 * GRID
    tick = seconds * fast
    signal = error_of(fast, r=r, weights=[1.0, 0.5], **values)
    law = torque_of(inertia, r)
    plant = RigidMrp(RigidMrpParameters.model_validate({**values, "attitude_mrp": [0, 0, 0]}), fast)
    sent = np.full(2, tick), np.ones(2)
    now = signal.evaluate(state[np.newaxis], tick, known, *sent)[0]
    motion = np.vstack([state, plant.propagate(state, tick, 4, law.command(now))])
    chi = signal.evaluate(motion, tick, known, *sent)[:, :3]
    chi_dot = fast * np.array([-25.0, 48.0, -36.0, 16.0, -3.0]) @ chi / 12.0
    k = 5.0 + r * np.linalg.eigvalsh(inertia)[-1] + 1.0
    assert inertia @ chi_dot == pytest.approx(-k * chi[0], rel=1e-5, abs=1e-5)


@given(reference=references(), inertia=inertias())
@settings(deadline=None, max_examples=20, suppress_health_check=[HealthCheck.too_slow])
def test_a_body_on_the_reference_stays_there(reference: MrpReference, inertia: FloatArray) -> None:
    """On the reference all errors vanish and u is eta; held over ticks it is late by half a tick, of first order."""
    assume(np.linalg.norm(np.abs(reference.sine_mrp) * np.abs(reference.frequency_rad_s)) > 0.05)
    values: dict[str, Any] = {"inertia_kg_m2": inertia.ravel().tolist(), "reference": reference}
    start = np.concatenate(desired(reference, 0.0))
    ends = []
    for grid in (100, 200):
        plant = RigidMrp(RigidMrpParameters.model_validate({**values, "attitude_mrp": start[:3].tolist()}), grid)
        signal = error_of(grid, **values)
        law = torque_of(inertia)
        state = start
        for tick in range(2 * grid):
            found = alone(signal, state[np.newaxis], tick)
            if tick == 0:
                assert np.abs(found[0, :6]).max() < 1e-14
                assert law.command(found[0]) == pytest.approx(found[0, 6:], abs=1e-11)
            # The estimate of the feed-forward alone, with nothing that would bring the body back.
            state = plant.propagate(state, tick, 1, found[0, 6:])[0]
        ends.append(plant.errors(state[np.newaxis], 2 * grid)[0])
    assert np.abs(ends[1]).max() < 0.05
    # Without the part of first order nothing is left.
    assert np.abs(2.0 * ends[1] - ends[0]).max() < 2e-4


def test_without_neighbours_the_reference_leads() -> None:
    """The closed loop of one spacecraft: from 60 deg to within 0.1 mrad of the moving reference in 30 s."""
    values: dict[str, Any] = {"inertia_kg_m2": INERTIAS[0].ravel().tolist(), "reference": PAPER}
    plant = RigidMrp(RigidMrpParameters.model_validate({**values, "attitude_mrp": [0.2, -0.15, 0.1]}), GRID)
    signal, law = error_of(**values), torque_of(INERTIAS[0])
    state = plant.initial_state()
    for tick in range(30 * GRID):
        state = plant.propagate(state, tick, 1, law.command(alone(signal, state[np.newaxis], tick)[0]))[0]
    assert np.abs(plant.errors(state[np.newaxis], 30 * GRID)).max() < 2.5e-5


def test_sizes_are_checked() -> None:
    signal = error_of(weights=[1.0, 2.0])
    assert (signal.size, signal.broadcast_size, signal.neighbours) == (9, 6, 2)
    state, known, now = np.zeros((1, 6)), np.zeros((2, 6)), np.zeros(2, dtype=np.int64)
    with pytest.raises(ValueError, match=r"broadcasts of shape \(2, 6\)"):
        signal.evaluate(state, 0, known[:1], now, np.ones(2))
    with pytest.raises(ValueError, match="found 7 columns"):
        signal.evaluate(np.zeros((1, 7)), 0, known, now, np.ones(2))
    with pytest.raises(ValueError, match="ticks and marks of 2 neighbours"):
        signal.evaluate(state, 0, known, now[:1], np.ones(2))
    with pytest.raises(ValueError, match="ticks and marks of 2 neighbours"):
        signal.evaluate(state, 0, known, now, np.ones(3))


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ({"r": 0.0}, "r"),
        ({"weights": [1.0, 0.0]}, "weights.1"),
        ({"inertia_kg_m2": [1.0, 0.5, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]}, "inertia_kg_m2"),
        ({"knowledge": "guessed"}, "knowledge"),
        ({"reference": {"constant_mrp": [2.0, 0.0, 0.0]}}, "reference"),
    ],
)
def test_wrong_parameters_are_refused(values: dict[str, Any], where: str) -> None:
    with pytest.raises(ValidationError) as caught:
        error_of(**values)
    assert [".".join(map(str, fault["loc"])) for fault in caught.value.errors()] == [where]
