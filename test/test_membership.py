"""Processes that faults kill in real time, and those that take their places: who may come, and what counts."""

from __future__ import annotations

import random
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from wall_network import WallNetwork

from etac_ros.bag.read import read_bag
from etac_ros.engines.ros.launcher import deeds_of
from etac_ros.engines.ros.plan import RECORDER, Plan
from etac_ros.engines.ros.wall_check import mismatch
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.ledger import Event
from etac_ros.graph.module import Window
from etac_ros.graph.replay import deliveries, down_in_real_time, trigger_ticks
from etac_ros.maths.wall_clock import WallClock
from etac_ros.metrics.cells import fault_notes
from etac_ros.metrics.fault_account import fault_accounts
from etac_ros.report.source import read_run
from etac_ros.runs import RosOptions, run_over_ros, windows_of
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.membership import NUMBERS, Membership, Succession, birth_ns, births_ns, surely_there
from etac_ros.timing.wall import WallModule
from etac_ros.timing.worker import Send

MS = 10**6
CLOCK = WallClock(1_000 * MS, 100, Fraction(1))
BOOT = Fault("boot", "/a", FaultKind.RESTART, 100, 120)
AGAIN = Fault("again", "/a", FaultKind.RESTART, 300, 301)
DIES = Fault("dies", "/a", FaultKind.KILL, 500, 1000)
HANGS = Fault("hangs", "/b", FaultKind.STALL, 100, 150)
ALL = (BOOT, HANGS, AGAIN, DIES)


def test_each_fault_lets_one_process_in_and_no_other() -> None:
    run = Membership(ALL)
    assert "no fault of this scenario has made room" in run.refuses("/b", 1, 160)
    assert "is dead until tick 120" in run.refuses("/a", 1, 119)
    assert run.refuses("/a", 1, 125) == ""
    assert run.refuses("/a", 1, 126) == "is there twice"
    assert "is dead until tick 301" in run.refuses("/a", 2, 299)
    assert run.refuses("/a", 2, 310) == ""
    assert run.refuses("/a", 1, 311) == "is there twice"
    assert "made room" in run.refuses("/a", 3, 900)
    assert run.present == {"/a": 2}


@pytest.mark.parametrize(
    ("comes", "tick", "owes"),
    [
        ([], 99, True),
        ([], 100, False),
        ([], 299, False),
        ([(1, 125)], 299, True),
        ([(1, 125)], 300, False),
        ([(2, 310)], 499, True),  # the first one in its place never came
        ([(1, 125), (2, 310)], 499, True),
        ([(1, 125), (2, 310)], 500, False),
    ],
)
def test_the_run_waits_at_its_end_for_who_is_there(comes: list[tuple[int, int]], tick: int, owes: bool) -> None:
    run = Membership(ALL)
    for incarnation, when in comes:
        assert not run.refuses("/a", incarnation, when)
    assert run.owes("/a", tick) is owes
    assert run.owes("/b", tick)
    assert run.owes("/never", tick)


def test_a_process_is_started_when_its_predecessor_is_surely_dead() -> None:
    assert birth_ns(BOOT, CLOCK) == CLOCK.instant_ns(120)
    assert birth_ns(AGAIN, CLOCK) == CLOCK.instant_ns(300) + 50 * MS  # and not a tick later
    found = [(deed.due_ns, deed.fault.name, deed.signal) for deed in deeds_of(ALL, CLOCK)]
    assert found == [
        (CLOCK.instant_ns(100), "boot", 9),
        (CLOCK.instant_ns(100), "hangs", 19),
        (CLOCK.instant_ns(120), "boot", None),
        (CLOCK.instant_ns(150), "hangs", 18),
        (CLOCK.instant_ns(300), "again", 9),
        (CLOCK.instant_ns(300) + 50 * MS, "again", None),
        (CLOCK.instant_ns(500), "dies", 9),
    ]


def test_who_looks_for_others_waits_for_none_that_may_be_dead() -> None:
    born = Fault("x", "/x", FaultKind.RESTART, 50, 110)
    assert not surely_there((*ALL, born), "/a", born, CLOCK, 0)
    assert surely_there((*ALL, born), "/b", born, CLOCK, 10**12)  # it only stands still
    later = replace(born, from_tick=200, until_tick=250)
    assert surely_there((*ALL, later), "/a", later, CLOCK, 100 * MS)
    assert not surely_there((*ALL, later), "/a", later, CLOCK, 1000 * MS)
    last = replace(born, from_tick=800, until_tick=900)
    assert not surely_there((*ALL, last), "/a", last, CLOCK, 0)


def test_numbers_tell_one_process_from_the_next() -> None:
    births = births_ns(ALL, "/a", CLOCK)
    numbers = Succession(births)
    before, between, after = births[0] - 1, births[0], births[1]
    assert [numbers.number(*one) for one in ((1, before), (2, before), (1, between))] == [1, 2, NUMBERS + 1]
    assert numbers.number(3, between) is None  # a gap
    assert numbers.number(3, before) is None  # of one that is dead
    assert numbers.number(1, after) == 2 * NUMBERS + 1
    assert numbers.noted() == [[0, 1, 2], [1, 1, 1], [2, 1, 1]]
    late = Succession(births, may_miss=True)
    assert late.number(7, between) == NUMBERS + 7
    assert late.number(9, between) is None
    assert Succession(births).number(2, between) is None  # who was there has to have the first


def test_any_gap_and_any_doubling_is_found() -> None:
    births = births_ns(ALL, "/a", CLOCK)
    sent = [(number, births[0] - 10 + number) for number in (1, 2, 3)]
    sent += [(number, births[0] + number) for number in (1, 2)]
    for dropped in range(len(sent) - 1):
        if dropped == 2:
            continue  # the last one of a dead process: nobody can know
        numbers = Succession(births)
        kept = [one for place, one in enumerate(sent) if place != dropped]
        assert None in [numbers.number(*one) for one in kept]
    for twice in range(len(sent)):
        numbers = Succession(births)
        assert None in [numbers.number(*one) for one in (*sent[: twice + 1], sent[twice], *sent[twice + 1 :])]


def fault(at_s: float, node: str, do: str, for_s: float | None = None, name: str = "x") -> str:
    lasts = "" if for_s is None else f", for_s: {for_s}"
    return f"faults.{name}={{at_s: {at_s}, node: {node}, do: {do}{lasts}}}"


def network(scenario: Scenario, up_ns: int, seed: int = 0) -> WallNetwork:
    """A run whose processes die and come, on a made-up clock; what each message takes is drawn."""
    draw = random.Random(seed)
    graph = scenario.build()
    clock = WallClock(1_000 * MS, scenario.run.ticks_per_second, Fraction(1))

    def played() -> Any:
        return replace(scenario.build(), faults=(), spares={}).in_real_time()

    tick_ns = 10**9 // scenario.run.ticks_per_second
    run = WallNetwork(
        played(), clock, lambda topic, to, now: draw.randrange(1, tick_ns), windows=windows_of(scenario),
        faults=graph.faults, anew=played, up_ns=up_ns,
    )  # fmt: skip
    run.run()
    run.graph = graph.in_real_time()
    return run


EVERYBODY = [
    ("wu2018", 40, ("/sensor", "/controller", "/actuator")),
    ("qi2022", 4, ("/pm/attitude_sensor", "/pm/relative_sensor", "/pm/controller", "/sm/controller", "/sm/cmg")),
    ("flexible", 4, ("/sensor", "/actuator")),
    ("shi2022", 4, ("/actuator",)),
    ("xie2021", 0.2, ("/sc1/sensor", "/sc2/controller")),
]


@pytest.mark.parametrize(("name", "duration", "node"), [(n, t, node) for n, t, nodes in EVERYBODY for node in nodes])
def test_any_node_dies_and_comes_back_whatever_comes_first(name: str, duration: float, node: str) -> None:
    overrides = [f"duration_s={duration}", fault(duration / 4, node, "restart", duration / 20)]
    scenario = load(name, None, overrides)
    one = scenario.graph.faults[0]
    for seed, up_ns in enumerate((0, int(duration / 10 * 1e9), int(duration * 1e9))):
        run = network(scenario, up_ns, seed)
        joined = [entry for entry in run.ledgers[node] if entry.event is Event.JOINED]
        (death,) = down_in_real_time(run.graph, run.recording, node)
        down = death.down
        comes = up_ns < duration * 0.5 * 1e9
        assert death.joined == (joined[0].tick if comes else None)
        assert [entry.tick < run.graph.end_tick for entry in joined] == [comes]
        assert down.start == one.from_tick
        assert (down.stop == run.graph.end_tick) is not comes
        for link in run.graph.sends[node]:
            ticks = [message.tick for message in run.recording.messages[link.name]]
            assert not [tick for tick in ticks if one.from_tick < tick < down.stop - 1]
            after = [tick for tick in ticks if tick >= down.stop]
            if not comes:
                assert not after
            elif node.endswith("sensor"):
                assert after  # at once, since it does not know what it had sent
        for link in run.graph.hears[node]:
            arrived = [delivery.tick for delivery in deliveries(run.graph, run.recording, link, node)]
            assert not [tick for tick in arrived if one.from_tick < tick < down.stop - 1]
        for plant in run.graph.plants:
            first, states = run.recording.samples(plant)
            assert first == 0
            assert len(states) == run.graph.end_tick + 1 or run.halts  # modules that nobody steers touch
            assert np.isfinite(states).all()


def test_who_has_come_back_sends_its_first_sample_and_misses_nothing_twice() -> None:
    scenario = load("wu2018", None, ["duration_s=60", fault(20.0, "/sensor", "restart", 10.0)])
    run = network(scenario, 500 * MS)
    ticks = trigger_ticks(run.graph, run.recording, "/sensor").tolist()
    joined = next(entry.tick for entry in run.ledgers["/sensor"] if entry.event is Event.JOINED)
    assert joined == (30 * 32) + 16
    assert min(tick for tick in ticks if tick >= 20 * 32) in (joined + 1, joined + 2)


def test_ticks_from_before_it_was_in_are_not_made_up_for() -> None:
    """Its first window may have come before the coordinator let it in."""
    often = ["duration_s=10", "sensor.trigger.period_s=0.03125"]
    graph = load("wu2018", "periodic", often).build()
    done: list[Any] = []
    sensor = WallModule(graph, "/sensor", done.append, 1)
    clock = WallClock(0, 32, Fraction(1))
    samples = np.tile(graph.modules["/plant"].state, (60, 1))  # type: ignore[attr-defined]
    sensor.on_window(Window("/plant", 7, 90, samples), clock.instant_ns(95))
    sensor.begin(clock, clock.instant_ns(100), since=94)
    assert done == []
    assert sensor.next_wake_ns() == clock.instant_ns(101)
    sensor.progress(clock.instant_ns(101))
    assert [(type(one), one.tick) for one in done] == [(Send, 101)]
    assert sensor.missed == 0
    events = [(entry.event, entry.tick, entry.sequence) for entry in sensor.take_ledger()]
    assert events == [(Event.JOINED, 100, 0), (Event.WOKEN, 101, 0), (Event.SENT, 101, NUMBERS + 1)]


def test_what_it_cost_is_counted_and_what_nobody_knows_is_said() -> None:
    often = ["duration_s=60", "sensor.trigger.period_s=0.25"]
    scenario = load(
        "wu2018",
        "periodic",
        [*often, fault(20.0, "/controller", "restart", 10.0)],
    )
    run = network(scenario, 500 * MS)
    account = fault_accounts(run.graph, run.recording)["x"]
    period = scenario.graph.modules["/sensor"].trigger.period  # type: ignore[attr-defined]
    assert account.joined_s == pytest.approx(30.5)
    assert account.missed == pytest.approx(10.5 * 32 / period, abs=1)
    # Half a second of its ledger is lost: what it took then, and what it answered.
    assert account.unknown == pytest.approx(2 * 0.5 * 32 / period, abs=1)
    assert (account.waited, account.do) == (0, FaultKind.RESTART)
    words = " ".join(fault_notes({"x": account}, True))
    assert "was in the run at 30.5 s" in words
    assert f"of {account.unknown} messages to and from /controller nobody knows" in words
    dead = load("wu2018", "periodic", [*often, fault(20.0, "/controller", "kill")])
    account = fault_accounts((run := network(dead, 0)).graph, run.recording)["x"]
    assert (account.joined_s, account.until_s) == (None, None)
    assert account.missed == pytest.approx(40 * 32 / period, abs=1)


def test_what_is_lost_is_counted_with_one_death_only() -> None:
    """The process that was to take the first one's place dies before it is in the run."""
    deaths = [fault(20.0, "/controller", "restart", 10.0), fault(30.25, "/controller", "restart", 9.75, "again")]
    scenario = load("wu2018", "periodic", ["duration_s=60", "sensor.trigger.period_s=0.25", *deaths])
    run = network(scenario, 500 * MS)
    first, again = fault_accounts(run.graph, run.recording).values()
    assert (first.joined_s, again.joined_s) == (None, pytest.approx(40.5))
    assert first.missed == pytest.approx(10.25 / 0.25, abs=1)
    assert again.missed == pytest.approx(10.25 / 0.25, abs=1)
    assert again.unknown == 0  # it was never there to take any


def notes(sensor: int, recorder: int, controller: int | None, incarnation: int = 0) -> dict[str, dict[str, Any]]:
    """Last words about one topic; ``controller`` is None where it is dead."""
    topic = "/filtered_error"

    def spans(last: int) -> Mapping[str, Any]:
        return {"spans": {topic: [[0, 1, last]]}, "sent": {}, "heard": {"filtered_error": last}, "incarnation": 0}

    found: dict[str, dict[str, Any]] = {
        "/sensor": {"sent": {topic: [sensor, 0]}, "spans": {}, "heard": {}, "incarnation": incarnation},
        RECORDER: {**spans(recorder), "received": {topic: [recorder, 0]}},
    }
    if controller is not None:
        found["/controller"] = {**spans(controller)}
    return found


def plan_of(*overrides: str) -> Plan:
    scenario = load("wu2018", None, list(overrides))
    return Plan("wu2018", scenario.digest, scenario.graph, windows_of(scenario), faults=scenario.graph.faults)


def test_living_processes_are_held_to_their_counts() -> None:
    topic = "/filtered_error"
    dead = plan_of(fault(20.0, "/controller", "kill"))
    assert mismatch(dead, notes(9, 9, None), {topic: 9}) is None
    assert mismatch(dead, notes(9, 8, None), {topic: 8}) is not None
    assert mismatch(dead, notes(9, 9, None), {topic: 8}) is not None
    back = plan_of(fault(20.0, "/controller", "restart", 10.0))
    assert mismatch(back, notes(9, 9, 9), {topic: 9}) is None
    assert mismatch(back, notes(9, 9, 8), {topic: 9}) is not None
    assert mismatch(back, notes(9, 9, 0), {topic: 9}) is None  # it came after the last one
    sender = plan_of(fault(20.0, "/sensor", "kill"))
    unknown = notes(0, 9, 8)
    del unknown["/sensor"]
    assert mismatch(sender, unknown, {topic: 9}) is None  # whether the last one reached everybody: nobody knows
    assert mismatch(sender, unknown, {topic: 8}) is not None


def test_over_dds_a_node_is_killed_and_another_takes_its_place(tmp_path: Path) -> None:
    faults = [fault(6.0, "/controller", "restart", 4.0), fault(36.0, "/sensor", "kill", None, "end")]
    scenario = load("wu2018", "periodic", ["duration_s=40", "sensor.trigger.period_s=0.5", *faults])
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions(rate=20.0))
    boot, end = run.summary.faults["x"], run.summary.faults["end"]
    assert boot.joined_s is None or boot.joined_s >= 10.0  # on a busy machine it may take longer than the run
    assert (end.joined_s, end.until_s) == (None, None)
    sent = [message.sequence for message in run.recording.messages["torque_command"]]
    assert sent == sorted(sent)
    joined = [entry.tick for entry in run.recording.ledgers["/controller"] if entry.event is Event.JOINED]
    asked = [m.tick for m in run.recording.messages["filtered_error"] if joined and m.tick > joined[0] + 1]
    assert (max(sent) > NUMBERS) == bool(asked)
    assert not [m for m in run.recording.messages["filtered_error"] if m.tick > 36.5 * 32]
    assert len(run.recording.samples("/plant")[1]) == 40 * 32 + 1
    assert read_run(tmp_path / "bag").summary.faults == run.summary.faults
    assert read_bag(tmp_path / "bag").metadata["clock"] == "wall"
