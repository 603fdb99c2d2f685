"""Basilisk: its spacecraft, and sensor, controller and actuator as modules of the user, compiled or in Python.

Its attitudes are MRPs, so the sensor forms q_v of them. Messages are Basilisk's own; s and u go in the one that has
three numbers. A tick is a step of its task, in which the spacecraft moves first, then the modules act.

    basilisk.py DURATION ROUNDS [python]
"""

from __future__ import annotations

import sys
import time

import numpy as np
import workload
from Basilisk.architecture import messaging, sysModel
from Basilisk.architecture.numbaModel import NumbaModel
from Basilisk.simulation import extForceTorque, spacecraft
from Basilisk.utilities import SimulationBaseClass
from workload import BETA, START, H, J, K, command, disturbance, fires, limited

TICK_NS = round(H * 1e9)


class Sensor(NumbaModel):
    def __init__(self):
        super().__init__()
        self.stateInMsg = messaging.SCStatesMsgReader()
        self.signalOutMsg = messaging.CmdTorqueBodyMsg()
        self.memory.held = np.zeros(3)
        self.memory.count = 0

    @staticmethod
    def UpdateStateImpl(CurrentSimNanos, stateInMsgPayload, signalOutMsgPayload, memory):
        sigma, omega = stateInMsgPayload.sigma_BN, stateInMsgPayload.omega_BN_B
        square = sigma[0] ** 2 + sigma[1] ** 2 + sigma[2] ** 2
        s = omega + BETA * 2.0 * sigma / (1.0 + square)
        if memory.count == 0 or fires(s, memory.held):
            memory.count += 1
            memory.held[:] = s
            signalOutMsgPayload.torqueRequestBody[:] = s


class Controller(NumbaModel):
    def __init__(self):
        super().__init__()
        self.signalInMsg = messaging.CmdTorqueBodyMsgReader()
        self.commandOutMsg = messaging.CmdTorqueBodyMsg()

    @staticmethod
    def UpdateStateImpl(CurrentSimNanos, signalInMsgPayload, commandOutMsgPayload):
        commandOutMsgPayload.torqueRequestBody[:] = command(signalInMsgPayload.torqueRequestBody)


class Actuator(NumbaModel):
    def __init__(self):
        super().__init__()
        self.commandInMsg = messaging.CmdTorqueBodyMsgReader()
        self.torqueOutMsg = messaging.CmdTorqueBodyMsg()

    @staticmethod
    def UpdateStateImpl(CurrentSimNanos, commandInMsgPayload, torqueOutMsgPayload):
        d = disturbance(CurrentSimNanos * 1e-9 + 0.5 * H)
        torqueOutMsgPayload.torqueRequestBody[:] = limited(commandInMsgPayload.torqueRequestBody) + d


class PythonSensor(sysModel.SysModel):
    def __init__(self):
        super().__init__()
        self.stateInMsg = messaging.SCStatesMsgReader()
        self.signalOutMsg = messaging.CmdTorqueBodyMsg()
        self.held, self.count = None, 0

    def UpdateState(self, now_ns):
        state = self.stateInMsg()
        sigma, omega = np.array(state.sigma_BN), np.array(state.omega_BN_B)
        s = omega + BETA * 2.0 * sigma / (1.0 + sigma @ sigma)
        if self.held is None or fires(s, self.held):
            self.count += 1
            self.held = s
            payload = messaging.CmdTorqueBodyMsgPayload()
            payload.torqueRequestBody = s.tolist()
            self.signalOutMsg.write(payload, now_ns, self.moduleID)


class PythonController(sysModel.SysModel):
    def __init__(self):
        super().__init__()
        self.signalInMsg = messaging.CmdTorqueBodyMsgReader()
        self.commandOutMsg = messaging.CmdTorqueBodyMsg()

    def UpdateState(self, now_ns):
        if self.signalInMsg.timeWritten() != now_ns:
            return
        payload = messaging.CmdTorqueBodyMsgPayload()
        payload.torqueRequestBody = [-K * value for value in self.signalInMsg().torqueRequestBody]
        self.commandOutMsg.write(payload, now_ns, self.moduleID)


class PythonActuator(sysModel.SysModel):
    def __init__(self):
        super().__init__()
        self.commandInMsg = messaging.CmdTorqueBodyMsgReader()
        self.torqueOutMsg = messaging.CmdTorqueBodyMsg()

    def UpdateState(self, now_ns):
        u = limited(np.array(self.commandInMsg().torqueRequestBody))
        payload = messaging.CmdTorqueBodyMsgPayload()
        payload.torqueRequestBody = (u + disturbance(now_ns * 1e-9 + 0.5 * H)).tolist()
        self.torqueOutMsg.write(payload, now_ns, self.moduleID)


COMPILED = (Sensor, Controller, Actuator)
IN_PYTHON = (PythonSensor, PythonController, PythonActuator)


def run(duration_s: float, modules: tuple[type, ...]) -> tuple[float, int]:
    simulation = SimulationBaseClass.SimBaseClass()
    process = simulation.CreateNewProcess("process")
    process.addTask(simulation.CreateNewTask("task", TICK_NS))
    body, torque = spacecraft.Spacecraft(), extForceTorque.ExtForceTorque()
    body.hub.mHub = 1.0
    body.hub.IHubPntBc_B = J.tolist()
    sigma = START[1:4] / (1.0 + START[0])
    body.hub.sigma_BNInit = [[value] for value in sigma]
    body.hub.omega_BN_BInit = [[value] for value in START[4:7]]
    body.addDynamicEffector(torque)
    sensor, controller, actuator = (kind() for kind in modules)
    sensor.stateInMsg.subscribeTo(body.scStateOutMsg)
    controller.signalInMsg.subscribeTo(sensor.signalOutMsg)
    actuator.commandInMsg.subscribeTo(controller.commandOutMsg)
    torque.cmdTorqueInMsg.subscribeTo(actuator.torqueOutMsg)
    for place, one in enumerate((body, sensor, controller, actuator, torque)):
        one.ModelTag = type(one).__name__
        simulation.AddModelToTask("task", one, 100 - place)
    simulation.InitializeSimulation()
    simulation.ConfigureStopTime(round(duration_s * 1e9))
    began = time.perf_counter()
    simulation.ExecuteSimulation()
    return time.perf_counter() - began, int(sensor.count if isinstance(sensor, PythonSensor) else sensor.memory.count)


if __name__ == "__main__":
    chosen = IN_PYTHON if sys.argv[3:] == ["python"] else COMPILED
    run(10.0, chosen)  # compiles
    workload.report(lambda duration_s: run(duration_s, chosen), "bsk")
