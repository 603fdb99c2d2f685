"""The two halves of a law, as the modules on either side of a network link use them."""

from __future__ import annotations

from typing import ClassVar, Protocol

import numpy as np
import numpy.typing as npt
from pydantic import PositiveInt

from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.watch import Watch

TickArray = npt.NDArray[np.int64]


class Signal(Protocol):
    """What the sensor module forms from measurements, watches with its trigger and transmits."""

    Parameters: ClassVar[type[Parameters]]
    size: int
    """Number of components."""
    label: str
    """Symbol in the paper, for plots."""

    def evaluate(self, states: FloatArray) -> FloatArray:
        """Signal of each measured state, shape (n, size); contiguous, one kernel for one row and for many."""
        ...


class Law(Protocol):
    """What the controller computes from the last received signal; it must not depend on the tick."""

    Parameters: ClassVar[type[Parameters]]
    signal_size: int
    """Components of the received signal."""
    command_size: int
    """Components of the command."""

    def command(self, signal: FloatArray) -> FloatArray:
        """Torque command [N m], shape (command_size,)."""
        ...


class TimedLaw(Protocol):
    """A law that knows the time, for its model of disturbances; on arrays of samples, one row a tick."""

    Parameters: ClassVar[type[Parameters]]
    signal_size: int
    """Components of the received signal."""
    command_size: int
    """Components of the command."""

    def torque(self, signals: FloatArray, ticks: TickArray) -> FloatArray:
        """Torque [N m] of each signal, shape (n, command_size)."""
        ...


class WatchedLaw(TimedLaw, Protocol):
    """A timed law whose trigger rule looks at more than the torque."""

    def watched(self, signals: FloatArray, ticks: TickArray) -> FloatArray:
        """What the trigger rule is shown of each signal."""
        ...


class ModalLaw(Protocol):
    """A timed law that takes the modes of a flexible plant as known."""

    Parameters: ClassVar[type[Parameters]]
    signal_size: int
    """Components of the received signal."""
    command_size: int
    """Components of the command."""

    def torque(self, signals: FloatArray, modes: FloatArray, ticks: TickArray) -> FloatArray:
        """Torque [N m] of each signal with its modes, shape (n, command_size)."""
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
    """A law that keeps something between samples, handed in and out so that looking ahead leaves no trace."""

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
