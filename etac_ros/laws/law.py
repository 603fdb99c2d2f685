"""The two halves of a law, as the modules on either side of a network link use them.

What a method wants to be told beside its first argument it says by the names of its parameters: ``command(signal)``
and ``command(signal, tick)`` are both laws, ``evaluate(states)`` and ``evaluate(states, ticks)`` both signals.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol, TypeGuard, runtime_checkable

import numpy as np
import numpy.typing as npt
from pydantic import PositiveInt

from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.watch import Watch

TickArray = npt.NDArray[np.int64]


class Signal(Protocol):
    """What the sensor module forms from measurements, watches with its trigger and transmits.

    A signal that sends something else than is watched, as a torque that it knows the law of, has besides
    ``sent_size`` and ``sent(states)``, called as ``evaluate`` is. The trigger rule compares rows of ``evaluate`` with
    the row of the last triggering instant then.

    A signal that takes the states of one kind of plant says how many components they have, as ``state_size``: a plant
    with another number is refused.
    """

    Parameters: ClassVar[type[Parameters]]
    size: int
    """Number of components."""
    label: str
    """Symbol in the paper, for plots."""

    def evaluate(self, states: FloatArray) -> FloatArray:
        """Signal of each measured state, shape (n, size); contiguous, one kernel for one row and for many.

        Pure. With a second parameter ``ticks`` it is told the tick of each row, for a reference that moves.
        """
        ...


class FormedSignal(Signal, Protocol):
    """A signal whose formula may be compiled into a plant's, so that computing ahead stops where the rule holds."""

    form_parameters: FloatArray
    form: Callable[..., Any]
    """``form(state, form_parameters, out)``, as :func:`etac_ros.maths.compiled.inlined` takes it: one row of
    ``evaluate``."""


def is_formed(signal: Signal) -> TypeGuard[FormedSignal]:
    """Whether the formula of a signal may be compiled into a plant's."""
    return hasattr(signal, "form_parameters")


class Law(Protocol):
    """What the controller computes from the last received signal.

    ``command`` is called exactly once for each message, in the order of their arrival, in both engines and whatever
    the windows are. So a law may keep what it likes from one message to the next.
    """

    Parameters: ClassVar[type[Parameters]]
    signal_size: int
    """Components of the received signal."""
    command_size: int
    """Components of the command."""

    def command(self, signal: FloatArray) -> FloatArray:
        """Command, a torque [N m] for instance, shape (command_size,).

        With a parameter ``tick`` it is told the tick of the message: ``command(signal, tick)``. With a parameter
        ``state`` it is told what the controller's key ``known_state`` names of the plant's state.
        """
        ...


class FormedLaw(Law, Protocol):
    """A law that goes by the signal alone, and whose formula may be compiled into a plant's."""

    command_parameters: FloatArray
    command_form: Callable[..., Any]
    """``command_form(signal, command_parameters, out)``, as :func:`etac_ros.maths.compiled.inlined` takes it: what
    ``command`` returns."""


def has_formula(law: Law) -> TypeGuard[FormedLaw]:
    """Whether the formula of a law may be compiled into a plant's."""
    return hasattr(law, "command_parameters")


class WatchedLaw(Protocol):
    """A law whose trigger rule looks at more than the command."""

    Parameters: ClassVar[type[Parameters]]
    signal_size: int
    """Components of the received signal."""
    command_size: int
    """Components of the command."""

    def command(self, signal: FloatArray, tick: int) -> FloatArray:
        """Command for a signal of a tick, shape (command_size,)."""
        ...

    def watched(self, signals: FloatArray, ticks: TickArray) -> FloatArray:
        """What the trigger rule is shown of each signal; the first columns are the command."""
        ...


class RelativeSignal(Protocol):
    """A signal of which the torque that acts from this tick on is a part."""

    Parameters: ClassVar[type[Parameters]]
    size: int
    """Number of components."""
    label: str
    """Symbol in the paper, for plots."""

    def evaluate(self, states: FloatArray, torque: FloatArray, ticks: TickArray) -> FloatArray:
        """Signal of each state, shape (n, size)."""
        ...


class LawWithMemory(Protocol):
    """A law on the sensor's side that keeps something between samples.

    The memory is handed in and out, so that looking ahead leaves no trace.
    """

    Parameters: ClassVar[type[Parameters]]
    command_size: int
    """Components of the command."""
    memory_size: int
    """Components of the memory."""
    label: str
    """Symbol of the command in the paper, for plots."""
    unit: str
    """Unit of the command, for plots."""

    def initial_memory(self, state: FloatArray) -> FloatArray:
        """Memory before the first sample; a ValueError refuses the start."""
        ...

    def fold(self, states: FloatArray, tick: int, memory: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Command at each sample from ``tick`` on, and the memory after it."""
        ...

    def watches(self, states: FloatArray, tick: int, memory: FloatArray) -> tuple[Watch, ...]:
        """Quantities of the law that have to stay within bounds, at each sample from ``tick`` on."""
        ...


@runtime_checkable
class LawOfEvents(LawWithMemory, Protocol):
    """A law with memory that also learns at triggering instants: its memory then depends on when it was heard."""

    def after_event(self, state: FloatArray, tick: int, memory: FloatArray) -> FloatArray:
        """Memory after a triggering instant at a tick; ``memory`` is that after the sample of the same tick."""
        ...


class Relay:
    """No law: a torque that was computed elsewhere is applied as it arrives.

    Parameters
    ----------
    parameters
        ``size``: components.
    ticks_per_second
        Not used.
    """

    class Parameters(Parameters):
        """Parameters of :class:`Relay`."""

        size: PositiveInt = 3

    def __init__(self, parameters: Relay.Parameters, ticks_per_second: int) -> None:
        self.signal_size = self.command_size = parameters.size

    def command(self, signal: FloatArray) -> FloatArray:
        """The received torque [N m]."""
        return signal
