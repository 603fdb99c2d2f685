"""The time master by its orders: what it lays down where acts, arrivals, halts and the end of a run meet in a tick."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from toy import Scripted, toy
from toy import trace as told

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph import replay
from etac_ros.graph.graph import Graph
from etac_ros.graph.role import Role
from etac_ros.scenario.load import load
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Close, Deliver, Fire, Look, Open, Order, Report
from etac_ros.timing.windows import USUAL_WINDOWS, WindowPolicy

Trace = list[tuple[Order, Report]]


def traced(graph: Graph, windows: WindowPolicy = USUAL_WINDOWS) -> tuple[InProcess, Trace]:
    trace: Trace = []
    engine = InProcess(graph, windows, lambda order, report: trace.append((order, report)))
    engine.run()
    return engine, trace


class Concluding(Scripted):
    """Acts at scripted ticks, and says a second word at each, when it has heard what arrives there."""

    role = Role(triggers="said", concludes=True)


def concluding(folder: Path, sensors: dict[str, Any], **links: Any) -> Graph:
    scenario = toy(folder, sensors, **links)
    scenario.path.write_text(scenario.path.read_text().replace("toy:Scripted", "test_master:Concluding"))
    return load(str(scenario.path)).build()


@pytest.mark.parametrize("length", [1, 2, 5, 64])
def test_a_conclusion_waits_for_what_arrives_late_at_its_tick(length: int, tmp_path: Path) -> None:
    """What b has sent at tick 1 comes at tick 6, when a acts, and is part of what a concludes from."""
    links = {"a_says": {"delay_ticks": 5}, "b_says": {"delay_ticks": 5}}
    graph = concluding(tmp_path, {"a": {"at": [3, 6], "echo": True}, "b": {"at": [1]}}, **links)
    engine, trace = traced(graph, WindowPolicy(length, length))
    assert told(engine.recording) == [
        "1:0 b_says#1=1",
        "3:0 a_says#1=3",
        "3:1 a_says#2=3",  # nothing arrives: it concludes alone
        "6:0 a_says#3=6",
        "6:1 a_says#4=1006",  # it has heard b
        "6:1 b_push#1=-0.5",
        "8:1 a_push#1=-0.5",
        "11:1 a_push#2=-0.5",
    ]
    assert alone_ticks(trace, "/a/sensor") == [3]
    assert alone_ticks(trace, "/b/sensor") == [1]
    heard = [order for order, _ in trace if isinstance(order, Deliver) and order.module == "/a/sensor"]
    assert [(order.tick, order.step, len(order.messages)) for order in heard] == [(6, 1, 1)]


@pytest.mark.parametrize("length", [1, 5, 64])
def test_two_that_act_at_a_tick_conclude_together(length: int, tmp_path: Path) -> None:
    graph = concluding(tmp_path, {"a": {"at": [3]}, "b": {"at": [3]}})
    engine, trace = traced(graph, WindowPolicy(length, length))
    assert alone_ticks(trace, "/a/sensor") == alone_ticks(trace, "/b/sensor") == []
    assert told(engine.recording)[:2] == ["3:0 a_says#1=3", "3:0 b_says#1=3"]


def alone_ticks(trace: Trace, name: str) -> list[int]:
    """Ticks at which a module has concluded at once."""
    return [
        order.tick if isinstance(order, Fire) else int(report.proposal or 0)
        for order, report in trace
        if order.module == name and report.concluded is not None
    ]


def halting(folder: Path, bounds: dict[str, float], sensors: dict[str, Any], **links: Any) -> Graph:
    scenario = toy(folder, sensors, **links)
    text = scenario.path.read_text()
    for name, bound in bounds.items():
        place = text.index(f"/{name}/ramp:")
        head, tail = text[:place], text[place:]
        text = head + tail.replace("slope: 1.0", f"slope: 1.0\n      bound: {bound}", 1)
    scenario.path.write_text(text)
    return load(str(scenario.path)).build()


def test_the_first_halt_stands(tmp_path: Path) -> None:
    graph = halting(tmp_path, {"a": 6.5, "b": 6.5}, {"a": {"at": [7]}, "b": {"at": [7]}})
    engine, _ = traced(graph)
    assert engine.master.halted.startswith("/a/ramp: ")
    assert engine.master.is_halted()
    assert engine.master.tick == 7


def test_the_second_halt_is_heard_where_there_is_no_first(tmp_path: Path) -> None:
    graph = halting(tmp_path, {"b": 6.5}, {"a": {"at": [7]}, "b": {"at": [7]}})
    engine, _ = traced(graph)
    assert engine.master.halted.startswith("/b/ramp: ")


def test_a_bound_that_is_left_at_the_very_end_is_noticed(tmp_path: Path) -> None:
    graph = halting(tmp_path, {"b": 19.5}, {})
    engine, trace = traced(graph)
    assert engine.master.halted.startswith("/b/ramp: ")
    assert [order for order, _ in trace if isinstance(order, Close)] == [Close("/a/ramp", 20), Close("/b/ramp", 20)]


def test_nobody_acts_after_a_halt(tmp_path: Path) -> None:
    graph = halting(tmp_path, {"a": 6.5}, {"a": {"at": [7, 9]}, "b": {"at": [7, 8]}})
    engine, trace = traced(graph)
    acts = [order.tick for order, _ in trace if isinstance(order, Fire | Deliver)]
    acts += [int(report.proposal or 0) for order, report in trace if isinstance(order, Look) and report.fired]
    assert max(acts) == 7
    assert engine.recording.samples("/a/ramp")[1].shape[0] == 8


def test_a_run_ends_at_its_end(tmp_path: Path) -> None:
    graph = toy(tmp_path, {"a": {"at": [19, 20]}, "b": {"at": [18]}}, b_says={"delay_ticks": 2}).build()
    engine, trace = traced(graph)
    assert engine.master.tick == 20
    assert not engine.master.halted
    for plant in graph.plants:
        assert engine.recording.samples(plant)[1].shape[0] == 21
        assert all(samples.shape[0] for _, samples in engine.recording.truth[plant])
    assert engine.master.sent["a_says"] == 1
    assert all(order.tick < 20 for order, _ in trace if isinstance(order, Fire | Deliver))
    assert all(order.grant < 20 for order, _ in trace if isinstance(order, Open | Look))


def test_instants_are_counted_once_whatever_is_sent(tmp_path: Path) -> None:
    graph = toy(tmp_path, {"a": {"at": [3, 3, 6], "echo": True}, "b": {"at": [4]}}, b_says={"delay_ticks": 2}).build()
    engine, _ = traced(graph)
    # At tick 6 it acts by itself, and answers in the step after: two messages, one instant.
    assert [message.tick for message in engine.recording.messages["a_says"]] == [3, 6, 6]
    assert engine.master.fired == {"/a/sensor": 2, "/b/sensor": 1}
    assert replay.trigger_ticks(graph, engine.recording, "/a/sensor").tolist() == [3, 6]


def test_what_arrives_in_a_step_comes_in_the_order_of_links_and_numbers(tmp_path: Path) -> None:
    graph = load("xie2021", "held", ["duration_s=0.1"]).build()
    _, trace = traced(graph)
    places = {name: place for place, name in enumerate(graph.links)}
    several = 0
    for order, _ in trace:
        if isinstance(order, Deliver):
            keys = [(places[message.link], message.sequence) for message in order.messages]
            assert keys == sorted(keys)
            several += len(keys) > 1
    assert several


def test_within_a_batch_modules_come_in_the_order_of_the_graph() -> None:
    graph = load("xie2021", None, ["duration_s=0.2"]).build()
    master = TimeMaster(graph, USUAL_WINDOWS)
    engine = InProcess(graph)
    places = {name: place for place, name in enumerate(graph.modules)}
    batches = engine.master.run()
    orders = next(batches)
    longest = 0
    while True:
        for kind in (Open, Look, Fire, Deliver, Close):
            names = [places[order.module] for order in orders if isinstance(order, kind)]
            assert names == sorted(set(names))
            longest = max(longest, len(names))
        try:
            orders = batches.send([engine.obey(order) for order in orders])
        except StopIteration:
            break
    assert longest >= 4
    assert master.tick == 0


def test_a_message_log_is_taken_once(tmp_path: Path) -> None:
    engine, _ = traced(toy(tmp_path, {"a": {"at": [3]}}).build())
    assert engine.master.take_message_log() == []  # the engine has taken it
    assert [message.tick for message in engine.recording.messages["a_says"]] == [3]


def opened(trace: Trace, plant: str) -> list[int]:
    return [order.length for order, _ in trace if isinstance(order, Open) and order.module == plant]


def test_windows_grow_while_nothing_happens_and_shrink_after(tmp_path: Path) -> None:
    graph = toy(tmp_path, {"a": {"at": [60]}}, duration_ticks=200).build()
    _, trace = traced(graph, WindowPolicy(2, 64))
    assert opened(trace, "/b/ramp") == [2, 8, 32, 64, 64, 31]
    # The hit comes at tick 60, 19 after the window was opened at 41: the next has twice that.
    assert opened(trace, "/a/ramp") == [2, 8, 32, 64, 38, 64, 38]


def test_windows_become_shorter_on_demand(tmp_path: Path) -> None:
    graph = toy(tmp_path, {}, duration_ticks=100).build()
    master = TimeMaster(graph, WindowPolicy(16, 64))
    engine = InProcess(graph)
    lengths = []
    batches = master.run()
    orders = next(batches)
    for _ in range(12):
        lengths += [order.length for order in orders if isinstance(order, Open) and order.module == "/a/ramp"]
        master.shorten_windows()
        orders = batches.send([engine.obey(order) for order in orders])
    assert lengths == [16, 8, 4, 2, 1, 1, 1, 1, 1, 1, 1, 1]


def test_windows_that_end_by_themselves_become_shorter_likewise() -> None:
    """A plant that takes long for a sample does so until its reader acts."""
    engine = InProcess(load("wu2018", None, ["duration_s=20"]).build(), WindowPolicy(8, 64), trimmed=64)
    lengths: list[int] = []
    batches = engine.master.run()
    orders = next(batches)
    while len(lengths) < 5:
        lengths += [order.length for order in orders if isinstance(order, Open)]
        if len(lengths) == 3:
            engine.master.shorten_windows()
        orders = batches.send([engine.obey(order) for order in orders])
    assert lengths[1] == 64
    assert lengths[-1] < 64


@pytest.mark.parametrize(("first", "longest"), [(0, 4), (5, 4), (1, 0), (-1, -1)])
def test_lengths_that_make_no_sense_are_refused(first: int, longest: int) -> None:
    with pytest.raises(ValueError, match=rf"1 <= first <= longest, found {first} and {longest}"):
        WindowPolicy(first, longest)


def test_lengths_of_windows() -> None:
    policy = WindowPolicy(1, 100)
    assert [policy.after_quiet(length) for length in (1, 5, 25, 26, 100)] == [4, 20, 100, 100, 100]
    assert [policy.after_hit(used) for used in (0, 1, 7, 50, 51)] == [1, 2, 14, 100, 100]
    assert WindowPolicy(1, 1).after_quiet(1) == WindowPolicy(1, 1).after_hit(1) == 1
    assert WindowPolicy() == WindowPolicy(64, 1024) == USUAL_WINDOWS
