"""The contract between a module and the time protocol (``docs/timing.md``).

A module is an atomic model on integer ticks: it says at which tick it acts next by itself, it acts, and it takes
what arrives. Everything else - windows, steps, sequence numbers, DDS - is done for it, in both engines alike.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

from etac_ros.errors import ProtocolError
from etac_ros.graph.role import Acts, Role
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.maths.rk4 import Stop
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.plant import Plant
from etac_ros.plants.watch import Watch

_IN_ROLE = ("answers", "passive", "timed", "triggers", "concludes", "senses", "fires_on", "every")

Outputs = Mapping[str, FloatArray]
"""What a module sends: a value for an output port. A port that is left out sends nothing."""


class Window(NamedTuple):
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
        """The sample at a tick.

        Raises
        ------
        ProtocolError
            If the window does not hold it.
        """
        if not self.start <= tick <= self.last:
            raise ProtocolError(
                f"window of {self.plant}",
                f"the sample of tick {tick} was asked for",
                f"a tick from {self.start} to {self.last}",
            )
        return self.samples[tick - self.start]  # type: ignore[no-any-return]


class Arrival(NamedTuple):
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
    acknowledged: frozenset[str] = frozenset()
    """Output ports ("" is the only port) whose messages are acknowledged, and of which the module is told."""
    down: tuple[tuple[int, int], ...] = ()
    """Ticks ``(from, until)`` of its faults, ``until`` excluded: for who replays what it did."""


class Module:
    """An atomic model on integer ticks. Subclasses override what they need.

    A module class is built as ``Class(context, parameters, **components)``: ``parameters`` is an instance of its own
    ``Parameters``, and every name in ``components`` is a key of the scenario that holds an object of a class of its
    own, built as ``ComponentClass(parameters, ticks_per_second)``.

    Attributes
    ----------
    inputs, outputs
        Ports and their sizes, known once the module is built.
    role
        When the module acts, and what others may rely on without asking. A class says it once; a module whose role
        depends on its parameters sets its own when it is built.
    """

    Parameters: ClassVar[type[Parameters]] = Parameters
    components: ClassVar[tuple[str, ...]] = ()
    role: Role = Role()

    inputs: dict[str, int]
    outputs: dict[str, int]
    hears_acknowledgements: bool = False
    """Whether it goes by what was acknowledged of its messages (:meth:`settle`), where they are."""
    stops: bool = False
    """Whether it can tell where a window may end (:meth:`stop`)."""
    hold_ticks: int | None = None
    """Ticks after which what it was told last expires, and it acts by itself; None for never."""
    halt: str = ""
    """Set by a watch, while it acts, to end the run at this tick: what was found, in words."""

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        for name in _IN_ROLE:
            if name in vars(cls):
                raise TypeError(f"{cls.__name__}.{name} is part of the role of a module: role = Role({name}=...)")

    def __init__(self, context: Context) -> None:
        self.context = context
        self.inputs = {}
        self.outputs = {}

    @property
    def answers(self) -> bool:
        """Whether it answers at once, and never acts by itself."""
        return self.role.acts is Acts.AT_ONCE

    @property
    def passive(self) -> bool:
        """Whether it decides when something arrives, and never acts by itself."""
        return self.role.acts is Acts.ON_ARRIVAL

    @property
    def timed(self) -> bool:
        """Whether it answers at once and needs to know the tick."""
        return self.role.timed

    @property
    def triggers(self) -> str:
        """The output port whose messages are triggering instants; empty where there are none."""
        return self.role.triggers

    @property
    def concludes(self) -> bool:
        """Whether it takes what arrives in the step after it has fired."""
        return self.role.concludes

    @property
    def senses(self) -> bool:
        """Whether it takes samples inside itself."""
        return self.role.senses

    @property
    def fires_on(self) -> tuple[str, ...] | None:
        """The output ports on which it sends whenever it fires; None where that is not known beforehand."""
        return self.role.fires_on

    @property
    def every(self) -> int | None:
        """The ticks at whose multiples it acts; None where that is not known beforehand."""
        return self.role.every

    def wire(self, port: str) -> Wire:
        """Wire of an output port: a value that is kept beside what is sent has to be rounded by it.

        What is sent is rounded in any case, by the driver of the module.
        """
        formats = self.context.formats
        return Wire(formats.get(port, formats.get("", WireFormat.DOUBLE)), self.outputs[port])

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

    def stop(self) -> Stop | None:
        """Where a window that opens now may end: behind the state at which the module acts first; None for no such end.

        A hint, by which a plant computes nothing that is dropped: in the same process by asking, else by
        :meth:`stop_at`. What happens is decided by :meth:`scan` all the same, so that only speed depends on it.
        """
        return None

    def stop_at(self, compared: FloatArray) -> Stop | None:
        """As :meth:`stop`, of a module that lives in another process and has said what it compares with."""
        return None

    @property
    def watching(self) -> bool:
        """Whether it watches anything, so that it is worth while to look at all samples."""
        return type(self).watches is not Module.watches

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """What the module watches, over committed samples from the beginning of a run on."""
        return ()

    def advance(self, tick: int, window: Window) -> None:
        """Commit memory up to and including ``tick``; samples up to there are final.

        It comes before :meth:`fire` and :meth:`receive` of that tick, once a tick, and may jump: nothing is said of
        the ticks between, which lie in the window. Only a module that reads a plant is told.
        """

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Act by itself at a tick that :meth:`scan` has named."""
        raise NotImplementedError(f"{type(self).__name__} names ticks in scan() but has no fire()")

    def settle(self, port: str, tick: int, acknowledged: bool) -> None:
        """Be told that the wait for the acknowledgement of the last message of a port is over.

        It comes after :meth:`advance` and before :meth:`receive` of that tick; afterwards the module is asked anew when
        it acts. Only of ports that ``context.acknowledged`` names.

        Parameters
        ----------
        port
            On which it was sent.
        tick
            At which that is known.
        acknowledged
            False where the last try was in vain: the other side holds what it held before.
        """

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Take all that arrives in one step.

        Parameters
        ----------
        tick
            None for a module that answers at once and is not timed.
        arrivals
            In a fixed order: link by link, and by sequence number on each.
        sample
            Of the plant that the module reads, at this tick; None if it reads none.

        Returns
        -------
        Mapping
            A value for each port on which something is sent; empty where nothing is.
        """
        return {}
