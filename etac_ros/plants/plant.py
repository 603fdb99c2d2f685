"""What every plant offers to the modules that read and drive it."""

from __future__ import annotations

from typing import ClassVar, Protocol

from etac_ros.parameters import FloatArray, Parameters


class Plant(Protocol):
    """Continuous dynamics sampled on the tick grid under a held input.

    A plant is immutable: its state belongs to the module that simulates it, so a window of samples ahead can be
    computed and dropped without a trace.
    """

    Parameters: ClassVar[type[Parameters]]
    labels: tuple[str, ...]
    """Name of each state component, with its unit."""
    inputs: dict[str, int]
    """Size of each input port; the held input is their concatenation in this order."""
    noise_width: int
    """Normal deviates that :meth:`measured` takes a sample; 0 where the sensors are ideal."""
    attitude_slice: slice
    """Where the attitude error stands in the state."""
    rate_slice: slice
    """Where the angular velocity error [rad/s] stands in the state."""

    def initial_state(self) -> FloatArray:
        """State at tick 0."""
        ...

    def propagate(self, state: FloatArray, tick: int, count: int, held: FloatArray) -> FloatArray:
        """States at ``tick + 1 .. tick + count``, shape (count, n), from the state at ``tick``."""
        ...

    def measured(self, states: FloatArray, errors: FloatArray) -> FloatArray:
        """What sensors with the given errors see; ``errors`` has shape (n, noise_width)."""
        ...

    def euler_angles(self, states: FloatArray) -> FloatArray:
        """Attitude error as 3-2-1 Euler angles [rad], shape (n, 3)."""
        ...

    def attitude_angle(self, states: FloatArray) -> FloatArray:
        """Attitude error as one angle [rad], shape (n,)."""
        ...
