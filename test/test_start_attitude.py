"""One attitude, one result: a start written a whole turn further, or with the other sign, is the same start."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from etac_ros.maths.quaternion import from_euler_321, rotation_angle
from etac_ros.plants.flexible import Flexible
from etac_ros.plants.manoeuvre import Manoeuvre
from etac_ros.plants.pm_sm import PmSm
from etac_ros.plants.rigid import RigidBody
from etac_ros.plants.start import Rotation, start_attitude, start_of_euler_321
from etac_ros.runs import simulate
from etac_ros.scenario.load import load

degrees = st.floats(-180.0, 180.0, allow_subnormal=False)
turns = st.integers(-3, 3)
signs = st.lists(st.floats(-1.0, 1.0, allow_subnormal=False), min_size=4, max_size=4)


def rigid(**start: Any) -> RigidBody:
    return RigidBody(RigidBody.Parameters(inertia_kg_m2=(2, 0, 0, 0, 3, 0, 0, 0, 4), **start), 10)


@given(st.tuples(degrees, degrees, degrees), st.tuples(turns, turns, turns))
def test_whole_turns_of_euler_angles_are_left_out(angles: tuple[float, ...], added: tuple[int, ...]) -> None:
    turned = [angle + 360.0 * n for angle, n in zip(angles, added, strict=True)]
    reduced = [angle - 360.0 * n for angle, n in zip(turned, added, strict=True)]  # what the sum could still hold
    start = rigid(attitude_euler_deg=tuple(turned)).initial_state()
    assume(all(abs(angle) < 180.0 for angle in reduced))
    assert start.tobytes() == rigid(attitude_euler_deg=tuple(reduced)).initial_state().tobytes()
    assert start[0] >= -1e-12
    same_way = np.abs(start[:4] @ from_euler_321(np.radians(turned)))
    assert same_way == pytest.approx(1.0, abs=1e-9)


@given(signs)
def test_a_quaternion_and_its_negative_are_one_start(values: list[float]) -> None:
    assume(np.linalg.norm(values) > 0.1)
    q = np.array(values) / np.linalg.norm(values)
    start, other = start_attitude(q, Rotation.SHORTEST), start_attitude(-q, Rotation.SHORTEST)
    assert start.tobytes() == other.tobytes()
    assert start[0] >= -1e-12
    assert rotation_angle(start) <= np.pi + 1e-9
    assert np.array_equal(start_attitude(q, Rotation.AS_GIVEN), q)


@pytest.mark.parametrize("turn", [180.0, -180.0, 540.0])
def test_half_a_turn_has_one_way_too(turn: float) -> None:
    for axis in range(3):
        angles = [0.0, 0.0, 0.0]
        angles[axis] = turn
        if axis != 1:  # pitch is half a turn of all three angles as well
            start = start_of_euler_321(angles, Rotation.SHORTEST)
            assert start[1 + axis] == pytest.approx(1.0)


def test_the_flexible_body_takes_the_short_way_with_the_same_bits() -> None:
    parameters = {k: v for k, v in load("flexible").nodes["/plant"]["dynamics"].items() if k not in ("class",)}
    parameters.pop("attitude_mrp")
    states = [
        Flexible(Flexible.Parameters(**parameters, attitude_euler_deg=angles), 100).initial_state()
        for angles in ((350.0, 5.0, -361.0), (-10.0, 5.0, -1.0))
    ]
    assert states[0].tobytes() == states[1].tobytes()
    assert np.linalg.norm(states[0][:3]) < 1.0


def test_signs_of_a_manoeuvre_and_of_a_pair_do_not_matter() -> None:
    dynamics = {k: v for k, v in load("shi2022").nodes["/plant"]["dynamics"].items() if k != "class"}
    pair = {k: v for k, v in load("qi2022").nodes["/sim/plant"]["dynamics"].items() if k != "class"}
    for kind, parameters, keys in (
        (Manoeuvre, dynamics, ("attitude_q", "desired_attitude_q")),
        (PmSm, pair, ("attitude_pm_q", "attitude_sm_q")),
    ):
        plain = kind(kind.Parameters(**parameters), 100)
        for key in keys:
            other = {**parameters, key: tuple(-value for value in parameters[key])}
            turned = kind(kind.Parameters(**other), 100)
            assert turned.initial_state().tobytes() == plain.initial_state().tobytes()
            assert "the same attitude" in turned.notes[0]
            kept = kind(kind.Parameters(**{**other, "rotation": Rotation.AS_GIVEN}), 100)
            assert not np.array_equal(kept.initial_state(), plain.initial_state())
            assert "long way round, as asked for" in kept.notes[0]
        assert plain.notes == ()


def test_the_long_way_is_kept_where_it_is_asked_for_and_said() -> None:
    set_ = ["duration_s=200", "plant.dynamics.attitude_euler_deg={}"]
    results = {}
    for angles, more in (("[350,0,0]", []), ("[-10,0,0]", []), ("[350,0,0]", ["plant.dynamics.rotation=as_given"])):
        scenario = load("wu2018", None, [set_[0], set_[1].format(angles), *more])
        performance = simulate(scenario).summary.performance["/plant"]
        results[angles, bool(more)] = (performance.energy_n2m2s, scenario.notes)
    short, same, long = results.values()
    assert short[0] == same[0] < 0.2 < 2.0 < long[0]
    assert same[1] == ()
    assert "/plant: attitude_euler_deg is a rotation of 350 deg, started from as one of 10 deg" in short[1][0]
    assert "the long way round, as asked for" in long[1][0]
