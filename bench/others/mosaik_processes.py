"""mosaik: plant, sensor, controller and actuator as simulators in a process each, connected over its sockets.

The plant and the sensor step once a tick; controller and actuator are event-based and step when something comes. What
the actuator gives reaches the plant's next step, which moves the body by a tick under it.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import mosaik
import mosaik_api_v3
import numpy as np
import workload
from workload import START, H, command, fires, limited, rk4, signal


def meta(kind, keeps):
    """How a simulator steps, and whether what it gives stands until it gives something else."""
    model = {"public": True, "params": [], "attrs": ["in", "out"]}
    if kind == "hybrid":
        model |= {"trigger": ["in"], "non-persistent": [] if keeps else ["out"]}
    return {"api_version": "3.0", "type": kind, "models": {"Model": model}}


class Part(mosaik_api_v3.Simulator):
    kind, keeps = "event-based", False

    def __init__(self):
        super().__init__(meta(self.kind, self.keeps))
        self.value, self.now = None, -1

    def init(self, sid, time_resolution, **parameters):
        return self.meta

    def create(self, num, model):
        return [{"eid": "one", "type": model}]

    def heard(self, inputs):
        for values in inputs.get("one", {}).get("in", {}).values():
            return np.array(values)
        return None

    def get_data(self, outputs):
        return {} if self.value is None else {"one": {"out": self.value.tolist()}, "time": self.now}

    def step(self, now, inputs, max_advance):
        self.now, self.value = now, self.act(now, self.heard(inputs))
        return now + 1 if self.kind == "time-based" else None


class Plant(Part):
    kind, keeps = "time-based", True

    def __init__(self):
        super().__init__()
        self.x = START.copy()

    def act(self, now, u):
        if now > 0:
            self.x = rk4(self.x, u, now - 1)
        return self.x

    def get_data(self, outputs):
        return {"one": {"out": self.value.tolist()}}


class Sensor(Part):
    """Leaves the count of its instants in a file, when it is told to end."""

    kind = "hybrid"

    def __init__(self):
        super().__init__()
        self.held, self.count = None, 0

    def act(self, now, x):
        s = signal(x)
        if self.held is not None and not fires(s, self.held):
            return None
        self.held, self.count = s, self.count + 1
        return s

    def finalize(self):
        Path(os.environ["ANCHOR_COUNT"]).write_text(str(self.count), encoding="utf-8")


class Controller(Part):
    def act(self, now, s):
        return command(s)


class Actuator(Part):
    """Its output is held: the plant reads what it was given last."""

    kind, keeps = "hybrid", True

    def act(self, now, u):
        return np.zeros(3) if u is None else limited(u)


KINDS = {kind.__name__: kind for kind in (Plant, Sensor, Controller, Actuator)}


def run(duration_s: float) -> tuple[float, int]:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        os.environ["ANCHOR_COUNT"] = str(Path(folder, "count"))
        command_line = f"{sys.executable} {Path(__file__).resolve()} --part"
        programs = {name: {"cmd": f"{command_line} {name} %(addr)s", "cwd": folder} for name in KINDS}
        with mosaik.World(programs, mosaik_config={"addr": ("127.0.0.1", None)}, skip_greetings=True) as world:
            parts = {name: world.start(name).Model.create(1)[0] for name in KINDS}
            for source, sink in (("Plant", "Sensor"), ("Sensor", "Controller"), ("Controller", "Actuator")):
                world.connect(parts[source], parts[sink], ("out", "in"))
            world.connect(
                parts["Actuator"], parts["Plant"], ("out", "in"), time_shifted=True, initial_data={"out": [0.0] * 3}
            )
            began = time.perf_counter()
            world.run(until=round(duration_s / H) + 1, print_progress=False)
            took = time.perf_counter() - began
        return took, int(Path(folder, "count").read_text(encoding="utf-8"))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--part"]:
        name = sys.argv.pop(2)
        sys.argv.pop(1)
        mosaik_api_v3.start_simulation(KINDS[name](), name)
    else:
        workload.report(run, "mosaik")
