"""A law with memory inside speculative windows: what is looked at and dropped leaves no trace in it.

The reference is a plain loop, one sample at a time, that shares law, trigger rule and plant with the package and
nothing else: no window, no cell, no engine.
"""

from __future__ import annotations

import functools
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.graph.driver import Driver
from etac_ros.graph.module import Window
from etac_ros.graph.plant import PlantModule
from etac_ros.modules.sensing_controller import SensingController
from etac_ros.parameters import FloatArray
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import WindowPolicy

SHORT = "duration_s=12"
# A weak actuator under a bound that falls fast: s cannot follow it, and the law loses its value on the way.
LOSING = (SHORT, "controller.law.mu=0.2", "actuator.limit_nm=0.05", "controller.trigger.delta=3.0")
BUSY = (SHORT, "controller.trigger.delta=1.0")
CASES = {"busy": BUSY, "losing": LOSING, "stamped": (*BUSY, "wire=stamped")}


@functools.cache
def scenario(*overrides: str) -> Scenario:
    return load("shi2022", overrides=overrides)


def controller(case: str) -> SensingController:
    module = scenario(*CASES[case]).build().modules["/controller"]
    assert isinstance(module, SensingController)
    return module


Fired = list[tuple[int, bytes]]


@functools.cache
def by_hand(case: str) -> tuple[Fired, bytes, FloatArray]:
    """Firings, final state and all samples of a loop over single samples; it ends where the law has no value."""
    chosen = scenario(*CASES[case])
    graph = chosen.build()
    module, simulator = graph.modules["/controller"], graph.modules["/plant"]
    assert isinstance(module, SensingController)
    assert isinstance(simulator, PlantModule)
    law, rule, plant = module.law, module.trigger, simulator.plant
    limit = chosen.nodes["/actuator"]["limit_nm"]
    exact = chosen.run.wire.value == "stamped"
    state = plant.initial_state()
    memory = law.initial_memory(state)
    held, torque = None, np.zeros(3)
    fired: Fired = []
    samples = [state]
    for tick in range(chosen.end_tick):
        row = state[np.newaxis, :]
        if (np.abs(law.watches(row, tick, memory)[0].values) >= 1.0).any():
            break
        tau, memories = law.fold(row, tick, memory)
        memory = memories[0]
        if held is None or rule.first(tau, tick, held) == 0:
            held = tau[0].copy() if exact else tau[0].astype(np.float32).astype(np.float64)
            torque = np.clip(held, -limit, limit)
            fired.append((tick, held.tobytes()))
        state = plant.propagate(state, tick, 1, torque)[0]
        samples.append(state)
    return fired, state.tobytes(), np.array(samples)


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("length", [1, 7, 64, 512])
def test_windows_give_what_single_samples_give(case: str, length: int) -> None:
    engine = InProcess(scenario(*CASES[case]).build(), WindowPolicy(length, length))
    recording = engine.run()
    fired, state, samples = by_hand(case)
    sent = [(message.tick, message.value.tobytes()) for message in recording.messages["torque_command"]]
    assert sent == fired
    _, truth = recording.samples("/plant")
    assert truth[-1].tobytes() == state
    assert truth.tobytes() == samples.tobytes()
    assert bool(engine.master.halted) == (case == "losing")


def test_cases_are_worth_testing() -> None:
    for case in CASES:
        fired, _, samples = by_hand(case)
        assert fired[0][0] == 0
        assert 20 < len(fired) < 0.9 * len(samples)
    assert len(by_hand("losing")[2]) < 1000  # it ends early


def test_memory_matters() -> None:
    """With weights that are forgotten the torque would be another: the tests above can tell."""
    module = controller("busy")
    _, _, samples = by_hand("busy")
    memory = module.law.initial_memory(samples[0])
    _, memories = module.law.fold(samples[:100], 0, memory)
    rest = samples[100:110]
    right, _ = module.law.fold(rest, 100, memories[-1])
    wrong, _ = module.law.fold(rest, 100, memory)
    assert np.abs(right - wrong).max() > 1e-3


def shown(case: str, start: int, end: int, dropped: int) -> Window:
    """Samples from ``start`` up to before ``end``, and some more that will not come true."""
    samples = by_hand(case)[2][start:end]
    nonsense = np.repeat(samples[-1:], dropped, axis=0)
    nonsense[:, 4:7] += 0.002 * np.arange(1, dropped + 1)[:, np.newaxis]
    return Window("/plant", 1, start, np.concatenate([samples, nonsense]))


def fire(cell: Driver, tick: int) -> tuple[int, bytes]:
    ((link, value),) = cell.fire(tick)
    assert link.name == "torque_command"
    return tick, value.tobytes()


@settings(max_examples=40)
@given(st.integers(0, 2**32).map(Random))
def test_looking_and_dropping_leave_no_trace(dice: Random) -> None:
    """Windows of any length with nonsense behind, repeated looks, looks at other windows, ends at a firing or later."""
    ticks = 400
    graph = scenario(*CASES["busy"]).build()
    cell = Driver(graph, "/controller")
    other = shown("busy", 0, 50, 20)
    longest = dice.choice([1, 5, 200])
    fired: Fired = []
    start = 0
    while start < ticks:
        end = min(start + dice.randint(1, longest), ticks)
        cell.see(shown("busy", start, end, dropped=dice.randint(0, 30)))
        tick = start - 1
        while True:
            for _ in range(dice.randint(0, 2)):
                cell.look(dice.randint(tick, end + 2))
            if dice.random() < 0.3:
                cell.module.scan(other, tick)
            due = cell.look(tick)
            assert cell.look(tick) == due
            if due is None or due >= end:
                break
            fired.append(fire(cell, due))
            tick = due
            if dice.random() < 0.5:  # the plant hears of it
                end = due + 1
        start = end
    assert fired == [entry for entry in by_hand("busy")[0] if entry[0] < ticks]


def test_an_order_to_fire_at_another_tick_has_the_torque_of_that_tick() -> None:
    """A firing need not follow a look at the same window: the memory is folded up to it."""
    module = controller("busy")
    window = shown("busy", 0, 100, 0)
    module.advance(41, window)
    value = module.fire(41, window.at(41))["command"]
    expected = module.law.fold(window.samples, 0, module.law.initial_memory(window.samples[0]))[0][41]
    assert value.tolist() == expected.astype(np.float32).astype(np.float64).tolist()
    module.advance(20, window)  # the past does not come again
    assert module.scan(window, 41) != 42
    assert module.fire(41, window.at(41))["command"].tolist() == value.tolist()


def test_held_is_what_was_sent() -> None:
    module = controller("busy")
    window = shown("busy", 0, 10, 0)
    assert module.hold.sent is None
    assert module.scan(window, -1) == 0
    module.advance(0, window)
    sent = module.fire(0, window.at(0))["command"]
    assert module.hold.sent is sent
    assert module.hold.sent_tick == 0
    assert module.held_by(sent, 0) is sent
    assert sent.tolist() == sent.astype(np.float32).tolist()


def test_watched_is_the_torque_of_every_sample() -> None:
    samples = by_hand("busy")[2]
    window = Window("/plant", 1, 0, samples)
    module = controller("busy")
    expected, _ = module.law.fold(samples, 0, module.law.initial_memory(samples[0]))
    assert module.watched(window).tobytes() == expected.tobytes()
    (watch,) = module.watches(window)
    assert watch.values.shape == (len(samples), 3)
    assert np.abs(watch.values).max() < 1.0
    module.advance(5, window)
    with pytest.raises(ValueError, match="tick 5; it does not go back"):
        module.watched(Window("/plant", 1, 0, samples))


def test_a_gap_is_an_error() -> None:
    module = controller("busy")
    with pytest.raises(ValueError, match="the law needs every sample: the last was that of tick -1"):
        module.scan(shown("busy", 3, 10, 0), 2)


def test_leaving_the_bound_ends_the_run_in_words() -> None:
    _, _, samples = by_hand("losing")
    tick = len(samples) - 1
    with pytest.raises(RunHalted) as caught:
        run_in_process(scenario(*LOSING))
    text = str(caught.value)
    assert "/controller: performance variable chi about " in text
    assert f"at {tick / 100:.6g} s (tick {tick}), outside +-1; state [" in text
    values = controller("losing").law.watches(samples[-1:], tick, controller("losing").law.initial_memory(samples[0]))
    row = values[0].values[0]
    axis = int(np.argmax(np.abs(row)))
    assert f"about {'xyz'[axis]} is {row[axis]:.6g} at" in text


def test_at_the_tick_that_ends_the_run_nothing_is_sent() -> None:
    fired, _, samples = by_hand("losing")
    module = controller("losing")
    last = len(samples) - 1
    window = Window("/plant", 1, 0, samples)
    due = module.scan(window, -1)
    while due != last:
        assert due is not None
        module.advance(due, window)
        assert module.fire(due, window.at(due))
        assert not module.halt
        due = module.scan(window, due)
    module.advance(last, window)
    assert not module.halt
    assert module.fire(last, window.at(last)) == {}
    assert module.halt
    assert module.hold.sent is not None
    assert module.hold.sent.tobytes() == fired[-1][1]


def test_saturated_bounds_end_nothing() -> None:
    run = run_in_process(scenario(*LOSING, "controller.law.start_outside=saturate"))
    assert not run.summary.halted
    module = controller("losing")
    _, states = run.recording.samples("/plant")
    (watch,) = module.law.watches(states, 0, module.law.initial_memory(states[0]))
    assert np.abs(watch.values).max() > 1.0


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ("controller.reads=null", "needs a plant"),
        ("controller.law={class: 'etac_ros.laws.wu2018:Proportional', k: 1.0}", "Proportional has no"),
        ("controller.law.margin_rad_s=0.00001", "cannot fall|outside the performance bound"),
    ],
)
def test_a_controller_that_cannot_work_is_refused(change: str, reason: str) -> None:
    with pytest.raises(ScenarioError, match=reason):
        load("shi2022", overrides=[change])


def test_the_periodic_rule_has_the_same_law() -> None:
    event, clock = load("shi2022").nodes["/controller"], load("shi2022", "periodic").nodes["/controller"]
    without: dict[str, Any] = {"trigger": None}
    assert {**event, **without} == {**clock, **without}
