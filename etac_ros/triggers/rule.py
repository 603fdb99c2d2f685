"""What every trigger rule offers to the sensor module."""

from __future__ import annotations

from typing import ClassVar, Protocol

from etac_ros.parameters import FloatArray, Parameters


class TriggerRule(Protocol):
    """Decides at which sample the sensor module transmits. Pure: looking twice changes nothing."""

    Parameters: ClassVar[type[Parameters]]

    def first(self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int | None = None) -> int:
        """Index of the first sample that fires, or -1.

        Parameters
        ----------
        signals
            Contiguous samples, shape (n, size).
        tick
            Tick of ``signals[0]``.
        held
            The value last transmitted, as it stood on the wire, shape (size,).
        held_tick
            Tick at which it was transmitted.
        """
        ...

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Error and threshold of each sample from ``tick`` on, both of shape (n,); None where the rule has neither."""
        ...
