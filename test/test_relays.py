"""What follows from messages to modules that only answer: one order says the same as all that it stands for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from toy import toy

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrivals, Outputs
from etac_ros.modules.actuator import Actuator
from etac_ros.parameters import FloatArray
from etac_ros.scenario.load import load
from etac_ros.timing.orders import Deliver, Forward, Order
from etac_ros.timing.relays import Relays
from etac_ros.timing.windows import WindowPolicy

CASES: dict[str, tuple[str, list[str], bool]] = {
    "a loop": ("wu2018", ["duration_s=30"], True),
    "a receiver that decides for itself": ("qi2022", ["duration_s=2"], False),
    "a formation, whose sensors take what they broadcast": ("xie2021", ["duration_s=1"], False),
    "a delay behind the first answer": ("wu2018", ["duration_s=30", "links.torque_command.delay_ticks=3"], False),
    "loss": ("wu2018", ["duration_s=30", "links.filtered_error.loss=0.5"], False),
    "a fault": ("wu2018", ["duration_s=30", "faults={nap: {do: stall, node: /sensor, at_s: 2.0, for_s: 3.0}}"], False),
}
"""Scenario, changes, and whether anything is known beforehand."""


def obeyed(graph: Graph, forwarding: bool) -> tuple[InProcess, list[Order]]:
    """A run, and all its orders."""
    engine = InProcess(graph, WindowPolicy(4, 64))
    engine.master.forwarding = forwarding
    told: list[Order] = []
    batches = engine.master.run()
    orders = next(batches)
    while True:
        told += orders
        try:
            orders = batches.send([engine.obey(order) for order in orders])
        except StopIteration:
            engine.log()
            return engine, told


def said(orders: list[Order]) -> list[Any]:
    """Orders with a module, step and links of what is taken in the place of those that say it all at once."""
    lines: list[Any] = []
    for order in orders:
        if isinstance(order, Forward):
            for module, step, takes, _ in order.relay.hops:
                lines.append((module, order.tick, step, tuple(order.relay.messages[place][0] for place in takes)))
        elif isinstance(order, Deliver):
            lines.append((order.module, order.tick, order.step, tuple(one.link for one in order.messages)))
        else:
            lines.append(order)
    return lines


@pytest.mark.parametrize("case", CASES)
def test_one_order_stands_for_all_that_follows(case: str) -> None:
    name, changes, known = CASES[case]
    assert forwarded(lambda: load(name, None, changes).build()) is known


def test_so_it_does_for_two_that_act_at_a_tick(tmp_path: Path) -> None:
    def build() -> Graph:
        graph = toy(tmp_path, {"a": {"at": [3, 5]}, "b": {"at": [1, 3]}}).build()
        deaf = {
            name: replace(link, receivers={to: port for to, port in link.receivers.items() if "sensor" not in to})
            for name, link in graph.links.items()
        }
        return replace(graph, links=deaf)

    assert forwarded(build)


def forwarded(build: Callable[[], Graph]) -> bool:
    """Whether anything is said with one order; it has to be the same run."""
    usual, orders = obeyed(build(), forwarding=False)
    engine, fewer = obeyed(build(), forwarding=True)
    assert said(fewer) == said(orders)
    assert engine.recording.digest() == usual.recording.digest()
    assert (engine.master.fired, engine.master.sent) == (usual.master.fired, usual.master.sent)
    return any(isinstance(order, Forward) for order in fewer)


def test_who_looks_on_sees_every_order() -> None:
    seen: list[Order] = []
    engine = InProcess(load("wu2018", None, ["duration_s=10"]).build())
    engine.trace = lambda order, report: seen.append(order)
    engine.run()
    assert any(isinstance(order, Deliver) for order in seen)
    assert not any(isinstance(order, Forward) for order in seen)


class Overheating(Actuator):
    """Ends the run at its third command, without an answer."""

    taken = 0

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        self.taken += 1
        if self.taken == 3:
            self.halt = "too hot"
            return {}
        return super().receive(tick, arrivals, sample)


@pytest.mark.parametrize("forwarding", [False, True])
def test_who_ends_the_run_need_not_answer(forwarding: bool) -> None:
    graph = load("wu2018", None, ["duration_s=60", "actuator.module=test_relays:Overheating"]).build()
    engine, _ = obeyed(graph, forwarding)
    assert engine.master.halted == "/actuator: too hot"
    assert engine.master.sent == {"filtered_error": 3, "torque_command": 3, "torque": 2}
    assert [len(engine.recording.messages[link]) for link in engine.master.sent] == [3, 3, 2]


def test_nothing_is_known_of_messages_that_go_round() -> None:
    graph = load("wu2018").build()
    back = replace(graph.links["torque"], receivers={"/controller": "signal"})
    assert Relays(replace(graph, links={**graph.links, "torque": back})).of(("filtered_error",)) is None
    assert Relays(graph).of(("filtered_error",)) is not None


def test_only_own_classes_are_shown_what_others_are_shown() -> None:
    assert load("wu2018").build().all_own
    assert not load("wu2018", None, ["actuator.module=test_relays:Overheating"]).build().all_own
