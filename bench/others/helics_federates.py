"""HELICS: plant, sensor, controller and actuator as federates, a process each, over its tcp core.

Plant and sensor are granted every tick, the sensor half a tick after the plant; controller and actuator when something
comes. So a value goes all the way round within the tick, and only what changes is published.
"""

from __future__ import annotations

import itertools
import multiprocessing
import sys
import time

import helics
import numpy as np
import workload
from workload import START, H, command, fires, limited, rk4, signal

ORDER = ("plant", "sensor", "controller", "actuator")


class Plant:
    """Published once a tick; the others when they have something new."""

    def __init__(self):
        self.x, self.u, self.tick = START.copy(), np.zeros(3), -1

    def act(self, value):
        if value is not None:
            self.u = value
        if self.tick >= 0:
            self.x = rk4(self.x, self.u, self.tick)
        self.tick += 1
        return self.x


class Sensor:
    def __init__(self):
        self.held, self.count = None, 0

    def act(self, value):
        s = signal(value)
        if self.held is not None and not fires(s, self.held):
            return None
        self.held, self.count = s, self.count + 1
        return s


class Controller:
    count = 0

    def act(self, value):
        return None if value is None else command(value)


class Actuator:
    count = 0

    def act(self, value):
        return None if value is None else limited(value)


KINDS = dict(zip(ORDER, (Plant, Sensor, Controller, Actuator), strict=True))


OFFSETS = {"plant": 0.0, "sensor": H / 2.0}
"""Of those who are granted every tick [s]."""


def instants(name, ticks):
    """The times [s] that a federate asks for."""
    if name in OFFSETS:
        return (tick * H + OFFSETS[name] for tick in range(ticks + 1))
    return itertools.repeat(helics.HELICS_TIME_MAXTIME)


def federate(name, port, ticks, outcome):
    place = ORDER.index(name)
    info = helics.helicsCreateFederateInfo()
    helics.helicsFederateInfoSetCoreName(info, f"core_{name}")
    helics.helicsFederateInfoSetCoreTypeFromString(info, "tcp")
    helics.helicsFederateInfoSetCoreInitString(info, f"--federates=1 --brokerport={port}")
    if name in OFFSETS:
        helics.helicsFederateInfoSetTimeProperty(info, helics.helics_property_time_period, H)
        helics.helicsFederateInfoSetTimeProperty(info, helics.helics_property_time_offset, OFFSETS[name])
        helics.helicsFederateInfoSetFlagOption(info, helics.helics_flag_uninterruptible, True)
    own = helics.helicsCreateValueFederate(name, info)
    out = helics.helicsFederateRegisterGlobalPublication(own, f"out_{name}", helics.helics_data_type_vector, "")
    heard = helics.helicsFederateRegisterSubscription(own, f"out_{ORDER[place - 1]}", "")
    acting = KINDS[name]()
    helics.helicsFederateEnterExecutingMode(own)
    began = time.perf_counter()
    for due in instants(name, ticks):
        if due > 0.0 and helics.helicsFederateRequestTime(own, due) >= helics.HELICS_TIME_MAXTIME:
            break  # nobody is left who could send anything
        new = helics.helicsInputIsUpdated(heard)
        value = acting.act(np.array(helics.helicsInputGetVector(heard)) if new else None)
        if value is not None:
            helics.helicsPublicationPublishVector(out, value.tolist())
    if name in ("plant", "sensor"):
        outcome.put((name, time.perf_counter() - began, getattr(acting, "count", 0)))
    helics.helicsFederateDisconnect(own)
    helics.helicsFederateFree(own)
    helics.helicsCloseLibrary()


def run(duration_s: float) -> tuple[float, int]:
    port = next(PORTS)
    broker = helics.helicsCreateBroker("tcp", f"broker_{port}", f"-f {len(ORDER)} --port={port}")
    spawn = multiprocessing.get_context("spawn")
    outcome = spawn.Queue()
    arguments = (port, round(duration_s / H), outcome)
    players = [spawn.Process(target=federate, args=(name, *arguments), daemon=True) for name in ORDER]
    for player in players:
        player.start()
    found = {name: (took, count) for name, took, count in (outcome.get() for _ in range(2))}
    for player in players:
        player.join()
    helics.helicsBrokerDisconnect(broker)
    return found["plant"][0], found["sensor"][1]


PORTS = itertools.count(23500 + 10 * (hash(sys.argv[0]) % 100), 40)
if __name__ == "__main__":
    workload.report(run, "helics")
