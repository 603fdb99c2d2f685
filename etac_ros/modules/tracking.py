"""Modules of a formation that tracks: they decide or compute when something arrives, and need to know the time.

The order within a tick comes from the messages themselves: what needs the torque of this tick has it as an input, and
decides when it arrives (``docs/timing.md``). So none of these modules ever acts by itself.
"""

from __future__ import annotations

from enum import StrEnum

import numpy as np
from pydantic import Field

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.laws.law import ModalLaw, RelativeSignal, TickArray, TimedLaw, WatchedLaw
from etac_ros.modules.triggering import Heard
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.rule import TriggerRule

# Rows of a watched law begin with its torque.
_TORQUE, _TORQUE_UNIT = "τ", "N m"


class TimedController(Module):
    """Answers each received signal with the torque of a law that knows the time.

    Parameters
    ----------
    context
        Name, grid, and the wire format of the port ``command``.
    parameters
        None.
    law
        Computes the torque.
    """

    components = ("law",)
    answers = True
    timed = True

    def __init__(self, context: Context, parameters: Parameters, law: TimedLaw) -> None:
        super().__init__(context)
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._law = law
        self._wire = self.wire("command")

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Compute the torque for the newest signal."""
        torque = self._law.torque(_row(arrivals[-1].value), _now(tick))
        return {"command": self._wire.rounded(torque[0])}


class Sends(StrEnum):
    """What a relative sensor transmits at a triggering instant."""

    TORQUE = "torque"
    """The torque of the law, which the sensor module knows."""
    MEASUREMENT = "measurement"
    """All that the law takes; the controller computes the torque."""


class RelativeSensorParameters(Parameters):
    """Parameters of :class:`RelativeSensor` beside its components."""

    sends: Sends = Field(default=Sends.TORQUE, description="torque or measurement")


class _Decision:
    """A trigger rule together with what was last transmitted."""

    def __init__(self, rule: TriggerRule) -> None:
        self._rule = rule
        self._held: FloatArray | None = None
        self._held_tick: int | None = None

    def fires(self, watched: FloatArray, tick: int) -> bool:
        """Whether the rule holds for this one row; the first always fires."""
        return self._held is None or self._rule.first(watched, tick, self._held, self._held_tick) == 0

    def hold(self, torque: FloatArray, tick: int) -> None:
        """Take a torque for transmitted."""
        self._held, self._held_tick = torque, tick


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
    passive = True
    triggers = "signal"
    watched_label = _TORQUE
    watched_unit = _TORQUE_UNIT

    def __init__(
        self,
        context: Context,
        parameters: RelativeSensorParameters,
        measurement: RelativeSignal,
        law: WatchedLaw,
        trigger: TriggerRule,
    ) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("a relative sensor needs a plant to read")
        self.measurement = measurement
        self.law = law
        self.trigger = trigger
        self.inputs = {"torque": 3}
        self.outputs = {"signal": law.command_size if parameters.sends is Sends.TORQUE else measurement.size}
        self._sends = parameters.sends
        self._wire = self.wire("signal")
        self._decision = _Decision(trigger)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Measure with the torque that has just arrived, and transmit if the rule holds."""
        assert tick is not None
        assert sample is not None
        measured = self.measurement.evaluate(_row(sample), _row(arrivals[-1].value), _now(tick))
        watched = self.law.watched(measured, _now(tick))
        if not self._decision.fires(watched, tick):
            return {}
        chosen = watched[0, : self._wire.size] if self._sends is Sends.TORQUE else measured[0]
        sent = self._wire.rounded(chosen)
        self._decision.hold(self.held_by(sent, tick), tick)
        return {"signal": sent}

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
        return value if self._sends is Sends.TORQUE else self.law.torque(_row(value), _now(tick))[0]


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
    passive = True
    triggers = "command"
    watched_label = _TORQUE
    watched_unit = _TORQUE_UNIT

    def __init__(self, context: Context, parameters: Parameters, law: WatchedLaw, trigger: TriggerRule) -> None:
        super().__init__(context)
        self.trigger = trigger
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._law = law
        self._wire = self.wire("command")
        self._decision = _Decision(trigger)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Send the torque on if the rule holds."""
        assert tick is not None
        watched = self._law.watched(_row(arrivals[-1].value), _now(tick))
        if not self._decision.fires(watched, tick):
            return {}
        held = self._wire.rounded(watched[0, : self._wire.size])
        self._decision.hold(held, tick)
        return {"command": held}

    def watched(self, window: Window | None, heard: Heard) -> FloatArray | None:
        """What the trigger rule is shown at each tick, if something arrives at each."""
        last = max(heard, default=-1)
        signals = _newest(heard, 0, last)
        return None if signals is None else self._law.watched(signals, np.arange(last + 1, dtype=np.int64))

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """The torque that is held after a message: its value."""
        return value


class ModalControllerParameters(Parameters):
    """Parameters of :class:`ModalController` beside its law."""

    first_mode: int = Field(ge=0, description="column of the plant's state where the modes begin")
    modes: int = Field(gt=0, description="columns: coordinates, then rates")


class ModalController(Module):
    """A controller whose law takes the modes of the flexible plant as known: an idealised baseline.

    Parameters
    ----------
    context
        The plant, and the wire format of the port ``command``.
    parameters
        Where the modes stand in the plant's state.
    law
        Computes the torque.
    """

    Parameters = ModalControllerParameters
    components = ("law",)
    passive = True
    triggers = "command"

    def __init__(self, context: Context, parameters: ModalControllerParameters, law: ModalLaw) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("this controller needs a plant whose modes it reads")
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._law = law
        self._wire = self.wire("command")
        self._modes = slice(parameters.first_mode, parameters.first_mode + parameters.modes)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Compute the torque for the newest signal."""
        assert sample is not None
        torque = self._law.torque(_row(arrivals[-1].value), _row(sample[self._modes]), _now(tick))
        return {"command": self._wire.rounded(torque[0])}


def _row(values: FloatArray) -> FloatArray:
    """One sample as a contiguous array of one row: laws have one formula for windows and for single samples."""
    return np.ascontiguousarray(values[np.newaxis, :])


def _newest(heard: Heard, first: int, last: int) -> FloatArray | None:
    """The newest value of each tick, a row each; None where there is a tick without one."""
    if last < first or any(tick not in heard for tick in range(first, last + 1)):
        return None
    return np.array([heard[tick][-1].value for tick in range(first, last + 1)])


def _now(tick: int | None) -> TickArray:
    if tick is None:
        raise ValueError("this module needs to know the tick, and nobody has told it")
    return np.array([tick], dtype=np.int64)
