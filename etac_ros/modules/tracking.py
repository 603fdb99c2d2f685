"""Modules of a formation that tracks: they decide or compute when something arrives, and need to know the time.

The order within a tick comes from the messages themselves: what needs the torque of this tick has it as an input, and
decides when it arrives (``docs/timing.md``). So none of these modules ever acts by itself.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from pydantic import Field

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.promises import Component, check_state_size
from etac_ros.graph.role import Acts, Role
from etac_ros.laws.law import RelativeSignal, TickArray, WatchedLaw
from etac_ros.maths.finite import all_finite
from etac_ros.modules.hold import Hold
from etac_ros.modules.triggering import Heard
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.rule import AnyRule

# Rows of a watched law begin with its torque.
_TORQUE, _TORQUE_UNIT = "τ", "N m"


class Sends(StrEnum):
    """What a relative sensor transmits at a triggering instant."""

    TORQUE = "torque"
    """The torque of the law, which the sensor module knows."""
    MEASUREMENT = "measurement"
    """All that the law takes; the controller computes the torque."""


class RelativeSensorParameters(Parameters):
    """Parameters of :class:`RelativeSensor` beside its components."""

    sends: Sends = Field(default=Sends.TORQUE, description="torque or measurement")


class RelativeSensor(Module):
    """The non-contact sensor between two modules, with the trigger mechanism of the follower's law.

    It decides when the leader's torque of this tick arrives, since its measurement contains that torque.

    Parameters
    ----------
    context
        Its plant, and the wire format of the port ``signal``.
    parameters
        What is sent.
    measurement
        What is formed from the sample and the leader's torque.
    law
        The follower's law, known here so that the trigger can watch it.
    trigger
        When something is sent.
    """

    Parameters = RelativeSensorParameters
    components = ("measurement", "law", "trigger")
    role = Role(Acts.ON_ARRIVAL, triggers="signal")
    hears_acknowledgements = True
    watched_label = _TORQUE
    watched_unit = _TORQUE_UNIT

    def __init__(
        self,
        context: Context,
        parameters: RelativeSensorParameters,
        measurement: RelativeSignal,
        law: WatchedLaw,
        trigger: AnyRule,
    ) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("a relative sensor needs a plant to read")
        check_state_size(measurement, context.plant)
        if law.signal_size != measurement.size:
            raise ValueError(
                f"{type(law).__name__} takes {law.signal_size} components, "
                f"and {type(measurement).__name__} has {measurement.size}"
            )
        self.measurement = measurement
        self.law = law
        self.trigger = trigger
        self.inputs = {"torque": 3}
        self.outputs = {"signal": law.command_size if parameters.sends is Sends.TORQUE else measurement.size}
        self._sends = parameters.sends
        self._measures = Component(context.name, measurement)
        self._watches = Component(context.name, law)
        self.hold = Hold(self, "signal", trigger)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Measure with the torque that has just arrived, and transmit if the rule holds."""
        assert tick is not None
        assert sample is not None
        ticks = np.array([tick], dtype=np.int64)
        torque = _row(arrivals[-1].value)
        measured = self._measures.rows(1, self.measurement.size, "evaluate", _row(sample), torque, ticks)
        watched = _watched(self._watches, measured, ticks)
        if not self.hold.decides(watched, tick):
            return {}
        if self._sends is Sends.TORQUE:
            return {"signal": self.hold.send(watched[0, : self.law.command_size], tick)}
        # The rule compares with what the follower makes of it: the law on what comes off the wire.
        sent = self.wire("signal").rounded(measured[0])
        return {"signal": self.hold.send(sent, tick, compared=self.held_by(sent, tick))}

    def settle(self, port: str, tick: int, acknowledged: bool) -> None:
        """Go by what was acknowledged."""
        self.hold.settle(tick, acknowledged)

    def watched(self, window: Window | None, heard: Heard) -> FloatArray | None:
        """What the trigger rule is shown of each sample with the leader's torque of the same tick."""
        assert window is not None
        torques = _newest(heard, window.start, window.last)
        if torques is None:
            return None
        ticks = np.arange(window.start, window.last + 1, dtype=np.int64)
        measured = self.measurement.evaluate(np.ascontiguousarray(window.samples), torques, ticks)
        return self.law.watched(measured, ticks)

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """The torque that the follower holds after a message: its value, or the law on what came off the wire."""
        return (
            value
            if self._sends is Sends.TORQUE
            else self._watches.vector(self.law.command_size, "command", value, tick)
        )


class TriggeredController(Module):
    """A controller with the trigger mechanism on its side: it gets every sample and sends what has to change.

    Parameters
    ----------
    context
        Name, grid, and the wire format of the port ``command``.
    parameters
        None.
    law
        Computes the torque, and what the trigger watches.
    trigger
        When the torque is sent on.
    """

    components = ("law", "trigger")
    role = Role(Acts.ON_ARRIVAL, triggers="command")
    hears_acknowledgements = True
    watched_label = _TORQUE
    watched_unit = _TORQUE_UNIT

    def __init__(self, context: Context, parameters: Parameters, law: WatchedLaw, trigger: AnyRule) -> None:
        super().__init__(context)
        self.trigger = trigger
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._law = law
        self._watches = Component(context.name, law)
        self.hold = Hold(self, "command", trigger)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Send the torque on if the rule holds."""
        assert tick is not None
        watched = _watched(self._watches, _row(arrivals[-1].value), np.array([tick], dtype=np.int64))
        if not self.hold.decides(watched, tick):
            return {}
        return {"command": self.hold.send(watched[0, : self._law.command_size], tick)}

    def settle(self, port: str, tick: int, acknowledged: bool) -> None:
        """Go by what was acknowledged."""
        self.hold.settle(tick, acknowledged)

    def watched(self, window: Window | None, heard: Heard) -> FloatArray | None:
        """What the trigger rule is shown at each tick, if something arrives at each."""
        last = max(heard, default=-1)
        signals = _newest(heard, 0, last)
        return None if signals is None else self._law.watched(signals, np.arange(last + 1, dtype=np.int64))

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """The torque that is held after a message: its value."""
        return value


def _row(values: FloatArray) -> FloatArray:
    """One sample as a contiguous array of one row: laws have one formula for windows and for single samples."""
    return np.ascontiguousarray(values[np.newaxis, :])


def _newest(heard: Heard, first: int, last: int) -> FloatArray | None:
    """The newest value of each tick, a row each; None where there is a tick without one."""
    if last < first or any(tick not in heard for tick in range(first, last + 1)):
        return None
    return np.array([heard[tick][-1].value for tick in range(first, last + 1)])


def _watched(law: Component, measured: FloatArray, ticks: TickArray) -> FloatArray:
    """What a law shows the trigger rule of one sample; finite, since that sample is certain."""
    found = law.call("watched", measured, ticks)
    width = found.shape[1] if isinstance(found, np.ndarray) and found.ndim == 2 else -1
    watched = law.array((1, width), "watched", found)
    if not all_finite(watched) and all_finite(measured):
        raise law.broken("watched", f"gives {watched[0].tolist()} for finite arguments", "finite numbers")
    return watched
