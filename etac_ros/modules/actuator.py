"""The actuator: a zero-order hold with limits, of any number of axes, wheels or servos."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, FiniteFloat, PositiveFloat, PositiveInt, model_validator

from etac_ros.graph.module import Arrivals, Context, Module, Outputs, Window
from etac_ros.graph.role import Acts, Role
from etac_ros.maths.ticks import whole_ticks
from etac_ros.parameters import FloatArray, Parameters, vector


class ActuatorParameters(Parameters):
    """Parameters of :class:`Actuator`."""

    size: PositiveInt = Field(default=3, description="axes, wheels or servos: components of a command")
    limit_nm: PositiveFloat | None = Field(default=None, description="largest torque of each; default: unlimited")
    limits: tuple[PositiveFloat, ...] | None = Field(
        default=None, description="largest magnitude of each one by itself, in the unit of the command"
    )
    effectiveness: tuple[Annotated[float, Field(ge=0.0)], ...] | None = Field(
        default=None, description="what is left of each one, 1 is all: 0 has failed"
    )
    axes: tuple[FiniteFloat, ...] | None = Field(
        default=None,
        description="what each does to the plant's input: a row a component of the input, a column a wheel",
    )

    time_to_live_s: PositiveFloat | None = Field(
        default=None, description="without a command for longer than this, the safe one is applied; default: for ever"
    )
    safe_command: tuple[FiniteFloat, ...] | None = Field(
        default=None, description="what is applied then, until the next command; default: zero"
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.limit_nm is not None and self.limits is not None:
            raise ValueError("one of limit_nm (the same for all) and limits (one for each)")
        if self.safe_command is not None and self.time_to_live_s is None:
            raise ValueError("safe_command is applied when a command has outlived its time: say time_to_live_s, too")
        for name in ("limits", "effectiveness", "safe_command"):
            values = getattr(self, name)
            if values is not None and len(values) != self.size:
                raise ValueError(f"{self.size} numbers in {name}, one for each of 'size'; found {len(values)}")
        if self.axes is not None and (not self.axes or len(self.axes) % self.size):
            raise ValueError(f"rows of {self.size} numbers in axes, one for each of 'size'; found {len(self.axes)}")
        return self


class Actuator(Module):
    """Applies the newest command until the next one arrives.

    Each component is limited, then reduced to its effectiveness; then ``axes`` turns it into the plant's input.

    With a time to live the hold ends by itself: at the first tick at which the newest command is older than that, the
    safe command takes its place. A command that arrives at the last tick of the time is in time.

    Parameters
    ----------
    context
        Name and grid.
    parameters
        Number, limits, effectiveness, and how the plant feels them.
    """

    Parameters = ActuatorParameters
    role = Role(Acts.AT_ONCE)

    def __init__(self, context: Context, parameters: ActuatorParameters) -> None:
        super().__init__(context)
        size = parameters.size
        self._axes = None if parameters.axes is None else vector(parameters.axes).reshape(-1, size)
        self.inputs = {"command": size}
        self.outputs = {"torque": size if self._axes is None else self._axes.shape[0]}
        self._limit: FloatArray = np.full(size, np.inf if parameters.limit_nm is None else parameters.limit_nm)
        if parameters.limits is not None:
            self._limit = vector(parameters.limits)
        self._least = -self._limit
        if parameters.time_to_live_s is not None:
            self.role = Role()
            try:
                self.hold_ticks = whole_ticks(parameters.time_to_live_s, context.ticks_per_second)
            except ValueError as error:
                raise ValueError(f"time_to_live_s: {error}") from None
        self._safe: FloatArray = np.zeros(size) if parameters.safe_command is None else vector(parameters.safe_command)
        self._expires: int | None = None
        self._effectiveness = None if parameters.effectiveness is None else vector(parameters.effectiveness)

    @property
    def formula(self) -> FloatArray | None:
        """Least, largest and what is left of each component, one after another; None where that is not all."""
        if self._axes is not None or self.hold_ticks is not None:
            return None
        left = np.ones_like(self._limit) if self._effectiveness is None else self._effectiveness
        return np.concatenate([self._least, self._limit, left])

    def scan(self, window: Window | None, after: int) -> int | None:
        """The tick at which the newest command has outlived its time."""
        # Overdue is what expired while the process stood still.
        return None if self._expires is None else max(self._expires, after + 1)

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Let go of a command that is too old."""
        self._expires = None
        return {"torque": self._torque(self._safe)}

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """The input held from now on, a torque [N m] for instance."""
        if self.hold_ticks is not None:
            assert tick is not None  # it acts by itself, so it is told
            self._expires = tick + self.hold_ticks + 1
        return {"torque": self._torque(arrivals[-1].value)}

    def _torque(self, command: FloatArray) -> FloatArray:
        torque: FloatArray = np.minimum(np.maximum(command, self._least), self._limit)
        if self._effectiveness is not None:
            torque = self._effectiveness * torque
        if self._axes is not None:
            torque = np.einsum("ij,j->i", self._axes, torque)
        return torque
