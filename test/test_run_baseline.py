"""The baseline of a run is computed beside what the run has to load, and none is no reason against the run."""

from __future__ import annotations

import io
import os
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console

from etac_ros.cli import run
from etac_ros.errors import RunHalted
from etac_ros.scenario.load import Scenario, load


@pytest.fixture
def periodic() -> Scenario:
    return load("wu2018", "periodic", ("duration_s=2",))


@pytest.fixture
def order(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Two cores, and nothing of ROS is loaded."""
    done: list[str] = []
    monkeypatch.setattr(run, "load_ros", lambda: done.append("loaded"))
    monkeypatch.setattr("os.sched_getaffinity", lambda _: {0, 1})
    return done


def baseline(scenario: Scenario, engine: str) -> tuple[Any, str]:
    shown = io.StringIO()
    found = run._baseline(scenario, run.RunRequest("wu2018", engine=engine), None, Console(file=shown, width=200))
    return found, shown.getvalue()


def test_it_is_what_it_is_by_calls_in_this_process(periodic: Scenario, order: list[str]) -> None:
    beside, here = baseline(periodic, "ros"), baseline(periodic, "inprocess")
    of_time = {"timing"}
    assert beside[0].model_dump(exclude=of_time) == here[0].model_dump(exclude=of_time)
    assert beside[0].network.messages > 0
    assert (beside[1], here[1], order) == ("", "", ["loaded"])


def test_over_dds_another_process_computes_it_meanwhile(
    periodic: Scenario, order: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    me = os.getpid()
    monkeypatch.setattr(run, "run_in_process", lambda _: SimpleNamespace(summary=(os.getpid(), list(order))))
    (process, loaded), _ = baseline(periodic, "ros")
    assert process != me
    assert (loaded, order) == ([], ["loaded"])
    assert baseline(periodic, "inprocess")[0][0] == me


@pytest.mark.parametrize("engine", ["ros", "inprocess"])
def test_one_that_a_watch_ends_is_said_and_left_out(
    engine: str, periodic: Scenario, order: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def halts(scenario: Scenario) -> Any:
        raise RunHalted("scenario 'wu2018'", "halted at simulated time 1 s: too far")

    monkeypatch.setattr(run, "run_in_process", halts)
    found, shown = baseline(periodic, engine)
    assert found is None
    assert shown == "no baseline 'periodic' to compare with: scenario 'wu2018': halted at simulated time 1 s: too far\n"
