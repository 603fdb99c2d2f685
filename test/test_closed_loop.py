"""A loop of compiled formulas in one kernel: the same bits as by orders, and nothing that is no such loop."""

from __future__ import annotations

from pathlib import Path

import pytest

from etac_ros.engines import closed_loop
from etac_ros.engines.closed_loop import closed_loop_of
from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import EtacError
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.spool import Spool
from etac_ros.modules.actuator import Actuator
from etac_ros.parameters import FloatArray
from etac_ros.runs import engine_by_calls, run_in_process
from etac_ros.scenario.load import Scenario, load
from etac_ros.timing.windows import WindowPolicy

WHEEL = "actuator.effectiveness=[1.0, 0.5, 0.0]"
LOOPS: dict[str, tuple[str, str | None, list[str]]] = {
    "as printed": ("wu2018", None, ["duration_s=300"]),
    "the same start in 9.5 hours": ("wu2018", None, ["duration_s=34000"]),
    "stamped": ("wu2018", None, ["duration_s=60", "wire=stamped"]),
    "wires of two kinds": ("wu2018", None, ["duration_s=60", "links.filtered_error.wire=double"]),
    "limits, wheels that fail": ("wu2018", None, ["duration_s=60", "actuator.limit_nm=0.02", WHEEL]),
    "a limit for each": (
        "wu2018",
        None,
        ["duration_s=60", "actuator.limit_nm=null", "actuator.limits=[0.01, 0.02, 0.03]"],
    ),
    "sub-steps": ("wu2018", None, ["duration_s=30", "plant.dynamics.substeps=3"]),
    "an event at every tick": ("wu2018", None, ["duration_s=10", "sensor.trigger.gamma=1e-300", "controller.law.k=40"]),
    "ends at an event": ("wu2018", None, ["duration_s=0.03125"]),
    "a flexible spacecraft": ("flexible", None, ["duration_s=60"]),
    "the long way round, shadow set": ("flexible", "large-angle", ["duration_s=60"]),
}
OTHERS: dict[str, list[str]] = {
    "noise": ["sensor.noise.enters=both"],
    "low-pass": ["sensor.low_pass_s=1.0"],
    "a least interval": ["sensor.trigger.least_interval_s=1.0"],
    "a period": ['sensor.trigger={"class": "etac_ros.triggers.periodic:Periodic", "period_s": 1.0}'],
    "a delay": ["links.torque_command.delay_ticks=1"],
    "loss": ["links.filtered_error.loss=0.1"],
    "acknowledged": ["links.filtered_error={acknowledged: {timeout_s: 0.5}}"],
    "a fault": ["faults={nap: {do: stall, node: /sensor, at_s: 2.0, for_s: 3.0}}"],
    "a time to live": ["actuator.time_to_live_s=1.0"],
    "axes": ["actuator.axes=[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]"],
    "a class of somebody else": ["actuator.module=test_closed_loop:Mine"],
}


class Mine(Actuator):
    """Might do anything."""


def by_orders(scenario: Scenario) -> InProcess:
    return engine_by_calls(scenario, scenario.build(), in_one=False)


@pytest.mark.parametrize("case", LOOPS)
def test_all_bits_are_those_of_a_run_by_orders(case: str) -> None:
    scenario = load(*LOOPS[case])
    assert closed_loop_of(scenario.build()) is not None
    orders, loop = by_orders(scenario), engine_by_calls(scenario, scenario.build())
    usual, found = orders.run(), loop.run()
    assert loop.recording.digest() == orders.recording.digest()
    assert found.messages.keys() == usual.messages.keys()
    assert found.span("/plant") == usual.span("/plant")
    for name in ("tick", "halted", "fired", "sent"):
        assert getattr(loop.master, name) == getattr(orders.master, name)
    if case == "as printed":
        assert orders.master.fired == {"/sensor": 38}
        assert len(found.truth["/plant"]) < len(usual.truth["/plant"])


@pytest.mark.parametrize(("ticks", "events"), [(1, 4096), (64, 4096), (1 << 15, 1), (100, 3)])
def test_no_bit_depends_on_how_much_is_computed_at_once(
    ticks: int, events: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    usual = by_orders(scenario).run().digest()
    monkeypatch.setattr(closed_loop, "_TICKS_AT_ONCE", ticks)
    monkeypatch.setattr(closed_loop, "_EVENTS_AT_ONCE", events)
    assert engine_by_calls(scenario, scenario.build()).run().digest() == usual


@pytest.mark.parametrize("case", OTHERS)
def test_whatever_else_there_is_runs_by_orders(case: str) -> None:
    graph = load("wu2018", None, ["duration_s=6", *OTHERS[case]]).build()
    assert closed_loop_of(graph) is None


def test_who_looks_on_or_waits_sees_every_order() -> None:
    scenario = load("wu2018", None, ["duration_s=5"])
    for name in ("trace", "before"):
        seen: list[object] = []
        engine = engine_by_calls(scenario, scenario.build())
        setattr(engine, name, lambda *what, seen=seen: seen.append(what))
        engine.run()
        assert len(seen) > 5


@pytest.mark.parametrize(
    "changes",
    [
        ["controller.law.k=1e300"],  # beyond single precision
        ["controller.law.k=1e306", "actuator.limit_nm=null", "wire=stamped"],  # the state is no number soon
    ],
)
def test_what_is_no_number_is_named_as_by_orders(changes: list[str]) -> None:
    scenario = load("wu2018", None, ["duration_s=60", *changes])
    said = []
    for engine in (by_orders(scenario), engine_by_calls(scenario, scenario.build())):
        try:
            engine.run()
        except EtacError as error:
            said.append(str(error))
        else:
            said.append(engine.master.halted)
    assert said[0] == said[1] != ""


def test_a_watch_ends_a_run_at_the_same_tick(monkeypatch: pytest.MonkeyPatch) -> None:
    def bounded(self: PlantModule, start: int, rows: FloatArray) -> str:
        return "enough" if start + len(rows) > 500 else ""

    monkeypatch.setattr(PlantModule, "left_bounds", bounded)
    scenario = load("wu2018", None, ["duration_s=60"])
    orders, loop = by_orders(scenario), engine_by_calls(scenario, scenario.build())
    assert orders.run().digest() == loop.run().digest()
    assert orders.master.halted == loop.master.halted == "/plant: enough"


def test_a_bag_has_the_chunks_of_a_run_by_orders(tmp_path: Path) -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    run = run_in_process(scenario, tmp_path / "bag")
    windows = InProcess(scenario.build(), WindowPolicy(64, 64), trimmed=1024).run().truth["/plant"]
    assert len(run.recording.truth["/plant"]) == len(windows)


def test_samples_of_a_long_run_do_not_stay_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    put_away = []
    usual = Spool._put_away
    monkeypatch.setattr(Spool, "_put_away", lambda self: (put_away.append(self), usual(self))[1])
    monkeypatch.setattr(closed_loop, "Spool", lambda: Spool(kept_bytes=1 << 20))
    scenario = load("wu2018", None, ["duration_s=3000"])
    recording = InProcess(scenario.build(), in_one=True).run()
    assert len(put_away) > 1
    assert recording.digest() == InProcess(scenario.build()).run().digest()
