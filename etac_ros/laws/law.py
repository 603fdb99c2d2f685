"""The two halves of a law, as the modules on either side of a network link use them."""

from __future__ import annotations

from typing import ClassVar, Protocol

from etac_ros.parameters import FloatArray, Parameters


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
