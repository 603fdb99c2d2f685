"""The sensor module: what it sends, and when, depends on committed samples alone, never on windows.

It is driven as the time master drives it: windows follow each other, every one may show samples that are never
committed (here they are nonsense), and a firing may or may not end a window.
"""

from __future__ import annotations

import functools
from random import Random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etac_ros.errors import ScenarioError
from etac_ros.graph.driver import Driver
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Window
from etac_ros.graph.plant import PlantModule
from etac_ros.parameters import FloatArray
from etac_ros.scenario.load import Scenario, load

TICKS = 180
FILTER = "sensor.low_pass_s=0.25"
NOISE = "sensor.noise={{enters: {}, attitude_deg: 0.05, rate_deg_s: 0.01}}"
CASES: dict[str, tuple[str, ...]] = {
    "ideal": (),
    "stamped": ("wire=stamped",),
    "filter": (FILTER,),
    "noise": (NOISE.format("both"),),
    "noise in the trigger": (NOISE.format("trigger"),),
    "noise in what is sent": (NOISE.format("transmitted"),),
    "noise and filter": (NOISE.format("both"), FILTER),
    "noise in what is sent, and filter": (NOISE.format("transmitted"), FILTER),
    "periodic": ("sensor.trigger={class: 'etac_ros.triggers.periodic:Periodic', period_s: 0.34375}",),
}
Fired = list[tuple[int, bytes]]


@functools.cache
def scenario(case: str, seed: int) -> Scenario:
    rule = () if case == "periodic" else ("sensor.trigger.alpha=0.05", "sensor.trigger.gamma=5.0e-5")
    return load("wu2018", overrides=[*rule, *CASES[case], f"seed={seed}"])


def graph(case: str, seed: int = 1) -> Graph:
    return scenario(case, seed).build()


@functools.cache
def truth() -> FloatArray:
    """Committed samples at ticks 0 .. TICKS - 1: a slew under a torque that changes."""
    plant = graph("ideal").modules["/plant"]
    assert isinstance(plant, PlantModule)
    states = [plant.state[np.newaxis]]
    for torque in ([0.8, -0.4, 0.4], [-0.8, 0.8, -0.4], [0.4, -0.8, 0.8]):
        start = sum(len(part) for part in states) - 1
        states.append(plant.plant.propagate(states[-1][-1], start, TICKS // 3, np.array(torque)))
    return np.concatenate(states)[:TICKS]


def shown(start: int, end: int, dropped: int) -> Window:
    """A window of the samples from ``start`` up to before ``end``, and of some more that will not come true."""
    samples = truth()[start:end]
    nonsense = np.repeat(samples[-1:], dropped, axis=0)
    nonsense[:, 4:7] += 0.01 * np.arange(1, dropped + 1)[:, np.newaxis]
    return Window("/plant", 1, start, np.concatenate([samples, nonsense]))


def fire(cell: Driver, tick: int) -> tuple[int, bytes]:
    (link, value), *others = cell.fire(tick)
    assert (link.name, others) == ("filtered_error", [])
    return tick, value.tobytes()


@functools.cache
def one_window(case: str, seed: int = 1) -> tuple[tuple[int, bytes], ...]:
    cell = Driver(graph(case, seed), "/sensor")
    cell.see(shown(0, TICKS, 0))
    fired = []
    tick = -1
    while (due := cell.look(tick)) is not None:
        tick = due
        fired.append(fire(cell, tick))
    return tuple(fired)


def chance(dice: Random) -> bool:
    return dice.random() < 0.5


@pytest.mark.parametrize("case", CASES)
@settings(max_examples=25)
@given(dice=st.integers(0, 2**32).map(Random))
def test_windows_leave_no_trace(case: str, dice: Random) -> None:
    cell = Driver(graph(case), "/sensor")
    longest = dice.choice([1, 5, 90])
    fired: Fired = []
    start = 0
    while start < TICKS:
        end = min(start + dice.randint(1, longest), TICKS)
        cell.see(shown(start, end, dropped=dice.randint(0, 30)))
        tick = start - 1
        while (due := cell.look(tick)) is not None and due < end:
            fired.append(fire(cell, due))
            tick = due
            if chance(dice):  # the plant hears of it
                end = due + 1
        start = end
    assert tuple(fired) == one_window(case)


@pytest.mark.parametrize("case", CASES)
@settings(max_examples=25)
@given(dice=st.integers(0, 2**32).map(Random))
def test_looking_changes_nothing(case: str, dice: Random) -> None:
    cell = Driver(graph(case), "/sensor")
    dropped = shown(0, TICKS, 5)
    fired: Fired = []
    start, middle = 0, dice.randint(1, TICKS - 1)
    for end in (middle, TICKS):
        cell.see(shown(start, end, 3))
        tick = start - 1
        while True:
            for _ in range(dice.randint(0, 2)):
                cell.look(dice.randint(tick, end + 2))
            if chance(dice):
                cell.module.scan(dropped, tick)
            due = cell.look(tick)
            assert cell.look(tick) == due
            if due is None or due >= end:
                break
            if chance(dice):
                cell.module.scan(dropped, tick)
            fired.append(fire(cell, due))
            tick = due
        start = end
    assert tuple(fired) == one_window(case)


@pytest.mark.parametrize("case", CASES)
def test_cases_are_worth_testing(case: str) -> None:
    ticks = [tick for tick, _ in one_window(case)]
    assert ticks[0] == 0
    assert ticks == sorted(set(ticks))
    assert 5 <= len(ticks) < TICKS


def test_cases_differ() -> None:
    alike = [one_window(case) for case in CASES]
    assert len(set(alike)) == len(CASES)


def test_noise_belongs_to_seed_and_sensor() -> None:
    assert one_window("noise", 1) != one_window("noise", 2)
    assert one_window("filter", 1) == one_window("filter", 2)


def test_noise_enters_where_it_is_told_to() -> None:
    true = truth()[:, 4:7] + 0.08 * truth()[:, 1:4]

    def off(case: str) -> float:
        values = [np.frombuffer(value) - true[tick] for tick, value in one_window(case)]
        return float(np.abs(values).max())

    float32 = 1e-8
    assert off("ideal") < float32
    assert off("stamped") < 1e-16
    assert off("noise in the trigger") < float32
    assert off("noise in what is sent") > 1e-4
    assert off("noise") > 1e-4


def test_what_is_held_is_what_was_sent() -> None:
    # Rounded to the wire: the trigger rule compares with what the controller has.
    cell = Driver(graph("ideal"), "/sensor")
    cell.see(shown(0, TICKS, 0))
    assert cell.look(-1) == 0
    _, sent = fire(cell, 0)
    held = cell.module.hold.sent  # type: ignore[attr-defined]
    assert held.tobytes() == sent
    assert np.array_equal(held, held.astype(np.float32).astype(np.float64))


def test_filter_is_a_first_order_lag_that_starts_settled() -> None:
    sent = dict(one_window("filter"))
    true = truth()[:, 4:7] + 0.08 * truth()[:, 1:4]
    gain = 1.0 - np.exp(-1.0 / 32.0 / 0.25)
    lagged = true[0].copy()
    for tick in range(TICKS):
        lagged += gain * (true[tick] - lagged)
        if tick in sent:
            assert np.frombuffer(sent[tick]) == pytest.approx(lagged, abs=1e-8)


def test_noise_is_refused_where_the_plant_has_other_sensors() -> None:
    changes = [
        "plant.dynamics={class: 'toy:Ramp'}",
        "links.torque.to=[/plant]",
        "sensor.noise.enters=both",
    ]
    with pytest.raises(ScenarioError, match=r"/sensor: noise is described for 6 deviates .* draw 0"):
        load("wu2018", overrides=changes)
