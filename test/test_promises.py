"""Who breaks the contract of a module is named - node, class, method, found, expected - at once, in both engines."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import faulty
import numpy as np
import pytest
from test_engines_equal import assert_same

from etac_ros.errors import BrokenPromise, ProtocolError, ScenarioError
from etac_ros.graph.driver import Driver
from etac_ros.graph.module import Arrival, Window
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load

Small = Callable[..., Path]
LAW = '{class: "etac_ros.laws.wu2018:Proportional", k: 2.0}'
RULE = '{class: "etac_ros.triggers.relative:RelativeThreshold", alpha: 0.5, gamma: 1e-6}'
SIGNAL = '{class: "etac_ros.laws.wu2018:FilteredError", beta: 0.5}'
PLANT = '"etac_ros.plants.rigid:RigidBody"'
ACTUATOR = "    module: actuator\n"
SENSOR = f"    module: sensor\n    reads: /plant\n    signal: {SIGNAL}\n    trigger: {RULE}\n"


def law(returns: str) -> tuple[str, str]:
    return LAW, f'{{class: "faulty:Law", returns: "{returns}"}}'


def rule(returns: str) -> tuple[str, str]:
    return RULE, f'{{class: "faulty:Rule", returns: "{returns}"}}'


def answering(says: str) -> tuple[str, str]:
    return ACTUATOR, f'    module: "faulty:Answering"\n    says: "{says}"\n'


def acting(scan: str) -> tuple[str, str]:
    return SENSOR, f'    module: "faulty:Acting"\n    reads: /plant\n    scan: "{scan}"\n'


SHAPE = "expected: an array of floats of shape (3,)"
TICK = "expected: a tick later than"
INDEX = "expected: the index of one of"
BROKEN: dict[str, tuple[tuple[str, str], list[str]]] = {
    "scalar law": (law("scalar"), ["/controller: Law.command returned", "(float)", SHAPE]),
    "wide law": (law("wide"), ["/controller: Law.command returned an array of float64 of shape (4,)", SHAPE]),
    "law without a word": (law("nothing"), ["/controller: Law.command returned None (NoneType)", SHAPE]),
    "law of a list": (law("list"), ["/controller: Law.command returned [0.0, 0.0, 0.0] (list)", SHAPE]),
    "complex law": (law("complex"), ["/controller: Law.command returned an array of complex128", SHAPE]),
    "law of nan": (law("nan"), ["/controller: Law.command returned [nan, nan, nan]", "finite numbers"]),
    "more than float32": (law("huge"), ["/controller: Controller.receive, port 'command', sends", "on the wire"]),
    "law that exits": (law("exits"), ["/controller:", "raised SystemExit: 0"]),
    "rule of None": (rule("nothing"), ["/sensor: Rule.first returned None (NoneType)", INDEX, "or -1 for none"]),
    "rule of True": (rule("true"), ["/sensor: Rule.first returned True (bool)", INDEX]),
    "rule of a float": (rule("float"), ["/sensor: Rule.first returned 0.0 (float)", INDEX]),
    "rule beyond the window": (rule("beyond"), ["/sensor: Rule.first returned", INDEX]),
    "rule before the window": (rule("negative"), ["/sensor: Rule.first returned -2 (int)", INDEX]),
    "signal of nan": ((SIGNAL, '{class: "faulty:Signal", beta: 0.5}'), ["/sensor: Signal.evaluate gives [", "nan"]),
    "wide signal": (
        (SIGNAL, '{class: "faulty:WideSignal", beta: 0.5}'),
        ["/sensor: WideSignal.evaluate returned an array of float64 of shape (8, 4)", "of shape (8, 3)"],
    ),
    "short plant": ((PLANT, '"faulty:Plant"'), ["/plant: Plant.propagate returned", "expected: an array of floats"]),
    "misspelt port": (answering("misspelt"), ["/actuator: Answering.receive names the port 'torqe'", "'torque'"]),
    "no answer": (answering("nothing"), ["/actuator: Answering.receive sends nothing", "on 'torque', by its role"]),
    "None": (answering("none"), ["/actuator: Answering.receive returned None", "a dict of arrays by output port"]),
    "bare array": (answering("array"), ["/actuator: Answering.receive returned an array", "a dict of arrays"]),
    "narrow": (answering("narrow"), ["/actuator: Answering.receive, port 'torque', returned", SHAPE]),
    "nan": (answering("nan"), ["/actuator: Answering.receive, port 'torque', sends", "finite numbers"]),
    "scan of after": (acting("after"), ["/sensor: Acting.scan returned 5 (int)", f"{TICK} 5"]),
    "scan of the past": (acting("before"), ["/sensor: Acting.scan returned 2 (int)", f"{TICK} 5"]),
    "scan of True": (acting("true"), ["/sensor: Acting.scan returned True (bool)", TICK]),
    "scan of a float": (acting("float"), ["/sensor: Acting.scan returned 6.0 (float)", TICK]),
    "scan beyond the window": (acting("beyond"), ["/sensor: Acting.scan returned", "the window's last"]),
}


def in_order(parts: list[str], text: str) -> bool:
    place = 0
    for part in parts:
        place = text.find(part, place)
        if place < 0:
            return False
        place += len(part)
    return True


@pytest.mark.parametrize("case", list(BROKEN))
def test_a_broken_promise_is_named(case: str, small: Small) -> None:
    replacement, parts = BROKEN[case]
    with np.errstate(all="ignore"), pytest.raises(BrokenPromise) as caught:
        run_in_process(load(str(small(replacement))))
    assert in_order(parts, str(caught.value)), str(caught.value)


@pytest.mark.parametrize("case", ["misspelt port", "rule of True", "scan of after"])
def test_the_same_is_said_over_dds(case: str, small: Small, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    replacement, parts = BROKEN[case]
    monkeypatch.setattr("etac_ros.runs.warm_up", lambda scenario: None)  # it would say so before the first node starts
    with pytest.raises(BrokenPromise) as caught:
        run_over_ros(load(str(small(replacement))), tmp_path / "bag", RosOptions())
    assert in_order(parts, str(caught.value)), str(caught.value)


def test_an_exception_is_shown_with_the_users_traceback_alone(small: Small) -> None:
    with pytest.raises(BrokenPromise) as caught:
        run_in_process(load(str(small(law("raises")))))
    text = str(caught.value)
    assert text.startswith("/controller: Law.command raised ZeroDivisionError: division by zero\nTraceback")
    assert in_order(
        ["faulty.py", "in command", "faulty.py", "in _divide", "ZeroDivisionError"], text.partition("\n")[2]
    )
    assert "etac_ros/" not in text.replace("/etac_ros/test/", "")
    copy = type(caught.value)(*caught.value.__reduce__()[1])  # it crosses process borders
    assert str(copy) == text


def message_of(path: Path) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(str(path))
    return str(caught.value)


@pytest.mark.parametrize(
    ("replacement", "parts"),
    [
        (
            (LAW, '{class: "faulty:InitRaises", k: 2.0}'),
            ["/controller.law: InitRaises.__init__ raised KeyError: 'gain'", "faulty.py", "KeyError: 'gain'"],
        ),
        (
            (LAW, '{class: "faulty:AsksForMore", k: 2.0}'),
            ["/controller: AsksForMore.command asks for 'temperature'", "tick and state"],
        ),
        ((ACTUATOR, '    module: "faulty:NoSuper"\n'), ["/actuator: NoSuper has no dict 'inputs'", "super().__init__"]),
        ((ACTUATOR, '    module: "faulty:OddSize"\n'), ["/actuator: OddSize.outputs['torque'] is 3.0", "an int"]),
        (
            (ACTUATOR, '    module: "faulty:WrongPort"\n    says: "narrow"\n'),
            ["/actuator: the role of WrongPort: triggers names the port 'torqe'", "'torque'"],
        ),
    ],
)  # fmt: skip
def test_a_class_that_cannot_be_built_is_named(replacement: tuple[str, str], parts: list[str], small: Small) -> None:
    message = message_of(small(replacement))
    assert in_order(parts, message), message


@pytest.mark.parametrize("tick", [4, 10])
def test_a_tick_whose_sample_is_not_there_is_refused(tick: int, small: Small) -> None:
    # Negative places would silently give another sample.
    driver = Driver(load(str(small())).build(), "/sensor")
    driver.see(Window("/plant", 1, 0, np.ones((5, 7))))
    driver.see(Window("/plant", 2, 5, np.ones((5, 7))))
    with pytest.raises(ProtocolError, match=rf"node /sensor: is to act at tick {tick}, .*\n.*from 5 to 9"):
        driver.fire(tick)


def test_a_message_of_another_size_names_its_sender(small: Small) -> None:
    driver = Driver(load(str(small())).build(), "/actuator")
    with pytest.raises(ProtocolError, match=r"node /controller: has sent 4 components to /actuator:command, on link"):
        driver.receive(None, (Arrival("command", "command", np.zeros(4)),))


def test_flags_of_old_are_refused_with_what_to_write() -> None:
    with pytest.raises(TypeError, match=r"Old.answers is part of the role of a module: role = Role\(answers="):
        faulty.old()


def test_what_a_module_does_not_round_is_rounded_in_both_engines(small: Small, tmp_path: Path) -> None:
    path = small(
        (ACTUATOR, '    module: "faulty:Unrounded"\n    says: ""\n'),
        ("to: [/plant], kind: physical", "to: [/relay], kind: internal"),
        (
            "    variants:\n",
            "      thrust: {from: /relay, to: [/plant], kind: physical}\n    variants:\n",
        ),
    )
    path.write_text(path.read_text() + "/relay:\n  ros__parameters:\n    module: actuator\n")
    scenario = load(str(path))
    by_calls = run_in_process(scenario)
    over_ros = run_over_ros(scenario, tmp_path / "bag", RosOptions(processes="one"))
    assert_same(over_ros.recording, by_calls.recording)
    values = np.array([message.value for message in by_calls.recording.messages["torque"]])
    assert np.array_equal(values, values.astype(np.float32))
