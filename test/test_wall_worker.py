"""Modules in real time, on a made-up clock: punctual ones do what simulated time lays down, late ones are noted."""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from wall_network import WINDOW, Lateness, WallNetwork

from etac_ros.errors import ProtocolError, RunError
from etac_ros.graph.graph import LinkKind
from etac_ros.graph.ledger import Event
from etac_ros.graph.module import Window
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import held_inputs, trigger_ticks
from etac_ros.maths.wall_clock import WallClock
from etac_ros.metrics.latency import real_time_account
from etac_ros.runs import run_in_process, windows_of
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.wall import Effect, WallModule, WallPlant, windows_in_real_time
from etac_ros.timing.windows import USUAL_WINDOWS, WindowPolicy
from etac_ros.timing.worker import Offer

MS = 10**6
START = 1_000 * MS
PUNCTUAL = [
    ("wu2018", None, ["duration_s=300"]),
    ("wu2018", "periodic", ["duration_s=30"]),
    ("wu2018", "noise-gamma-4e-5", ["duration_s=60"]),
    ("qi2022", None, ["duration_s=5"]),
    ("qi2022", "measurement", ["duration_s=3"]),
    ("flexible", None, ["duration_s=60"]),
    ("shi2022", None, ["duration_s=10"]),
    ("shi2022", "events", ["duration_s=10"]),
]


def network(scenario: Scenario, latency_ns: int, lateness: Lateness = lambda name, due: 0) -> WallNetwork:
    clock = WallClock(START, scenario.run.ticks_per_second, Fraction(1))
    return WallNetwork(scenario.build(), clock, lambda topic, to, now: latency_ns, lateness, windows_of(scenario))


def delayed_by_a_tick(name: str, variant: str | None, overrides: Sequence[str]) -> Recording:
    """The same in simulated time, where torques act a tick later: in real time they come within a tick."""
    scenario = load(name, variant, overrides)
    physical = [link.name for link in scenario.graph.links.values() if link.kind is LinkKind.PHYSICAL]
    delays = [f"links.{link}.delay_ticks=1" for link in physical]
    return run_in_process(load(name, variant, [*overrides, *delays])).recording


def assert_alike(found: Recording, wanted: Recording) -> None:
    for link, messages in wanted.messages.items():
        assert [m.tick for m in found.messages[link]] == [m.tick for m in messages], link
        assert all(np.array_equal(a.value, b.value) for a, b in zip(found.messages[link], messages, strict=True))
    for plant in wanted.truth:
        first, states = found.samples(plant)
        assert first == 0
        assert np.array_equal(states, wanted.samples(plant)[1])


@pytest.mark.parametrize(("name", "variant", "overrides"), PUNCTUAL)
def test_who_is_punctual_runs_as_in_simulated_time_with_a_tick_of_delay(
    name: str, variant: str | None, overrides: list[str]
) -> None:
    scenario = load(name, variant, overrides)
    tick_ns = 10**9 // scenario.run.ticks_per_second
    run = network(scenario, tick_ns // 10)
    found = run.run()
    assert not run.overruns
    assert not run.halts
    assert_alike(found, delayed_by_a_tick(name, variant, overrides))


@pytest.mark.parametrize("seed", range(6))
def test_within_a_tick_no_order_of_arrival_matters(seed: int) -> None:
    overrides = ["duration_s=3"]
    scenario = load("qi2022", None, overrides)
    draw = random.Random(seed)
    clock = WallClock(START, scenario.run.ticks_per_second, Fraction(1))
    run = WallNetwork(
        scenario.build(), clock,
        lambda topic, to, now: draw.randrange(1, 7 * MS), lambda name, due: draw.randrange(5 * MS),
    )  # fmt: skip
    assert_alike(run.run(), delayed_by_a_tick("qi2022", None, overrides))
    assert not run.overruns


def test_what_is_late_acts_late() -> None:
    """Three hops of two ticks each: the torque is felt seven ticks after its sample."""
    scenario = load("wu2018", None, ["duration_s=60"])
    tick_ns = 10**9 // 32
    run = network(scenario, 2 * tick_ns)
    account = real_time_account(run.graph, run.run())
    assert account is not None
    ticks = account.loops["/emulation/torque"].ticks
    assert ticks.least == ticks.most == 7.0
    assert account.latency_ms["/filtered_error"].median == pytest.approx(2 * tick_ns / MS)
    assert account.loops["/emulation/torque"].ms.least == pytest.approx(6 * tick_ns / MS)


def test_a_torque_is_held_from_the_first_tick_after_it_has_come() -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    run = network(scenario, 3 * MS)
    recording = run.run()
    held = held_inputs(run.graph, recording, "/plant")["torque"]
    taken = recording.taken("/plant")
    assert sorted(taken.values())[0] == 1
    assert held.ticks.tolist() == [0, *sorted(set(taken.values()))]


def test_who_oversleeps_the_end_misses_no_tick_behind_it() -> None:
    scenario = load("wu2018", "periodic", ["duration_s=4"])
    tick_ns = 10**9 // 32

    def lateness(name: str, due: int) -> int:
        return 500 * tick_ns if name == "/sensor" and abs(due - START - 96 * tick_ns) < MS else 0

    run = network(scenario, MS, lateness)
    account = real_time_account(run.graph, run.run())
    assert account is not None
    assert account.nodes["/sensor"].missed_ticks == 32  # of 128, from tick 96 on


def test_who_oversleeps_acts_once_and_is_noted() -> None:
    scenario = load("wu2018", "periodic", ["duration_s=4", "sensor.trigger.period_s=0.03125"])
    tick_ns = 10**9 // 32
    oversleeps_at = START + 50 * tick_ns

    def lateness(name: str, due: int) -> int:
        return int(3.5 * tick_ns) if name == "/sensor" and abs(due - oversleeps_at) < MS else 0

    run = network(scenario, MS, lateness)
    recording = run.run()
    ticks = trigger_ticks(run.graph, recording, "/sensor").tolist()
    assert ticks == [*range(50), *range(53, 128)]  # that of tick 50 is sent in tick 53, in whose place it stands
    assert [(name, one.tick, one.now) for name, one in run.overruns] == [("/sensor", 50, 53)]
    account = real_time_account(run.graph, recording)
    assert account is not None
    assert account.nodes["/sensor"].missed_ticks == account.overruns == 3
    assert account.nodes["/sensor"].wakes is not None
    assert account.nodes["/sensor"].wakes.most == pytest.approx(3.5 * tick_ns / MS)


@pytest.mark.parametrize("name", ["wu2018", "shi2022", "flexible", "xie2021"])
def test_a_rule_of_any_kind_survives_a_long_sleep(name: str) -> None:
    duration = {"wu2018": 40, "shi2022": 6, "flexible": 20, "xie2021": 0.6}[name]
    scenario = load(name, None, [f"duration_s={duration}"])
    draw = random.Random(1)

    def lateness(node: str, due: int) -> int:
        return 40 * MS if draw.random() < 0.5 else 0

    run = network(scenario, MS, lateness)
    recording = run.run()
    account = real_time_account(run.graph, recording)
    assert account is not None
    assert account.overruns > 0
    for plant in run.graph.plants:
        first, states = recording.samples(plant)
        assert (first, len(states)) == (0, run.graph.end_tick + 1)
        assert np.isfinite(states).all()


def test_an_act_on_a_window_that_a_torque_had_changed_is_noted() -> None:
    scenario = load("wu2018", "periodic", ["duration_s=4", "sensor.trigger.period_s=0.03125"])
    clock = WallClock(START, 32, Fraction(1))
    run = WallNetwork(scenario.build(), clock, lambda topic, to, now: 100 * MS if topic.startswith(WINDOW) else MS)
    recording = run.run()
    account = real_time_account(run.graph, recording)
    assert account is not None
    assert account.nodes["/sensor"].stale_acts > 0
    assert account.overruns == account.nodes["/sensor"].overruns == len(run.overruns)
    assert "its window came late" in run.overruns[-1][1].found


def test_what_is_sent_twice_within_a_tick_opens_one_window() -> None:
    scenario = load("qi2022", None, ["duration_s=1"])
    graph = scenario.build()
    offered: list[Window] = []

    def emit(effect: Effect) -> None:
        if isinstance(effect, Offer):
            offered.append(effect.window)

    plant = WallPlant(graph, "/sim/plant", emit, USUAL_WINDOWS)
    plant.begin(WallClock(0, 20, Fraction(1)), -MS)
    links = graph.hears["/sim/plant"]
    for number, link in enumerate(links):
        plant.on_message(link, 1, np.full(3, 0.1 * (number + 1)), 0, 70 * MS)
    assert len(offered) == 1
    plant.progress(70 * MS)
    assert [window.start for window in offered] == [0, 3]
    wakes = plant.next_wake_ns()
    assert wakes is not None
    assert wakes > 70 * MS


def test_a_plant_that_time_has_overtaken_says_so_and_leaves_no_gap() -> None:
    scenario = load("wu2018", None, ["duration_s=10"])
    slept: list[int] = []

    def lateness(name: str, due: int) -> int:
        if name != "/plant" or due < START + 2_000 * MS or slept:
            return 0
        slept.append(due)
        return 1_500 * MS

    run = network(scenario, MS, lateness)
    recording = run.run()
    assert any(entry.event is Event.STARVED for entry in recording.ledgers["/plant"])
    assert "/plant" in {name for name, _ in run.overruns}
    assert len(recording.samples("/plant")[1]) == run.graph.end_tick + 1


def test_a_gap_between_windows_is_refused() -> None:
    graph = load("wu2018", None, ["duration_s=10"]).build()
    sensor = WallModule(graph, "/sensor", lambda effect: None)
    sensor.begin(WallClock(0, 32, Fraction(1)), -MS)
    samples = np.tile(graph.modules["/plant"].state, (3, 1))  # type: ignore[attr-defined]
    sensor.on_window(Window("/plant", 1, 0, samples), -MS)
    with pytest.raises(ProtocolError, match="begins with tick 5, and samples are known until tick 2"):
        sensor.on_window(Window("/plant", 2, 5, samples), 300 * MS)


def test_what_is_no_number_is_refused_with_its_sender() -> None:
    graph = load("wu2018", None, ["duration_s=10"]).build()
    actuator = WallModule(graph, "/actuator", lambda effect: None)
    actuator.begin(WallClock(0, 32, Fraction(1)), 0)
    with pytest.raises(
        RunError, match=r"node /controller, topic /torque_command: has sent \[nan, 0.0, 0.0\] in tick 3"
    ):
        actuator.on_message(graph.links["torque_command"], 1, np.array([np.nan, 0.0, 0.0]), 0, 100 * MS)


def test_a_watch_ends_the_run_once(monkeypatch: pytest.MonkeyPatch) -> None:
    graph = load("wu2018", None, ["duration_s=5"]).build()
    plant: Any = graph.modules["/plant"]
    monkeypatch.setattr(plant, "left_bounds", lambda start, rows: "enough" if start + len(rows) > 50 else "")
    run = WallNetwork(graph, WallClock(START, 32, Fraction(1)), lambda topic, to, now: MS)
    run.run()
    assert [(name, halt.why) for name, halt in run.halts] == [("/plant", "enough")]


def test_windows_reach_as_far_as_real_time_needs() -> None:
    slow, fast = WallClock(0, 20, Fraction(1)), WallClock(0, 1000, Fraction(10))
    assert windows_in_real_time(WindowPolicy(1, 1), slow) == (4, 4)
    assert windows_in_real_time(USUAL_WINDOWS, slow) == (4, 10)
    assert windows_in_real_time(USUAL_WINDOWS, fast) == (256, 256)
    windows = windows_in_real_time(USUAL_WINDOWS, replace(fast, rate=Fraction(1)))
    assert windows.after_hit(1) == windows.least == 100
    assert windows.after_quiet(100) == windows.most == 256
