"""The sensor module of one spacecraft of a formation: it knows its neighbours by what they broadcast.

Triggering instants are decided on what was known before this tick's messages. Who fires broadcasts, and then forms its
signal with the messages of this very tick in it (xie2021, remark 3: it "broadcasts ... and obtains"): the module is one
that concludes (see :class:`~etac_ros.graph.module.Module`).
"""

from __future__ import annotations

from enum import StrEnum
from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import Field, NonNegativeInt

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.promises import Component, check_state_size, first_broken
from etac_ros.graph.role import Role
from etac_ros.laws.law import TickArray
from etac_ros.modules.hold import Hold
from etac_ros.modules.triggering import Heard
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.triggers.rule import AnyRule

_REQUEST = np.array([1.0])


class NeighbourSignal(Protocol):
    """A signal that the neighbours' states are part of."""

    Parameters: ClassVar[type[Parameters]]
    size: int
    """Number of components."""
    broadcast_size: int
    """Components of what the neighbours are told."""
    neighbours: int
    """How many neighbours are listened to."""
    label: str
    """Symbol in the paper, for plots."""

    def broadcast(self, states: FloatArray) -> FloatArray:
        """What the neighbours are told of each state, shape (n, broadcast_size)."""
        ...

    def evaluate(
        self, states: FloatArray, tick: int, known: FloatArray, known_ticks: TickArray, heard: npt.NDArray[np.bool_]
    ) -> FloatArray:
        """Signal of the states at ``tick, tick + 1, ...`` with what is known of the neighbours, shape (n, size)."""
        ...


class Exchange(StrEnum):
    """When the neighbours' states are exchanged."""

    BROADCAST = "broadcast"
    """Each spacecraft broadcasts its own at its own triggering instants."""
    CONTINUOUS = "continuous"
    """At every tick: an idealisation, which costs a message a tick."""
    PULL = "pull"
    """As broadcast; besides, who triggers asks its neighbours, and they reply to it alone."""


class RenewedBy(StrEnum):
    """Whose triggering instants renew the torque of a spacecraft."""

    OWN = "own"
    """Its own alone (xie2021, remark 3)."""
    NEIGHBOURS = "neighbours"
    """Also those of the neighbours that it hears (as in reference [18] of xie2021): the signal goes to the controller
    on the port ``renewal``. That is no triggering instant, and the rule goes on comparing with what its own brought."""


class FormationSensorParameters(Parameters):
    """Parameters of :class:`FormationSensor` beside its signal and its trigger rule."""

    neighbours: tuple[str, ...] = Field(default=(), description="names of the input ports, in the order of the weights")
    listeners: tuple[str, ...] = Field(default=(), description="who may ask; only where states are pulled")
    exchange: Exchange = Exchange.BROADCAST
    renewed_by: RenewedBy = Field(default=RenewedBy.OWN, description="own or neighbours")
    reply_within_ticks: NonNegativeInt = Field(default=0, description="how long a reply is waited for")


class FormationSensor(Module):
    """Measures, listens, triggers, broadcasts, and hands its controller the signal.

    Parameters
    ----------
    context
        Its plant, and the wire formats.
    parameters
        Who is heard, who listens, and how states are exchanged.
    signal
        What is formed of the own state and the neighbours'.
    trigger
        When it fires; the first sample always does.
    """

    Parameters = FormationSensorParameters
    components = ("signal", "trigger")
    role = Role(triggers="feedback", concludes=True)

    def __init__(
        self, context: Context, parameters: FormationSensorParameters, signal: NeighbourSignal, trigger: AnyRule
    ) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("a formation's sensor needs a plant, named by the key 'reads'")
        check_state_size(signal, context.plant)
        if len(parameters.neighbours) != signal.neighbours:
            raise ValueError(
                f"the signal has weights for {signal.neighbours} neighbours, and {len(parameters.neighbours)} are named"
            )
        self.signal = signal
        self.trigger = trigger
        self._own = parameters
        self._pulls = parameters.exchange is Exchange.PULL
        self._renews = parameters.renewed_by is RenewedBy.NEIGHBOURS
        if self._renews and parameters.exchange is not Exchange.BROADCAST:
            raise ValueError(
                f"renewed_by: neighbours goes with exchange: broadcast, and the exchange is {parameters.exchange}"
            )
        size = signal.broadcast_size
        self.inputs = dict.fromkeys(parameters.neighbours, size)
        self.outputs = {"state": size, "feedback": signal.size}
        if self._renews:
            self.outputs["renewal"] = signal.size
        self._places = {name: place for place, name in enumerate(parameters.neighbours)}
        if self._pulls:
            self.inputs |= {f"reply_{name}": size for name in parameters.neighbours}
            self.inputs |= {f"asked_{name}": _REQUEST.size for name in parameters.listeners}
            self.outputs |= {f"reply_{name}": size for name in parameters.listeners}
            self.outputs["request"] = _REQUEST.size
            self._places |= {f"reply_{name}": place for place, name in enumerate(parameters.neighbours)}
        if parameters.exchange is Exchange.BROADCAST:
            self.role = Role(triggers="feedback", concludes=True, fires_on=("state",))
        self._known: FloatArray = np.zeros((signal.neighbours, size))
        self._known_ticks: TickArray = np.zeros(signal.neighbours, dtype=np.int64)
        self._heard = np.zeros(signal.neighbours, dtype=np.bool_)
        self._component = Component(context.name, signal)
        self.hold = Hold(self, "feedback", trigger)
        self._advanced = -1
        self._fired_at: int | None = None
        self._waits = False

    def scan(self, window: Window | None, after: int) -> int | None:
        """First tick at which the trigger rule holds, or at which no reply is waited for any more."""
        assert window is not None
        if after >= window.last:
            return None
        if self._own.exchange is Exchange.CONTINUOUS:
            return after + 1
        if self._waits:
            assert self._fired_at is not None
            until = max(after, self._fired_at + self._own.reply_within_ticks) + 1
            return until if until <= window.last else None
        return self._first(window.samples[after + 1 - window.start :], after + 1)

    def advance(self, tick: int, window: Window) -> None:
        """Tell a rule with memory what it has seen: with what was known before this tick's messages."""
        if self.hold.has_memory:
            first = max(self._advanced + 1, window.start)
            samples = window.samples[first - window.start : tick + 1 - window.start]
            self.hold.advance(self._signals(samples, first), first)
        self._advanced = tick

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Tell the neighbours, and ask them if states are pulled; the signal follows within the tick."""
        assert sample is not None
        row = np.ascontiguousarray(sample[np.newaxis, :])
        if self._waits:  # for replies that were lost
            return {"feedback": self._form(tick, row)}
        outputs = {"state": self._broadcast(row)}
        if self._own.exchange is Exchange.CONTINUOUS and self._first(row, tick) is None:
            return outputs
        self._fired_at = tick
        self._waits = True
        if self._pulls:
            outputs["request"] = _REQUEST
        return outputs

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Take in what the neighbours say, reply to who asks, and conclude a triggering instant."""
        assert tick is not None
        assert sample is not None
        row = np.ascontiguousarray(sample[np.newaxis, :])
        outputs: dict[str, FloatArray] = {}
        replied = False
        for arrival in arrivals:
            if arrival.port in self._places:
                place = self._places[arrival.port]
                self._known[place] = arrival.value
                self._known_ticks[place] = tick
                self._heard[place] = True
                replied |= arrival.port.startswith("reply_")
            else:
                port = arrival.port.replace("asked_", "reply_", 1)
                outputs[port] = self._broadcast(row)
        if self._waits and (replied or not self._pulls or not self._places):
            outputs["feedback"] = self._form(tick, row)
        elif self._renews and self.hold.sent is not None and arrivals:
            outputs["renewal"] = self.wire("renewal").rounded(self._signals(row, tick)[0])
        return outputs

    @property
    def watched_label(self) -> str:
        """Symbols of the signal."""
        return self.signal.label

    @property
    def watched_unit(self) -> str:
        """Units of the signal; empty where it does not say."""
        return str(getattr(self.signal, "unit", ""))

    def watched(self, window: Window | None, heard: Heard) -> FloatArray:
        """What the trigger rule is shown of each sample: the signal with what was known before the tick's messages."""
        assert window is not None
        known, ticks, ever = np.zeros_like(self._known), np.zeros_like(self._known_ticks), np.zeros_like(self._heard)
        parts, start = [], window.start
        for tick in [*(tick for tick in sorted(heard) if tick < window.last), window.last]:
            samples = np.ascontiguousarray(window.samples[start - window.start : tick + 1 - window.start])
            parts.append(self.signal.evaluate(samples, start, known, ticks, ever))
            start = tick + 1
            for arrival in heard.get(tick, ()):
                if arrival.port in self._places:
                    place = self._places[arrival.port]
                    known[place], ticks[place], ever[place] = arrival.value, tick, True
        return np.concatenate(parts)

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """What the trigger rule compares with after a message: its value."""
        return value

    def _broadcast(self, row: FloatArray) -> FloatArray:
        told: FloatArray = self._component.rows(1, self.signal.broadcast_size, "broadcast", row)[0]
        return told

    def _form(self, tick: int, row: FloatArray) -> FloatArray:
        """Form the signal with all that is known now; the trigger rule compares with it from now on."""
        self._waits = False
        formed = self._signals(row, tick)[0]
        if first_broken(formed[np.newaxis], row) is not None:
            found = f"gives {formed.tolist()} at tick {tick} for finite arguments"
            raise self._component.broken("evaluate", found, "finite numbers")
        return self.hold.send(formed, tick)

    def _first(self, samples: FloatArray, tick: int) -> int | None:
        signals = self._signals(samples, tick)
        fires = self.hold.first(signals, tick)
        broken = first_broken(signals, samples)
        return fires if broken is None else min(tick + broken, tick + broken if fires is None else fires)

    def _signals(self, samples: FloatArray, tick: int) -> FloatArray:
        contiguous = np.ascontiguousarray(samples)
        told = (tick, self._known, self._known_ticks, self._heard)
        return self._component.rows(len(samples), self.signal.size, "evaluate", contiguous, *told)
