"""What a plant holds where several links lead to one input: each link's newest value, summed in link order."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import SmallScenario
from hypothesis import given
from hypothesis import strategies as st

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.held import HeldInputs
from etac_ros.graph.module import Arrival
from etac_ros.parameters import FloatArray
from etac_ros.scenario.load import load

LINKS = ("first", "second", "third")
numbers = st.floats(-1e6, 1e6)


def arrival(link: str, value: float, port: str = "torque") -> Arrival:
    return Arrival(port, link, np.array([value]))


@given(st.lists(st.tuples(st.sampled_from(LINKS), numbers), max_size=20))
def test_the_input_is_the_sum_of_the_newest_of_each_link(arrivals: list[tuple[str, float]]) -> None:
    held = HeldInputs({"torque": 1}, LINKS)
    newest: dict[str, float] = {}
    for link, value in arrivals:
        newest[link] = value
        values = [newest[name] for name in LINKS if name in newest]
        total = values[0]
        for other in values[1:]:
            total += other
        assert held.take((arrival(link, value),))[0] == total


@given(numbers, numbers, numbers)
def test_the_order_of_arrival_changes_no_bit(a: float, b: float, c: float) -> None:
    values = dict(zip(LINKS, (a, b, c), strict=True))
    totals = set()
    for order in (LINKS, LINKS[::-1], ("second", "third", "first")):
        held = HeldInputs({"torque": 1}, LINKS)
        for link in order:
            held.take((arrival(link, values[link]),))
        totals.add(held.total().tobytes())
    assert len(totals) == 1


def test_one_link_passes_to_the_bit_and_ports_are_apart() -> None:
    held = HeldInputs({"torque": 1, "heat": 1})
    np.testing.assert_array_equal(held.total(), [0.0, 0.0])
    total = held.take((arrival("a", -0.0), arrival("b", 2.0, "heat")))
    assert np.signbit(total[0])
    assert total[1] == 2.0
    assert held.take((arrival("b", 3.0, "heat"), arrival("b", 4.0, "heat"))).tolist() == [-0.0, 4.0]


def test_a_torque_is_not_forgotten_when_another_link_delivers(small: SmallScenario) -> None:
    second = """\
/slow/sensor:
  ros__parameters:
    module: sensor
    reads: /plant
    signal: {class: "etac_ros.laws.wu2018:FilteredError", beta: 0.5}
    trigger: {class: "etac_ros.triggers.periodic:Periodic", period_s: 1.7}
/slow/controller:
  ros__parameters:
    module: controller
    law: {class: "etac_ros.laws.wu2018:Proportional", k: 0.5}
/slow/actuator:
  ros__parameters:
    module: actuator
"""
    path = small((
        "    variants:\n",
        "      slow_signal: {from: /slow/sensor, to: [/slow/controller], kind: internal}\n"
        "      slow_command: {from: /slow/controller, to: [/slow/actuator], kind: internal}\n"
        "      slow_torque: {from: /slow/actuator, to: [/plant], kind: physical}\n"
        "    variants:\n",
    ))  # fmt: skip
    path.write_text(path.read_text() + second)
    graph = load(str(path)).build()
    recording = InProcess(graph).run()
    plant = load(str(path)).build().modules["/plant"].plant  # type: ignore[attr-defined]
    torques = {link: {m.tick: m.value for m in recording.messages[link]} for link in ("torque", "slow_torque")}
    assert set(torques["torque"]) - set(torques["slow_torque"])
    assert set(torques["slow_torque"]) - set(torques["torque"])
    # The truth, replayed by hand: both torques act until their own link brings another.
    held: dict[str, FloatArray] = {}
    state = plant.initial_state()
    states = [state]
    for tick in range(graph.end_tick):
        for link, values in torques.items():
            if tick in values:
                held[link] = values[tick]
        state = plant.propagate(state, tick, 1, held["torque"] + held["slow_torque"])[0]
        states.append(state)
    assert recording.samples("/plant")[1] == pytest.approx(np.array(states), abs=0.0)
