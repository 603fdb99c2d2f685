"""One's own classes in the loop: a plant, a signal, a trigger rule, a law and a module from a package of one's own."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import BrokenPromise, ScenarioError
from etac_ros.graph.recording import Message, Recording
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.timing.windows import WindowPolicy

Small = Callable[..., Path]
PACKAGE = "users_own_control"

CODE = {
    "__init__.py": "",
    "loop.py": '''
"""A spring on one axis under a law that pulls it back, with a rule that fires on a fixed distance."""

import numpy as np
from pydantic import PositiveFloat

from etac_ros.graph.module import Module
from etac_ros.graph.role import Acts, Role
from etac_ros.parameters import Parameters


class SpinParameters(Parameters):
    start: float = 1.0


class Spin:
    """x' = torque, exactly, sampled."""

    Parameters = SpinParameters
    labels = ("x",)
    inputs = {"torque": 1}
    noise_width = 0
    attitude_slice = slice(0, 1)
    rate_slice = slice(0, 1)

    def __init__(self, parameters, ticks_per_second):
        self._start = parameters.start
        self._step = 1.0 / ticks_per_second

    def initial_state(self):
        return np.array([self._start])

    def propagate(self, state, tick, count, held):
        return state + self._step * held * np.arange(1, count + 1)[:, np.newaxis]

    def measured(self, states, errors):
        return states

    def euler_angles(self, states):
        return np.repeat(states, 3, axis=1)

    def attitude_angle(self, states):
        return states[:, 0]


class Itself:
    class Parameters(Parameters):
        pass

    size = 1
    label = "x"

    def __init__(self, parameters, ticks_per_second):
        pass

    def evaluate(self, states):
        return states.copy()


class DistanceParameters(Parameters):
    distance: PositiveFloat


class Distance:
    Parameters = DistanceParameters

    def __init__(self, parameters, ticks_per_second):
        self._distance = parameters.distance

    def first(self, signals, tick, held, held_tick=None):
        hits = np.flatnonzero(np.abs(signals[:, 0] - held[0]) >= self._distance)
        return int(hits[0]) if hits.size else -1

    def margin(self, signals, held):
        return np.abs(signals[:, 0] - held[0]), np.full(len(signals), self._distance)


class PullParameters(Parameters):
    gain: PositiveFloat = 1.0


class Pull:
    Parameters = PullParameters

    def __init__(self, parameters, ticks_per_second):
        self.signal_size = self.command_size = 1
        self._gain = parameters.gain

    def command(self, signal):
        return -self._gain * signal


class Wheel(Module):
    """An actuator that forgets a tenth; it names no Parameters, and has those of every module: none."""

    role = Role(Acts.AT_ONCE)

    def __init__(self, context, parameters):
        super().__init__(context)
        self.inputs = {"command": 1}
        self.outputs = {"torque": 1}

    def receive(self, tick, bag, sample):
        return {"torque": 0.9 * bag[-1].value}
''',
    "wrong.py": """
from etac_ros.graph.module import Module
from etac_ros.graph.role import Acts, Role
from etac_ros.parameters import Parameters


class NoParameters:
    signal_size = command_size = 3

    def __init__(self, parameters, ticks_per_second):
        pass

    def command(self, signal):
        return signal


class OtherParameters(NoParameters):
    class Parameters:
        k = 1.0


class NoGrid(NoParameters):
    Parameters = Parameters

    def __init__(self, parameters):
        pass


class NoSizes:
    Parameters = Parameters

    def __init__(self, parameters, ticks_per_second):
        pass

    def command(self, signal):
        return signal


class Refuses(NoParameters):
    Parameters = Parameters

    def __init__(self, parameters, ticks_per_second):
        raise ValueError("a grid of 10 ticks a second is too coarse for this law")


class NoContext(Module):
    def __init__(self):
        pass


class OddParameters(Module):
    Parameters = dict

NOT_A_CLASS = 3
""",
    "broken.py": "1 / 0\n",
    "garbled.py": "def f(:\n",
    "needs.py": "import a_package_that_is_not_here\n",
}

SCENARIO = f"""
/**:
  ros__parameters:
    scenario: own
    ticks_per_second: 100
    duration_s: 4.0
    links:
      x: {{from: /sensor, to: [/controller], kind: network}}
      pull: {{from: /controller, to: [/wheel], kind: network}}
      torque: {{from: /wheel, to: [/spin], kind: physical}}
/sensor:
  ros__parameters:
    module: sensor
    reads: /spin
    signal: {{class: "{PACKAGE}.loop:Itself"}}
    trigger: {{class: "{PACKAGE}.loop:Distance", distance: 0.125}}
/spin:
  ros__parameters:
    module: plant
    dynamics: {{class: "{PACKAGE}.loop:Spin", start: 1.0}}
/controller:
  ros__parameters: {{module: controller, law: {{class: "{PACKAGE}.loop:Pull", gain: 0.5}}}}
/wheel:
  ros__parameters: {{module: "{PACKAGE}.loop:Wheel"}}
"""


@pytest.fixture(autouse=True)
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "src" / PACKAGE
    folder.mkdir(parents=True)
    for name, code in CODE.items():
        (folder / name).write_text(code)
    monkeypatch.syspath_prepend(folder.parent)
    yield folder
    for name in [name for name in sys.modules if name.split(".")[0] == PACKAGE]:
        del sys.modules[name]


@pytest.fixture
def own(tmp_path: Path) -> Path:
    path = tmp_path / "own.yaml"
    path.write_text(SCENARIO)
    return path


def values(messages: list[Message]) -> list[float]:
    return [float(message.value[0]) for message in messages]


def test_own_classes_run(own: Path) -> None:
    run = run_in_process(load(str(own)))
    sent = values(run.recording.messages["x"])
    assert sent[0] == 1.0
    # It fires at the first tick at which the distance is reached: one step beyond it at most.
    steps = [before - after for before, after in pairwise(sent)]
    assert all(0.125 <= step < 0.125 + 0.9 * 0.5 / 100 + 1e-6 for step in steps)
    assert len(steps) > 3
    torques = values(run.recording.messages["torque"])
    assert torques == pytest.approx([-0.9 * 0.5 * x for x in sent], rel=1e-6)
    assert run.summary.network.payload_bytes == 2 * 4 * len(sent)
    assert run.summary.triggers["/sensor"].count == len(sent)


def test_own_classes_give_the_same_bits_in_any_windows(own: Path) -> None:
    def bits(recording: Recording) -> list[bytes]:
        sent = [m.value.tobytes() + bytes([m.step]) for ms in recording.messages.values() for m in ms]
        return [*sent, *[str(m.tick).encode() for m in recording.messages["x"]]]

    scenario = load(str(own))
    runs = [InProcess(scenario.build(), WindowPolicy(n, n)).run() for n in (1, 7, 512)]
    assert bits(runs[0]) == bits(runs[1]) == bits(runs[2])


def test_own_parameters_are_overridden_and_checked(own: Path) -> None:
    assert load(str(own), overrides=["controller.law.gain=0.25"]).nodes["/controller"]["law"]["gain"] == 0.25
    assert "'distance'?" in message_of(own, "sensor.trigger.distanc=1")
    assert "/wheel.limit_nm: unknown key 'limit_nm'" in message_of(own, "wheel.limit_nm=1")
    assert "/sensor.trigger.distance: found -1" in message_of(own, "sensor.trigger.distance=-1")


def test_own_plant_module_may_stand_anywhere(own: Path, package: Path) -> None:
    # A subclass of the plant module is a plant, too, for the sensor that stands before it in the file.
    (package / "plants.py").write_text(
        "from etac_ros.graph.plant import PlantModule\nclass Mine(PlantModule):\n    pass\n"
    )
    scenario = load(str(own), overrides=[f"spin.module={PACKAGE}.plants:Mine"])
    assert scenario.build().plants == ("/spin",)


def test_own_law_in_a_given_loop(small: Small, package: Path) -> None:
    # A law, here one of etac_ros under another name, beside modules that are not one's own.
    path = small(("etac_ros.laws.wu2018:Proportional", f"{PACKAGE}.law:Mine"))
    (package / "law.py").write_text(
        "from etac_ros.laws.wu2018 import Proportional\nclass Mine(Proportional):\n    pass\n"
    )
    mine = InProcess(load(str(path)).build()).run()
    theirs = InProcess(load(str(small())).build()).run()
    assert mine.samples("/plant")[1].tobytes() == theirs.samples("/plant")[1].tobytes()
    assert np.ptp(mine.samples("/plant")[1][:, 0]) > 0.01


def message_of(path: Path, *overrides: str) -> str:
    with pytest.raises(ScenarioError) as caught:
        load(str(path), overrides=overrides)
    message = str(caught.value)
    assert message.startswith((str(path), "--set"))
    return message


@pytest.mark.parametrize(
    ("law", "parts"),
    [
        ("wrong:NoParameters", ["/controller.law.class: NoParameters has no 'Parameters'", "etac_ros.parameters"]),
        ("wrong:OtherParameters", ["/controller.law.class: OtherParameters has no 'Parameters'", "a subclass of"]),
        ("wrong:NoGrid", ["/controller.law: NoGrid() does not take what it is given", "Parameters, int"]),
        ("wrong:NoSizes", ["/controller.law.class: NoSizes has no 'command_size', 'signal_size'", "law:Law"]),
        ("wrong:Refuses", ["/controller.law: a grid of 10 ticks a second is too coarse"]),
        ("wrong:NOT_A_CLASS", ["/controller.law.class:", "has no class 'NOT_A_CLASS'"]),
        ("wrong:Nothing", ["/controller.law.class:", "has no class 'Nothing'", "NoGrid"]),
        ("broken:Law", ["/controller.law.class:", "cannot be imported (ZeroDivisionError: division by zero)"]),
        ("garbled:Law", ["/controller.law.class:", "cannot be imported (SyntaxError:", "garbled.py, line 1"]),
        ("needs:Law", ["/controller.law.class:", "No module named 'a_package_that_is_not_here'"]),
        ("loop:Distance", ["/controller.law.class: Distance has no 'command'"]),
        ("loop:Itself", ["/controller.law.class: Itself has no 'command'"]),
    ],
)
def test_wrong_law_is_told(law: str, parts: list[str], small: Small) -> None:
    path = small(('{class: "etac_ros.laws.wu2018:Proportional", k: 2.0}', f'{{class: "{PACKAGE}.{law}"}}'))
    message = message_of(path)
    for part in parts:
        assert part in message


@pytest.mark.parametrize(
    ("module", "parts"),
    [
        ("wrong:NoContext", ["/actuator: NoContext() does not take what it is given", "Context"]),
        ("wrong:OddParameters", ["/actuator.module: OddParameters has no 'Parameters'"]),
        ("wrong:NoParameters", [f"/actuator.module: {PACKAGE}.wrong:NoParameters is no module", "module:Module"]),
        ("loop:Wheel", ["/**.links.command.to: /actuator:command takes 1 components", "sends 3"]),
    ],
)
def test_wrong_module_is_told(module: str, parts: list[str], small: Small) -> None:
    message = message_of(small(("module: actuator\n", f"module: {PACKAGE}.{module}\n")))
    for part in parts:
        assert part in message


def test_package_that_is_not_on_the_path(own: Path, package: Path) -> None:
    shutil.rmtree(package)
    message = message_of(own)
    assert f"No module named '{PACKAGE}'" in message
    assert "PYTHONPATH" in message


def test_own_sensor_without_fire_names_itself(own: Path, package: Path) -> None:
    # scan() without fire() is a programming error, found in the run.
    (package / "half.py").write_text(
        "from etac_ros.graph.module import Module\n"
        "class Half(Module):\n"
        "    def __init__(self, context, parameters):\n"
        "        super().__init__(context)\n"
        "        self.outputs = {'x': 1}\n"
        "    def scan(self, window, after):\n"
        "        return after + 1\n"
    )
    text = own.read_text()
    start = text.index("    signal: {class")
    end = text.index("/spin:\n")
    own.write_text(text[:start].replace("module: sensor", f'module: "{PACKAGE}.half:Half"') + text[end:])
    with pytest.raises(BrokenPromise, match=r"/sensor: .*Half names ticks in scan\(\) but has no fire\(\)"):
        InProcess(load(str(own)).build()).run()
