"""The attitude controller: answers each received signal with a torque command."""

from __future__ import annotations

from etac_ros.graph.module import Arrivals, Context, Module, Outputs
from etac_ros.laws.law import Law
from etac_ros.parameters import FloatArray, Parameters


class ControllerParameters(Parameters):
    """A controller has no parameters beside its law's."""


class Controller(Module):
    """Holds nothing but its law; silent between messages.

    Parameters
    ----------
    context
        The wire format of the port ``command``.
    law
        Maps a received signal to a command.
    """

    Parameters = ControllerParameters
    components = ("law",)
    answers = True

    def __init__(self, context: Context, parameters: ControllerParameters, law: Law) -> None:
        super().__init__(context)
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._law = law
        self._wire = self.wire("command")

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Compute the command for the newest signal."""
        return {"command": self._wire.rounded(self._law.command(arrivals[-1].value))}
