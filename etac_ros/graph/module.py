"""The contract between a module and the time protocol (``docs/timing.md``).

A module is an atomic model on integer ticks: it says at which tick it acts next by itself, it acts, and it takes
what arrives. Everything else - windows, steps, sequence numbers, DDS - is done for it, in both engines alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.plant import Plant
from etac_ros.plants.watch import Watch

Outputs = Mapping[str, FloatArray]
"""What a module sends: a value for an output port. A port that is left out sends nothing."""


@dataclass(frozen=True, slots=True)
class Window:
    """Samples that a plant has computed ahead under its held input, at ticks ``start .. last``."""

    plant: str
    epoch: int
    start: int
    samples: FloatArray

    @property
    def last(self) -> int:
        """Tick of the last sample."""
        return self.start + len(self.samples) - 1

    def at(self, tick: int) -> FloatArray:
        """The sample at a tick."""
        return self.samples[tick - self.start]  # type: ignore[no-any-return]


@dataclass(frozen=True, slots=True)
class Arrival:
    """One message as its receiver sees it."""

    port: str
    link: str
    value: FloatArray


Arrivals = tuple[Arrival, ...]
"""All that arrives at a module in one step, in a fixed order (link, then sequence number)."""


@dataclass(frozen=True)
class Context:
    """What a module is told of its surroundings when it is built."""

    name: str
    ticks_per_second: int
    seed: int
    plant: Plant | None = None
    formats: Mapping[str, WireFormat] = field(default_factory=dict)
    """Wire format of each connected output port ("" is the only port); where none is named, values pass unrounded."""
    incoming: tuple[str, ...] = ()
    """Names of the links that lead to the module, in the order of the graph."""


class Module:
    """An atomic model on integer ticks. Subclasses override what they need.

    A module class is built as ``Class(context, parameters, **components)``: ``parameters`` is an instance of its own
    ``Parameters``, and every name in ``components`` is a key of the scenario that holds an object of a class of its
    own, built as ``ComponentClass(parameters, ticks_per_second)``.

    Attributes
    ----------
    inputs, outputs
        Ports and their sizes, known once the module is built.
    answers
        True for a module that answers each arrivals at once with exactly one message on each connected output, whatever
        the tick, and never acts by itself. Such a module need not report, and a foreign node that merely receives
        and publishes is one.
    passive
        True for a module that never acts by itself but may see a plant: it decides when something arrives. Nobody asks
        it for its next act, so it costs no exchange while nothing arrives.
    timed
        True for a module that answers and needs to know the tick. Over a stamped link the message tells it; otherwise
        it waits for an order.
    triggers
        The output port whose messages are the triggering instants that a run counts; empty where there are none.
    concludes
        True for a module that acts twice at its triggering instant: it fires, and then takes what arrives in the same
        tick, be that nothing. It gets a arrivals in the step after it has fired in any case.
    senses
        True for a module that takes samples inside itself, where others have a sensor and a link: they are counted.
    """

    Parameters: ClassVar[type[Parameters]] = Parameters
    components: ClassVar[tuple[str, ...]] = ()
    answers: ClassVar[bool] = False
    passive: ClassVar[bool] = False
    timed: ClassVar[bool] = False
    triggers: ClassVar[str] = ""
    concludes: ClassVar[bool] = False
    senses: ClassVar[bool] = False

    inputs: dict[str, int]
    outputs: dict[str, int]
    fires_on: tuple[str, ...] | None = None
    """Set by a module that sends one message on each of these output ports, and no others, whenever it fires, and on
    the port ``triggers`` when it concludes alone: so an order to fire needs no report. It has no watches."""
    every: int | None = None
    """Set by a module that acts by itself at exactly the ticks that are multiples of this, sends one message on each
    connected output then, and takes nothing. Nobody needs to ask it, nor to hear from it."""
    halt: str = ""
    """Set by a watch, while it acts, to end the run at this tick: what was found, in words."""

    def __init__(self, context: Context) -> None:
        self.context = context
        self.inputs = {}
        self.outputs = {}

    def wire(self, port: str) -> Wire:
        """Wire of an output port; a value must be rounded by it before it is used on either side."""
        formats = self.context.formats
        return Wire(formats.get(port, formats.get("", WireFormat.EXACT)), self.outputs[port])

    def scan(self, window: Window | None, after: int) -> int | None:
        """First tick after ``after`` at which the module acts by itself. Pure: looking changes nothing.

        Parameters
        ----------
        window
            Samples of the plant that the module reads; None if it reads none. They are not committed yet.
        after
            Only later ticks count.

        Returns
        -------
        int or None
            None if it stays quiet up to the window's end (or, without a plant, for good).
        """
        return None

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """What the module watches, over committed samples from the beginning of a run on."""
        return ()

    def advance(self, tick: int, window: Window) -> None:
        """Commit memory up to and including ``tick``; samples up to there are final."""

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Act by itself at a tick that :meth:`scan` has named."""
        raise NotImplementedError(f"{type(self).__name__} names ticks in scan() but has no fire()")

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Take all that arrives in one step. ``tick`` is None for a module that answers and is not timed."""
        return {}
