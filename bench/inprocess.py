"""Where the time of a run without DDS goes: kernel, time master, all else; and what plain numpy costs.

    ./scripts/bench inprocess

All is measured in turns (a b c, a b c, ...), so a machine that changes its speed changes it for all alike. A run is
timed as its loop alone, once everything is compiled. What counts is processor time: these are loops of one thread that
wait for nothing, so it is what an idle machine would take by the clock, also where others work.
"""

from __future__ import annotations

import contextlib
import json
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.progress import track
from section import Section

from etac_ros.engines.closed_loop import closed_loop_of
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.rk4 import Stop
from etac_ros.runs import engine_by_calls, warm_up
from etac_ros.scenario.load import Scenario, load
from etac_ros.tables.table import Row, Table
from etac_ros.timing.orders import Report

sys.path.append(str(Path(__file__).resolve().parent / "others"))
import by_hand
from workload import START, TICKS_PER_SECOND

SYSTEMS = ("wu2018", "flexible", "shi2022", "xie2021", "qi2022")
DURATION_S = 1000.0
PLAIN_S = 100.0
_PARTS = {
    "law": ("controller", "law", "Law"),
    "rule": ("sensor", "trigger", "Rule"),
    "signal": ("sensor", "signal", "Signal"),
    "plant": ("plant", "dynamics", "Body"),
}
"""Node, key and class in plain numpy."""
PLAIN = {
    "nothing": (),
    "law": ("law",),
    "rule": ("rule",),
    "signal": ("signal",),
    "signal, rule and law": ("signal", "rule", "law"),
    "plant": ("plant",),
    "all four": ("signal", "rule", "law", "plant"),
}
"""Which parts of wu2018 are in plain numpy."""
BY_ORDERS = "nothing, by orders"


def main(
    rounds: Annotated[int, typer.Option(min=2, help="Rounds.")] = 15,
    write: Annotated[bool, typer.Option(help="Write its section of docs/performance.md.")] = False,
) -> None:
    """Measure and print."""
    section = Section("inprocess", "A run without DDS", "./scripts/bench inprocess")
    scenarios = {name: load(name) for name in SYSTEMS}
    plain = {name: in_plain_numpy(parts) for name, parts in PLAIN.items()}
    masters = {name: Replayed.of(scenario) for name, scenario in scenarios.items()}
    one_loop = [name for name, scenario in scenarios.items() if closed_loop_of(scenario.build()) is not None]
    kernel, stopping = kernels()
    ways: dict[str, Callable[[], float]] = {
        "by hand": lambda: timed(lambda: by_hand.simulate(START.copy(), round(DURATION_S * TICKS_PER_SECOND))),
        "kernel": kernel,
        "kernel, stopping": stopping,
        **{f"run {name}": looped(scenario) for name, scenario in scenarios.items()},
        **{f"orders {name}": looped(scenarios[name], in_one=False) for name in one_loop},
        **{f"master {name}": replayed.once for name, replayed in masters.items()},
        **{f"plain {name}": looped(scenario) for name, scenario in plain.items()},
        f"plain {BY_ORDERS}": looped(plain["nothing"], in_one=False),
    }
    for way in ways.values():  # compiles
        way()
    found: dict[str, list[float]] = {name: [] for name in ways}
    for _ in track(range(rounds), "measuring", transient=True):
        for name, way in ways.items():
            found[name].append(way())
    section.say(
        f"The same modules by calls in one process. Processor time, least and median of {rounds} rounds, in which all "
        "rows of all tables here were measured in turns."
    )
    section.show(_kernels_table(found))
    section.say(
        "The kernel is what `RigidBody.propagate` calls. Stopping, it also forms the signal and asks the rule at every "
        "tick, as a run has it and as the loop by hand does; by hand the law is in the loop besides."
    )
    section.show(_systems_table(found, scenarios, masters))
    section.say(
        "Plant, sensor, controller and actuator with compiled formulas and ideal links are one kernel, unless somebody "
        "looks on or keeps a bag. All others, and what has a bag, run by orders of the time master."
    )
    section.say(
        "The time master is asked once more with the reports of that run, without anybody who obeys. An order is what "
        "a module is told once: to open a window, to look, to fire, to take a message."
    )
    section.show(_plain_table(found))
    section.say(
        f"`wu2018` over {PLAIN_S:g} s with parts in plain numpy, as in bench/plain_numpy.py. They are run by orders, "
        "which is what they cost first. Where signal and rule are compiled, the plant stops where the rule holds; "
        "otherwise it computes a window, of which a part is dropped."
    )
    if write:
        section.write()


def in_plain_numpy(parts: Sequence[str]) -> Scenario:
    """The scenario wu2018 with some of its parts in plain numpy, and the same numbers."""
    nodes = load("wu2018").nodes
    changes = [f"duration_s={PLAIN_S}"]
    for part in parts:
        node, key, kind = _PARTS[part]
        values = {**nodes[f"/{node}"][key], "class": f"plain_numpy:{kind}"}
        changes.append(f"{node}.{key}={json.dumps(values)}")
    return load("wu2018", None, changes)


def looped(scenario: Scenario, in_one: bool = True) -> Callable[[], float]:
    """What runs a scenario, and says how long its loop took [s]; in one kernel where it can be."""
    warm_up(scenario, in_one)
    return lambda: timed(engine_by_calls(scenario, scenario.build(), in_one=in_one).run)


def timed(call: Callable[[], object]) -> float:
    """Processor time of a call [s]."""
    began = time.process_time()
    call()
    return time.process_time() - began


def kernels() -> tuple[Callable[[], float], Callable[[], float]]:
    """The kernel of the rigid body over the whole duration, and with a rule that never holds [s]."""
    graph = load("wu2018").build()
    module, sensor = graph.modules["/plant"], graph.modules["/sensor"]
    assert isinstance(module, PlantModule)
    plant, held, count = module.plant, np.zeros(3), round(DURATION_S * TICKS_PER_SECOND)
    sensor.hold.send(np.zeros(3), 0)  # type: ignore[attr-defined]  # so that it can tell where to stop
    stop = sensor.stop()
    assert stop is not None
    numbers = stop.parameters.copy()
    numbers[-1] = 1e9  # gamma: never reached
    never = Stop(stop.criterion, numbers, stop.compared)

    return (
        lambda: timed(lambda: plant.propagate(START, 0, count, held)),
        lambda: timed(lambda: plant.propagate_until(never, START, 0, count, held)),  # type: ignore[attr-defined]
    )


@dataclass
class Replayed:
    """The reports of a run, for a time master of its own."""

    scenario: Scenario
    reports: list[Sequence[Report]]
    orders: int
    triggers: int

    @classmethod
    def of(cls, scenario: Scenario) -> Replayed:
        """Run a scenario and keep what was reported."""
        engine = engine_by_calls(scenario, scenario.build())
        batches = engine.master.run()
        orders, reports, count = next(batches), [], 0
        while True:
            reports.append([engine.obey(order) for order in orders])
            count += len(orders)
            try:
                orders = batches.send(reports[-1])
            except StopIteration:
                return cls(scenario, reports, count, sum(engine.master.fired.values()))

    def once(self) -> float:
        """How long the time master takes for all of it [s]."""
        orders = engine_by_calls(self.scenario, self.scenario.build()).master.run()

        def replay() -> None:
            next(orders)
            with contextlib.suppress(StopIteration):
                for reports in self.reports:
                    orders.send(reports)

        return timed(replay)


def _figures(values: Sequence[float], unit: float = 1e-3, digits: int = 2) -> tuple[str, str]:
    return f"{min(values) / unit:,.{digits}f}", f"{statistics.median(values) / unit:,.{digits}f}"


def _kernels_table(found: dict[str, list[float]]) -> Table:
    rows = []
    for label, name in (
        ("numba, a loop by hand (bench/others/by_hand.py)", "by hand"),
        ("the kernel", "kernel"),
        ("the kernel, stopping", "kernel, stopping"),
    ):
        ratio = statistics.median(one / other for one, other in zip(found[name], found["by hand"], strict=True))
        speed = DURATION_S / min(found[name])
        rows.append(Row((label, *_figures(found[name]), f"{speed:,.0f}", f"{ratio:.2f}")))
    columns = ("1000 s of the rigid body", "least [ms]", "median [ms]", "simulated s a second", "ratio")
    return Table("", columns, tuple(rows))


def _systems_table(
    found: dict[str, list[float]], scenarios: dict[str, Scenario], masters: dict[str, Replayed]
) -> Table:
    rows = []
    for name, scenario in scenarios.items():
        if f"orders {name}" in found:
            loops = found[f"run {name}"]
            speed = f"{scenario.run.duration_s / min(loops):,.0f}"
            triggers = f"{masters[name].triggers:,}"
            rows.append(Row((f"`{name}`, in one kernel", *_figures(loops), speed, triggers, "", "", "")))
    for name, scenario in scenarios.items():
        loops, master, replayed = (
            found.get(f"orders {name}", found[f"run {name}"]),
            found[f"master {name}"],
            masters[name],
        )
        rows.append(
            Row(
                (
                    f"`{name}`",
                    *_figures(loops),
                    f"{scenario.run.duration_s / min(loops):,.0f}",
                    f"{replayed.triggers:,}",
                    f"{replayed.orders:,}",
                    f"{min(master) / replayed.orders * 1e6:.1f}",
                    f"{min(master) / replayed.triggers * 1e6:.1f}",
                )
            )
        )
    columns = (
        "system", "least [ms]", "median [ms]", "simulated s a second", "triggers", "orders",
        "master [us an order]", "master [us a trigger]",
    )  # fmt: skip
    return Table("", columns, tuple(rows))


def _plain_table(found: dict[str, list[float]]) -> Table:
    rows = []
    first, *others = PLAIN
    for name in (first, BY_ORDERS, *others):
        loops, base = found[f"plain {name}"], found["plain nothing"]
        ratio = statistics.median(one / other for one, other in zip(loops, base, strict=True))
        rows.append(Row((name, *_figures(loops), f"{PLAIN_S / min(loops):,.0f}", f"{ratio:,.1f}")))
    columns = ("in plain numpy", "least [ms]", "median [ms]", "simulated s a second", "ratio")
    return Table("", columns, tuple(rows))


if __name__ == "__main__":
    typer.run(main)
