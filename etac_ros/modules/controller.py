"""The attitude controller: answers each received signal with a torque command."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from pydantic import Field, NonNegativeInt, PositiveInt

from etac_ros.graph.module import Arrivals, Context, Module, Outputs
from etac_ros.graph.promises import Component, signature_of
from etac_ros.graph.role import Acts, Role
from etac_ros.laws.law import Law, has_formula
from etac_ros.parameters import FloatArray, Parameters

_TOLD = ("tick", "state")
"""What a law is told beside the signal, if its method ``command`` has parameters of these names."""


class ControllerParameters(Parameters):
    """Parameters of :class:`Controller` beside its law's."""

    known_state: tuple[NonNegativeInt, PositiveInt] | None = Field(
        default=None,
        description="first column and number of columns of the plant's state that the law takes as known, "
        "as an idealised baseline does",
    )


class Controller(Module):
    """Holds nothing but its law; silent between messages.

    Parameters
    ----------
    context
        Name; the plant, where the law takes a part of its state as known.
    parameters
        Which part that is.
    law
        Maps a received signal to a command.

    Raises
    ------
    ValueError
        If the law asks for something that a controller does not know.
    """

    Parameters = ControllerParameters
    components = ("law",)
    role = Role(Acts.AT_ONCE)

    def __init__(self, context: Context, parameters: ControllerParameters, law: Law) -> None:
        super().__init__(context)
        self.inputs = {"signal": law.signal_size}
        self.outputs = {"command": law.command_size}
        self._size = law.command_size
        self._law = Component(context.name, law)
        self._told = tuple(name for name in _TOLD if self._law.takes("command", name))
        self._columns = slice(0, 0)
        _check_signature(law)
        if parameters.known_state is not None:
            if context.plant is None:
                raise ValueError("known_state needs a plant, named by the key 'reads'")
            first, count = parameters.known_state
            self._columns = slice(first, first + count)
            if first + count > len(context.plant.labels):
                raise ValueError(
                    f"known_state: columns {first} to {first + count - 1} of a state of {len(context.plant.labels)}"
                )
            self.role = Role(Acts.ON_ARRIVAL, triggers="command")
        elif "state" in self._told:
            raise ValueError(f"{type(law).__name__}.command takes a part of the state: say which by 'known_state'")
        elif "tick" in self._told:
            self.role = Role(Acts.AT_ONCE, timed=True)

    @property
    def formula(self) -> tuple[Callable[..., Any], FloatArray] | None:
        """The law as a formula to be compiled, and its numbers; None where it has none, or goes by more than that."""
        law = self._law.owner
        return (law.command_form, law.command_parameters) if not self._told and has_formula(law) else None  # type: ignore[arg-type]  # it is the law

    def receive(self, tick: int | None, arrivals: Arrivals, sample: FloatArray | None) -> Outputs:
        """Compute the command for the newest signal."""
        if not self._told:
            return {"command": self._law.vector(self._size, "command", arrivals[-1].value)}
        known: dict[str, Any] = {}
        if "tick" in self._told:
            known["tick"] = tick
        if "state" in self._told:
            assert sample is not None
            known["state"] = sample[self._columns]
        return {"command": self._law.vector(self._size, "command", arrivals[-1].value, **known)}


def _check_signature(law: Law) -> None:
    _, *others = signature_of(law.command).parameters.values()
    for other in others:
        if other.default is other.empty and other.name not in _TOLD and other.kind is not other.VAR_KEYWORD:
            raise ValueError(
                f"{type(law).__name__}.command asks for '{other.name}'; a controller tells a law the signal, and "
                f"{' and '.join(_TOLD)} by these names"
            )
