"""Nodes of a real-time run that are started by hand end when they are told to, whatever they are in the middle of."""

from __future__ import annotations

import signal
from types import SimpleNamespace
from typing import Any

import pytest

from etac_ros.engines.ros.host import Host
from etac_ros.engines.ros.plan import Plan, RealTime
from etac_ros.engines.ros.wall_host import WallHost
from etac_ros.engines.ros.wall_node import TimedNode
from etac_ros.errors import RunError
from etac_ros.maths.wall_clock import rate_of
from etac_ros.runs import windows_of
from etac_ros.scenario.load import load


@pytest.fixture
def plan() -> Plan:
    scenario = load("wu2018")
    wall = RealTime(rate_of(1.0))
    return Plan("wu2018", scenario.digest, scenario.graph, windows_of(scenario), wall=wall)


def test_a_run_in_simulated_time_is_refused_by_name(plan: Plan) -> None:
    """Its beginning says no instants; that was a traceback, and an end by way of DDS's own, which may hang."""
    node: Any = SimpleNamespace(started=False, name="/sensor", plan=plan)
    with pytest.raises(
        RunError, match=r"node /sensor: runs in real time, and /coordinator has begun a run in simulated"
    ):
        TimedNode._on_start(node, {"scenario": "wu2018", "digest": plan.digest}, 1)


def test_a_flood_does_not_keep_a_node_that_gives_up(plan: Plan, monkeypatch: pytest.MonkeyPatch) -> None:
    now = iter(range(1000))
    monkeypatch.setattr("etac_ros.engines.ros.host.time.monotonic", lambda: float(next(now)))
    host = WallHost(plan, ["/sensor"])
    host._spinner = SimpleNamespace(once=lambda timeout_s: True)  # type: ignore[assignment]
    host._give_up(RunError("node /sensor", "was told to end"))
    assert next(now) < 10


def test_what_fails_while_it_collects_does_not_hide_why_it_ends(plan: Plan, capsys: pytest.CaptureFixture[str]) -> None:
    def once(timeout_s: float) -> bool:
        raise RunError("topic /x", "message 7 of its publisher came as number 3")

    host = WallHost(plan, ["/sensor"])
    host._spinner = SimpleNamespace(once=once)  # type: ignore[assignment]
    host._give_up(RunError("node /sensor", "was told to end"))
    assert "while collecting what has arrived: topic /x" in capsys.readouterr().err


@pytest.mark.parametrize("by_hand", [True, False])
def test_the_system_ends_a_node_by_hand_that_cannot_end_itself(
    by_hand: bool, plan: Plan, monkeypatch: pytest.MonkeyPatch
) -> None:
    alarms: list[int] = []
    monkeypatch.setattr(signal, "alarm", alarms.append)
    host = Host(plan, ["/sensor"], supervised=None if by_hand else SimpleNamespace())  # type: ignore[arg-type]
    host._on_signal(signal.SIGTERM, None)
    assert host.ended_by == signal.SIGTERM
    assert alarms == ([20] if by_hand else [])
