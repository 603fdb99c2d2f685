"""A node that waits for others says so: after a while, how long it has waited, and then ever more seldom."""

from __future__ import annotations

import re
from types import SimpleNamespace
from typing import Any

import pytest

from etac_ros.engines.ros import host as host_module
from etac_ros.engines.ros.host import Host
from etac_ros.engines.ros.plan import Plan
from etac_ros.runs import windows_of
from etac_ros.scenario.load import load


class WaitsForever:
    """A node whose other ends come after so many seconds."""

    name = "/sensor"

    def __init__(self, clock: list[float], until: float) -> None:
        self._clock, self._until = clock, until
        self.said: list[str] = []

    @property
    def matched(self) -> bool:
        return self._clock[0] >= self._until

    def missing(self) -> list[str]:
        return ["/torque (no subscription of /plant)"]

    def log(self, text: str) -> None:
        """Nobody listens."""

    def say(self, text: str) -> None:
        self.said.append(text)

    def announce(self) -> None:
        """They are there."""


def test_who_waits_says_so_ever_more_seldom(monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = load("wu2018")
    clock = [0.0]
    monkeypatch.setattr(host_module, "time", SimpleNamespace(monotonic=lambda: clock[0]))
    host: Any = Host(Plan(scenario.name, scenario.digest, scenario.graph, windows_of(scenario)), ["/sensor"])

    def once(timeout_s: float) -> bool:
        clock[0] += 1.0
        return False

    host._spinner = SimpleNamespace(once=once)
    host._look_around = lambda: None
    node = WaitsForever(clock, 700.0)
    host._nodes = [node]
    host._join()
    assert [int(re.match(r"\d+", text)[0]) for text in node.said] == [20, 60, 140, 300, 620]  # type: ignore[index]
    assert "still no other end for /torque (no subscription of /plant)" in node.said[0]
