"""drake: plant, sensor, controller and actuator as systems of the user in Python, updated at the ticks."""

from __future__ import annotations

import time

import numpy as np
import workload
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder, LeafSystem
from workload import START, TICKS_PER_SECOND, H, command, fires, limited, rk4, signal


class Plant(LeafSystem):
    def __init__(self):
        super().__init__()
        self._torque = self.DeclareVectorInputPort("torque", 3)
        self._state = self.DeclareDiscreteState(START)
        self.DeclarePeriodicDiscreteUpdateEvent(H, 0.0, self._advance)
        self.DeclareStateOutputPort("state", self._state)

    def _advance(self, context, found):
        x, u = context.get_discrete_state(self._state).value(), self._torque.Eval(context)
        found.set_value(self._state, rk4(x, u, round(context.get_time() * TICKS_PER_SECOND)))


class Sensor(LeafSystem):
    """Its state: the value that was sent last, and how many were."""

    def __init__(self):
        super().__init__()
        self._seen = self.DeclareVectorInputPort("state", START.size)
        self._held = self.DeclareDiscreteState(4)
        self.DeclarePeriodicDiscreteUpdateEvent(H, 0.0, self._advance)
        self.DeclareVectorOutputPort("signal", 3, self._sent)

    def _decided(self, context):
        held, s = context.get_discrete_state(self._held).value(), signal(self._seen.Eval(context))
        if held[3] == 0 or fires(s, held[0:3]):
            return np.append(s, held[3] + 1)
        return held

    def _sent(self, context, out):
        out.SetFromVector(self._decided(context)[0:3])

    def _advance(self, context, found):
        found.set_value(self._held, self._decided(context))

    def count(self, context):
        return round(context.get_discrete_state(self._held).value()[3])


class Controller(LeafSystem):
    def __init__(self):
        super().__init__()
        self._signal = self.DeclareVectorInputPort("signal", 3)
        self.DeclareVectorOutputPort("command", 3, self._command)

    def _command(self, context, out):
        out.SetFromVector(command(self._signal.Eval(context)))


class Actuator(LeafSystem):
    def __init__(self):
        super().__init__()
        self._command = self.DeclareVectorInputPort("command", 3)
        self.DeclareVectorOutputPort("torque", 3, self._torque)

    def _torque(self, context, out):
        out.SetFromVector(limited(self._command.Eval(context)))


def run(duration_s: float) -> tuple[float, int]:
    builder = DiagramBuilder()
    plant, sensor, controller, actuator = (builder.AddSystem(kind()) for kind in (Plant, Sensor, Controller, Actuator))
    for source, sink in ((plant, sensor), (sensor, controller), (controller, actuator), (actuator, plant)):
        builder.Connect(source.get_output_port(), sink.get_input_port())
    simulator = Simulator(builder.Build())
    simulator.Initialize()
    began = time.perf_counter()
    simulator.AdvanceTo(duration_s)
    took = time.perf_counter() - began
    return took, sensor.count(sensor.GetMyContextFromRoot(simulator.get_context()))


if __name__ == "__main__":
    run(10.0)
    workload.report(run, "drake")
