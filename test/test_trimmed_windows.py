"""Windows that end where their reader acts: less is computed, and no bit is another."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from network import Network
from network import run as run_network

from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.rk4 import Stop
from etac_ros.modules.sensor import Sensor
from etac_ros.parameters import FloatArray
from etac_ros.plants.rigid import RigidBody
from etac_ros.scenario.load import load
from etac_ros.timing.orders import Open, Order, Report
from etac_ros.timing.windows import WindowPolicy

CASES: dict[str, tuple[str, list[str]]] = {
    "as printed": ("wu2018", ["duration_s=60"]),
    "sub-steps": ("wu2018", ["duration_s=20", "plant.dynamics.substeps=3"]),
    # Here the window goes on to be used: what the sensor says changes nothing at the plant, or does so later.
    "lost": ("wu2018", ["duration_s=60", "links.filtered_error.loss=0.5", "seed=4"]),
    "delayed": ("wu2018", ["duration_s=60", "links.torque_command.delay_ticks=40"]),
    "acknowledged": (
        "wu2018",
        ["duration_s=60", "links.filtered_error={loss: 0.3, acknowledged: {timeout_s: 0.5, retries: 1}}"],
    ),
    "stalls": ("wu2018", ["duration_s=30", "faults={nap: {do: stall, node: /sensor, at_s: 2.0, for_s: 3.0}}"]),
    # What cannot be told beforehand is not.
    "noise": ("wu2018", ["duration_s=2", "sensor.noise.enters=both"]),
    "dwell time": ("wu2018", ["duration_s=60", "sensor.trigger.least_interval_s=1.0"]),
    "shadow set": ("flexible", ["duration_s=20"]),
    "no sensor of its own": ("shi2022", ["duration_s=2"]),
}
TOLD = {"as printed", "sub-steps", "lost", "delayed", "acknowledged", "stalls", "shadow set"}
"""Where plant and reader can tell when to stop."""


def run(
    name: str,
    changes: list[str],
    windows: WindowPolicy,
    note: Callable[[Order, Report], None] | None,
    trimmed: int | None,
) -> tuple[str, int]:
    """Digest of a run, and how many samples were computed for it."""
    graph = load(name, None, changes).build()
    computed = []
    for plant in graph.plants:
        module = graph.modules[plant]
        assert isinstance(module, PlantModule)
        module.open = _counted(module.open, computed)  # type: ignore[method-assign]
    engine = InProcess(graph, windows, note, trimmed=trimmed)
    return engine.run().digest(), sum(computed)


def _counted(opened: Callable[..., Any], computed: list[int]) -> Callable[..., Any]:
    def open_and_count(*arguments: Any) -> Any:
        window = opened(*arguments)
        computed.append(len(window.samples))
        return window

    return open_and_count


@pytest.mark.parametrize("case", CASES)
def test_a_trimmed_run_has_the_same_bits_and_computes_less(case: str) -> None:
    name, changes = CASES[case]
    windows = WindowPolicy(64, 512)
    short: list[Report] = []

    def note(order: Order, report: Report) -> None:
        if isinstance(order, Open) and report.last is not None:
            assert order.tick < report.last < order.tick + order.length
            short.append(report)

    usual, many = run(name, changes, windows, None, trimmed=None)
    trimmed, few = run(name, changes, windows, note, trimmed=512)
    assert trimmed == usual
    assert bool(short) == (case in TOLD)
    assert few < many if case in TOLD else few == many


def test_a_plant_that_propagates_in_its_own_way_is_asked_to() -> None:
    class Own(RigidBody):
        def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
            return super().propagate(state, tick, count, 1.1 * held)

    class Both(Own):
        def propagate_until(self, stop: Stop, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
            return super().propagate_until(stop, state, tick, count, 1.1 * held)

    def digests(kind: type[RigidBody]) -> list[str]:
        found = []
        for trimmed in (None, 512):
            graph = load("wu2018", None, ["duration_s=20"]).build()
            plant = graph.modules["/plant"].plant  # type: ignore[attr-defined]
            plant.__class__ = kind
            found.append(InProcess(graph, WindowPolicy(64, 512), trimmed=trimmed).run().digest())
        return found

    usual, *others = digests(RigidBody)
    own = digests(Own)
    assert others == [usual]
    assert usual not in own
    assert own == digests(Both) == [own[0]] * 2


def test_what_is_not_dropped_is_all_that_is_computed() -> None:
    first = 64  # the first window cannot end where the first sample is sent
    _, computed = run("wu2018", ["duration_s=100"], WindowPolicy(first, 512), None, trimmed=512)
    assert 100 * 32 <= computed <= 100 * 32 + first + 512


def over_messages(changes: list[str]) -> tuple[str, int, int]:
    """Digest of a run whose parts are joined by messages, how many windows its sensor was shown, how often it fired."""
    scenario = load("wu2018", None, changes)
    network = run_network(lambda: Network(scenario.build(), WindowPolicy(64, 512)), lambda waiting: waiting[0])
    fired = network.master.fired["/sensor"]
    return network.recording().digest(), network.delivered["/sensor", "window of /plant"], fired


@pytest.mark.parametrize("case", ["as printed", "lost", "delayed", "acknowledged", "stalls"])
def test_a_hint_that_is_right_wrong_or_missing_changes_no_bit(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    _, changes = CASES[case]
    usual, _ = run("wu2018", changes, WindowPolicy(64, 512), None, trimmed=None)
    right, few, fired = over_messages(changes)
    hinted = Sensor.stop_at

    def wrong(sensor: Sensor, compared: FloatArray) -> Stop | None:
        return hinted(sensor, compared[::-1] + 0.01)

    monkeypatch.setattr(Sensor, "stop_at", wrong)
    misled, ill, _ = over_messages(changes)
    monkeypatch.setattr(Sensor, "stop_at", lambda sensor, compared: None)
    untold, many, _ = over_messages(changes)
    assert right == misled == untold == usual
    assert max(few, ill) <= many + fired  # a hint is good for one act
    assert case != "as printed" or few < many


def test_over_messages_nothing_that_is_computed_is_dropped() -> None:
    scenario = load("wu2018", None, ["duration_s=100"])
    network = run_network(lambda: Network(scenario.build(), WindowPolicy(64, 4096)), lambda waiting: waiting[0])
    # One behind the last message, or for the rest of the first window.
    assert network.delivered["/sensor", "window of /plant"] == network.master.fired["/sensor"] + 1
