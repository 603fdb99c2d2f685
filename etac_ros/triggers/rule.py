"""What every trigger rule offers to the module that transmits."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar, Protocol, TypeGuard, runtime_checkable

import numpy as np
import numpy.typing as npt

from etac_ros.parameters import FloatArray, Parameters


class TriggerRule(Protocol):
    """Decides at which sample a module transmits. Pure: looking twice changes nothing.

    Thresholds may depend on the sample, on the value last sent, on the time and on the time since that was sent: so
    self-triggered rules, dwell times, and errors against a model's prediction from the value last sent fit in here. A
    rule whose threshold has dynamics of its own is a :class:`RuleWithMemory`.
    """

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
            The last-sent value, as it stood on the wire, shape (size,).
        held_tick
            Tick at which it was sent.
        """
        ...

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Error and threshold of each sample from ``tick`` on, both of shape (n,); None where the rule has neither."""
        ...


class RuleWithMemory(Protocol):
    """A trigger rule that keeps something from one sample to the next, as dynamic triggering does.

    The memory is handed in and out, so that looking ahead leaves no trace. It is folded over every sample. At an
    instant it is folded over that instant's sample with the value that has just been sent, not with the one before.
    """

    Parameters: ClassVar[type[Parameters]]

    def initial_memory(self) -> FloatArray:
        """Memory before the sample after the first transmission, shape (m,). The first sample always is transmitted."""
        ...

    def fold(
        self, signals: FloatArray, tick: int, held: FloatArray, held_tick: int, memory: FloatArray
    ) -> tuple[npt.NDArray[np.bool_], FloatArray]:
        """Whether each sample fires, shape (n,), and the memory after each, shape (n, m), if nothing is sent meanwhile.

        Parameters
        ----------
        signals, tick, held, held_tick
            As for :meth:`TriggerRule.first`.
        memory
            Before ``signals[0]``, shape (m,).
        """
        ...

    def margin(self, signals: FloatArray, tick: int, held: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """As for :class:`TriggerRule`; None where it takes the memory to tell."""
        ...


class HeldRule(TriggerRule, Protocol):
    """A rule that goes by sample and held value alone, and whose formula may be compiled into a plant's."""

    holds_parameters: FloatArray
    holds: Callable[..., Any]
    """``holds(signals, row, held, holds_parameters)``, as :func:`etac_ros.maths.compiled.inlined` takes it: whether a
    sample fires."""


AnyRule = TriggerRule | RuleWithMemory


def is_held(rule: AnyRule) -> TypeGuard[HeldRule]:
    """Whether the formula of a rule may be compiled into a plant's."""
    return hasattr(rule, "holds_parameters")


@runtime_checkable
class PartialRule(TriggerRule, Protocol):
    """A rule by which a triggering instant may renew a part of the held value only."""

    def renewed(self, value: FloatArray, tick: int, held: FloatArray) -> FloatArray:
        """What is transmitted of a value at a triggering instant, where something was held before."""
        ...
