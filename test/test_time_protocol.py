"""The time protocol, specified as execution traces; each holds in process and over DDS, whatever the windows are.

A trace line is ``tick:step link#number=value``; in the toy system a value is 1000 x (messages heard) + the ramp.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import pytest
from toy import toy, trace

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import ProtocolError
from etac_ros.runs import RosOptions, run_over_ros
from etac_ros.scenario.load import Scenario
from etac_ros.timing.windows import WindowPolicy


class Case(NamedTuple):
    """A system and its trace."""

    a: dict[str, Any]
    b: dict[str, Any]
    links: dict[str, Any]
    trace: str

    def scenario(self, folder: Path) -> Scenario:
        return toy(folder, {"a": self.a, "b": self.b}, **self.links)

    def lines(self) -> list[str]:
        return [line.strip() for line in self.trace.strip().splitlines()]


CASES = {
    # Both act at tick 3: each on its knowledge from before the other's message. At tick 4 b knows of it.
    "same tick, then one right after": Case(
        a={"at": [3, 6]},
        b={"at": [3, 4, 6]},
        links={},
        trace="""
            3:0 a_says#1=3
            3:0 b_says#1=3
            3:1 a_push#1=-0.5
            3:1 b_push#1=-0.5
            4:0 b_says#2=1003.5
            4:1 b_push#2=-0.5
            6:0 a_says#2=2004.5
            6:0 b_says#3=1004.5
            6:1 a_push#2=-0.5
            6:1 b_push#3=-0.5
        """,
    ),
    # A delayed message arrives at its tick in step 1, after that tick's own acts were decided.
    "delay": Case(
        a={"at": [3, 6]},
        b={"at": [4], "echo": True},
        links={"a_says": {"delay_ticks": 2}},
        trace="""
            3:0 a_says#1=3
            4:0 b_says#1=4
            4:1 b_push#1=-0.5
            5:1 a_push#1=-0.5
            5:1 b_says#2=1004.5
            5:2 b_push#2=-0.5
            6:0 a_says#2=2005.5
            8:1 a_push#2=-0.5
            8:1 b_says#3=2006
            8:2 b_push#3=-0.5
        """,
    ),
    # Loss is drawn for each receiver: #2 reaches the sensor of b, not the brake of a; #4 the brake only.
    "loss": Case(
        a={"at": [0, 2, 4, 6, 8]},
        b={"echo": True},
        links={"a_says": {"loss": 0.5}},
        trace="""
            0:0 a_says#1=0
            2:0 a_says#2=2
            2:1 b_says#1=1002
            2:2 b_push#1=-0.5
            4:0 a_says#3=1004
            4:1 b_says#2=2003
            4:2 b_push#2=-0.5
            6:0 a_says#4=2006
            6:1 a_push#1=-0.5
            8:0 a_says#5=2007
            8:1 b_says#3=3005
            8:2 b_push#3=-0.5
        """,
    ),
    # What is sent too late to arrive before the end is sent, counted, and nothing more.
    "arrival after the end": Case(
        a={"at": [18]},
        b={"at": [19]},
        links={"a_says": {"delay_ticks": 5}},
        trace="""
            18:0 a_says#1=18
            19:0 b_says#1=19
            19:1 b_push#1=-0.5
        """,
    ),
}


@pytest.mark.parametrize("name", list(CASES))
@pytest.mark.parametrize("length", [1, 2, 5, 64])
def test_trace_in_process(name: str, length: int, tmp_path: Path) -> None:
    case = CASES[name]
    engine = InProcess(case.scenario(tmp_path).build(), WindowPolicy(length, length))
    assert trace(engine.run()) == case.lines()


@pytest.mark.parametrize("name", list(CASES))
def test_trace_over_dds(name: str, tmp_path: Path) -> None:
    case = CASES[name]
    run = run_over_ros(case.scenario(tmp_path), tmp_path / "arrivals", RosOptions(processes="namespace"))
    assert trace(run.recording) == case.lines()


@pytest.mark.parametrize("length", [1, 3, 64])
def test_a_message_moves_anothers_trigger(length: int, tmp_path: Path) -> None:
    alone = toy(tmp_path, {"b": {"above": 4.5}})
    first = trace(InProcess(alone.build(), WindowPolicy(length, length)).run())[0]
    assert first == "5:0 b_says#1=5"
    warned = toy(tmp_path, {"a": {"at": [3]}, "b": {"above": 4.5}})
    lines = trace(InProcess(warned.build(), WindowPolicy(length, length)).run())
    # The bound has doubled to 9 when a was heard; b's ramp passes it at tick 10.
    assert next(line for line in lines if "b_says" in line) == "10:0 b_says#1=1010"


def test_a_loop_without_delay_names_its_links(tmp_path: Path) -> None:
    scenario = toy(tmp_path, {"a": {"at": [3], "echo": True}, "b": {"echo": True}})
    with pytest.raises(ProtocolError, match=r"links a_says: after 100 steps the messages of tick 3"):
        InProcess(scenario.build()).run()


def test_a_loop_without_delay_ends_a_run_over_dds(tmp_path: Path) -> None:
    scenario = toy(tmp_path, {"a": {"at": [3], "echo": True}, "b": {"echo": True}})
    with pytest.raises(ProtocolError, match="still go round"):
        run_over_ros(scenario, tmp_path / "arrivals")
