"""The actuator: a zero-order hold with a torque limit."""

from __future__ import annotations

import numpy as np
from pydantic import PositiveFloat

from etac_ros.graph.module import Arrivals, Context, Module, Outputs
from etac_ros.parameters import FloatArray, Parameters


class ActuatorParameters(Parameters):
    """Parameters of :class:`Actuator`."""

    limit_nm: PositiveFloat | None = None


class Actuator(Module):
    """Applies the newest command, limited on each axis, until the next one arrives.

    Parameters
    ----------
    context
        Name and grid.
    parameters
        ``limit_nm``: largest torque an axis [N m]; None is unlimited.
    """

    Parameters = ActuatorParameters
    answers = True

    def __init__(self, context: Context, parameters: ActuatorParameters) -> None:
        super().__init__(context)
        self.inputs = {"command": 3}
        self.outputs = {"torque": 3}
        self._limit = np.inf if parameters.limit_nm is None else parameters.limit_nm

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """The torque held from now on [N m]."""
        return {"torque": np.minimum(np.maximum(arrivals[-1].value, -self._limit), self._limit)}
