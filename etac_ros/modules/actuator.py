"""The actuator: a zero-order hold with limits, of any number of axes, wheels or servos."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from pydantic import Field, FiniteFloat, PositiveFloat, PositiveInt, model_validator

from etac_ros.graph.module import Arrivals, Context, Module, Outputs
from etac_ros.graph.role import Acts, Role
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

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.limit_nm is not None and self.limits is not None:
            raise ValueError("one of limit_nm (the same for all) and limits (one for each)")
        for name in ("limits", "effectiveness"):
            values = getattr(self, name)
            if values is not None and len(values) != self.size:
                raise ValueError(f"{self.size} numbers in {name}, one for each of 'size'; found {len(values)}")
        if self.axes is not None and (not self.axes or len(self.axes) % self.size):
            raise ValueError(f"rows of {self.size} numbers in axes, one for each of 'size'; found {len(self.axes)}")
        return self


class Actuator(Module):
    """Applies the newest command until the next one arrives.

    Each component is limited, then reduced to its effectiveness; then ``axes`` turns it into the plant's input.

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
        self._limit: float | FloatArray = np.inf if parameters.limit_nm is None else parameters.limit_nm
        if parameters.limits is not None:
            self._limit = vector(parameters.limits)
        self._effectiveness = None if parameters.effectiveness is None else vector(parameters.effectiveness)

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """The input held from now on, a torque [N m] for instance."""
        torque = np.minimum(np.maximum(arrivals[-1].value, -self._limit), self._limit)
        if self._effectiveness is not None:
            torque = self._effectiveness * torque
        if self._axes is not None:
            torque = np.einsum("ij,j->i", self._axes, torque)
        return {"torque": torque}
