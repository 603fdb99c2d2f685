"""What a paper proves of the shortest inter-event time under its rule, and what a rule needs to evaluate that."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from etac_ros.parameters import FloatArray


@dataclass(frozen=True)
class Bound:
    """What a paper says of the shortest inter-event time.

    Attributes
    ----------
    equation
        Where.
    seconds
        Its value [s]; None where it cannot be evaluated.
    remark
        What stands in for constants that the paper does not give, or why there is no value.
    """

    equation: str
    seconds: float | None
    remark: str


class Evidence(Protocol):
    """What the bounds' constants are taken from: a scenario, and one undisturbed run of it, made when it is asked."""

    @property
    def signal(self) -> object:
        """What forms the quantity that the rule watches; None where the scenario names nothing."""
        ...

    @property
    def gains(self) -> Sequence[float]:
        """The gains ``k`` of the scenario's laws."""
        ...

    @property
    def inertias_kg_m2(self) -> Sequence[FloatArray]:
        """Inertia matrices of the plants, each of shape (3, 3)."""
        ...

    @property
    def sensors(self) -> int:
        """How many nodes have a trigger rule."""
        ...

    def signals(self) -> FloatArray:
        """What was watched at each tick of the run, shape (n, m)."""
        ...

    def drift_nm(self, inertia_kg_m2: FloatArray) -> float:
        """Largest ``|J s_dot - u|`` over the run [N m]: what acts on the signal beside the control torque."""
        ...

    def motion(self) -> tuple[float, float, float]:
        """Largest rate, acceleration, and second derivative of the reference rate, of all plants and references."""
        ...


@runtime_checkable
class BoundedRule(Protocol):
    """A trigger rule whose paper bounds its inter-event times from below."""

    def interval_bound(self, evidence: Evidence) -> Bound | None:
        """The bound; None where the rule is used otherwise than in its paper."""
        ...
