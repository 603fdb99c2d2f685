"""A toy system for the time protocol: two ramps whose sensors act at scripted ticks and listen to each other.

What a sensor sends is ``1000 x (messages heard so far) + its ramp``, so every value tells what its sender knew.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.recording import Recording
from etac_ros.graph.role import Acts, Role
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.watch import Watch
from etac_ros.scenario.load import Scenario, load


class RampParameters(Parameters):
    slope: float = 1.0
    bound: float | None = None


class Ramp:
    """x' = slope + input, in units a tick."""

    Parameters = RampParameters
    labels = ("x",)
    inputs = {"push": 1}
    noise_width = 0
    attitude_slice = slice(0, 1)
    rate_slice = slice(0, 1)

    def __init__(self, parameters: RampParameters, ticks_per_second: int) -> None:
        self._slope = parameters.slope
        self._bound = parameters.bound

    def initial_state(self) -> FloatArray:
        return np.zeros(1)

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        samples = np.empty((count, 1))
        x = state[0]
        for i in range(count):
            x = x + self._slope + held[0]
            samples[i, 0] = x
        return samples

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        return states

    def watches(self, states: FloatArray) -> tuple[Watch, ...]:
        return (Watch("ramp", "units", states, ("x",), self._bound),)

    def euler_angles(self, states: FloatArray) -> FloatArray:
        return np.repeat(states, 3, axis=1)

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        return states[:, 0]


class ScriptedParameters(Parameters):
    at: tuple[int, ...] = ()
    echo: bool = False
    above: float | None = None


class Scripted(Module):
    """Acts at scripted ticks, or once its ramp is above a bound that grows with what it has heard."""

    Parameters = ScriptedParameters
    role = Role(triggers="said")

    def __init__(self, context: Context, parameters: ScriptedParameters) -> None:
        super().__init__(context)
        self.inputs = {"heard": 1}
        self.outputs = {"said": 1}
        self._parameters = parameters
        self._heard = 0

    def scan(self, window: Window | None, after: int) -> int | None:
        assert window is not None
        ticks = [tick for tick in self._parameters.at if after < tick <= window.last]
        if self._parameters.above is not None:
            bound = self._parameters.above * (1 + self._heard)
            later = range(max(after + 1, window.start), window.last + 1)
            ticks += [tick for tick in later if window.at(tick)[0] > bound][:1]
        return min(ticks, default=None)

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        return self._say(sample)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        assert tick is not None
        self._heard += len(arrivals)
        return self._say(sample) if self._parameters.echo else {}

    def _say(self, sample: FloatArray | None) -> Outputs:
        assert sample is not None
        return {"said": self.wire("said").rounded(1000.0 * self._heard + sample)}


class Brake(Module):
    """Answers whatever it hears with a push of -0.5."""

    role = Role(Acts.AT_ONCE)

    def __init__(self, context: Context, parameters: Parameters) -> None:
        super().__init__(context)
        self.inputs = {"heard": 1}
        self.outputs = {"push": 1}

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        return {"push": np.array([-0.5])}


def toy(
    folder: Path, sensors: dict[str, dict[str, Any]], duration_ticks: int = 20, media: Any = None, **links: Any
) -> Scenario:
    """Two ramps ``/a/ramp`` and ``/b/ramp`` with sensors that hear each other and brakes that hear their sensor.

    Parameters
    ----------
    folder
        Where the scenario file is written.
    sensors
        Parameters of the sensors of ``a`` and ``b``.
    duration_ticks
        Length of the run at 10 ticks a second.
    media
        Shared media.
    links
        Changes of the links ``a_says`` and ``b_says``.
    """
    sections: dict[str, Any] = {
        "/**": {
            "scenario": "toy",
            "ticks_per_second": 10,
            "duration_s": duration_ticks / 10,
            "seed": 5,
            "links": {},
            **({"media": media} if media else {}),
        }
    }
    for name, other in (("a", "b"), ("b", "a")):
        sections[f"/{name}/ramp"] = {"module": "plant", "dynamics": {"class": "toy:Ramp", "slope": 1.0}}
        sections[f"/{name}/sensor"] = {
            "module": "toy:Scripted", "reads": f"/{name}/ramp", **sensors.get(name, {}),
        }  # fmt: skip
        sections[f"/{name}/brake"] = {"module": "toy:Brake"}
        sections["/**"]["links"][f"{name}_says"] = {
            "from": f"/{name}/sensor",
            "to": [f"/{other}/sensor", f"/{name}/brake"],
            "kind": "network",
            **links.get(f"{name}_says", {}),
        }
        sections["/**"]["links"][f"{name}_push"] = {
            "from": f"/{name}/brake", "to": [f"/{name}/ramp"], "kind": "physical",
        }  # fmt: skip
    path = folder / "toy.yaml"
    path.write_text(yaml.safe_dump({key: {"ros__parameters": body} for key, body in sections.items()}))
    return load(str(path))


def trace(recording: Recording) -> list[str]:
    """Every message as ``tick:step link#number=value``, in time."""
    lines = [
        (message.tick, message.step, link, message.sequence, f"{message.value[0]:g}")
        for link, messages in recording.messages.items()
        for message in messages
    ]
    return [f"{tick}:{step} {link}#{number}={value}" for tick, step, link, number, value in sorted(lines)]
