"""Tick 0 rehearsed before its time: all of it is done, on objects of its own, and the run is the same to the bit."""

from __future__ import annotations

import os
import time
from collections.abc import Collection
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from wall_network import WallNetwork

from etac_ros.engines.ros.plan import Plan, RealTime
from etac_ros.engines.ros.wall_rehearsals import Rehearsals
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.recording import Recording
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray
from etac_ros.runs import windows_of
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.wall_rehearsal import Rehearsal

START = 10**9
US = 1000
RUNS = {"wu2018": 20.0, "qi2022": 2.0, "flexible": 10.0, "shi2022": 1.0, "xie2021": 0.05}


def clock_of(scenario: Scenario) -> WallClock:
    return WallClock(START, scenario.run.ticks_per_second, Fraction(1))


def run(scenario: Scenario, graph: Graph) -> Recording:
    clock = clock_of(scenario)
    return WallNetwork(graph, clock, lambda topic, to, now: US, windows=windows_of(scenario)).run()


def rehearse(scenario: Scenario, graph: Graph, names: Collection[str]) -> tuple[int, dict[str, list[FloatArray]]]:
    sent: dict[str, list[FloatArray]] = {}

    def transmit(link: Link, value: FloatArray, tick: int) -> FloatArray:
        assert tick == 0
        sent.setdefault(link.name, []).append(value)
        return value

    return Rehearsal(graph, names, clock_of(scenario), windows_of(scenario), transmit).run(), sent


@pytest.mark.parametrize("name", RUNS)
def test_all_that_happens_at_tick_0_is_rehearsed_and_leaves_no_trace(name: str) -> None:
    scenario = load(name, None, [f"duration_s={RUNS[name]}"])
    graph = scenario.build()
    untouched = run(scenario, scenario.build())
    acts, sent = rehearse(scenario, scenario.build(), graph.modules)
    rehearse(scenario, scenario.build(), graph.modules)
    found = run(scenario, graph)
    assert found.digest() == untouched.digest()
    at_0 = {link: [one.value for one in messages if one.tick == 0] for link, messages in found.messages.items()}
    assert acts == sum(entry.tick == 0 for entries in found.ledgers.values() for entry in entries if entry.event == 3)
    for link, values in at_0.items():
        assert len(sent.get(link, [])) == len(values), link
        assert all(np.array_equal(one, other) for one, other in zip(sent.get(link, []), values, strict=True)), link


def test_a_process_rehearses_what_it_plays_and_hears_nobody_else() -> None:
    scenario = load("xie2021")
    names = [name for name in scenario.graph.modules if name.startswith("/sc2/")]
    acts, sent = rehearse(scenario, scenario.build(), names)
    assert acts == 1
    assert sent.keys() == {"sc2_state", "sc2_feedback", "sc2_torque_command", "sc2_torque"}
    acts, sent = rehearse(
        scenario, scenario.build(), ["/sc2/sensor"]
    )  # a process a node: the plant's samples all the same
    assert acts == 1
    assert sent.keys() == {"sc2_state", "sc2_feedback"}


def rehearsals(scenario: Scenario, built: list[Graph], fails: bool = False) -> Rehearsals:
    def anew() -> Graph:
        built.append(scenario.build())
        if fails and len(built) > 1:
            raise ArithmeticError("as its own act would")
        return built[-1]

    plan = Plan(scenario.name, scenario.digest, scenario.build(), windows_of(scenario))
    plan = replace(plan, wall=RealTime(Fraction(1), priority=1), anew=anew)
    return Rehearsals(plan, ["/sensor"])


def near(seconds: float) -> WallClock:
    return WallClock(time.monotonic_ns() + int(seconds * 10**9), 32, Fraction(1))


def test_it_is_rehearsed_some_times_with_new_modules_each_time() -> None:
    built: list[Graph] = []
    some = rehearsals(load("wu2018"), built)
    some.rehearse_alone()
    rounds = 0
    while some.rehearse_early(near(100.0)):
        rounds += 1
    assert rounds == 12
    assert len({id(graph) for graph in built}) == len(built) == 1 + 12 + 2
    assert some.ready_ns > 0
    everywhere = os.sched_getaffinity(0)
    some.stand_ready(near(100.0).start_ns)
    assert some.ready_ns == 0
    assert os.sched_getaffinity(0) == {min(everywhere)}
    some.over()
    assert os.sched_getaffinity(0) == everywhere
    some.stand_ready(near(100.0).start_ns)  # of a later act
    assert os.sched_getaffinity(0) == everywhere


def test_nothing_is_rehearsed_where_there_is_no_time_left() -> None:
    built: list[Graph] = []
    some = rehearsals(load("wu2018"), built)
    some.rehearse_early(near(0.01))
    assert not some.rehearse_early(near(100.0))
    assert (built, some.ready_ns) == ([], 0)


def test_a_module_that_fails_is_left_to_its_own_act() -> None:
    built: list[Graph] = []
    some = rehearsals(load("wu2018"), built, fails=True)
    some.rehearse_alone()
    some.rehearse_early(near(100.0))
    assert not some.rehearse_early(near(100.0))
    assert (len(built), some.ready_ns) == (2, 0)
