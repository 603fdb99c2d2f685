"""What a module that triggers can be asked after a run: what its rule was shown, and what it compared that with."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Protocol, runtime_checkable

from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Arrivals, Window
from etac_ros.parameters import FloatArray
from etac_ros.triggers.periodic import Periodic
from etac_ros.triggers.rule import AnyRule

Heard = Mapping[int, Arrivals]
"""All that arrived at a module, by tick; within a tick in the order of its steps."""
NOTHING: Heard = MappingProxyType({})


@runtime_checkable
class Triggering(Protocol):
    """A module that transmits when its trigger rule says so. It is asked on a fresh graph, which no engine has run."""

    trigger: AnyRule

    @property
    def watched_label(self) -> str:
        """Symbol of what the trigger rule watches, for plots; of several quantities as ``[a, b]``."""
        ...

    @property
    def watched_unit(self) -> str:
        """Its unit, or one for each of several quantities: ``rad/s, 1/s``."""
        ...

    def watched(self, window: Window | None, heard: Heard) -> FloatArray | None:
        """What the trigger rule was shown at each tick.

        Parameters
        ----------
        window
            Committed samples of the plant that the module reads, from the first tick on; None if it reads none.
        heard
            What arrived meanwhile.

        Returns
        -------
        ndarray or None
            Shape (n, m), a row a tick, from the window's first tick (without one, from tick 0) on; the first columns
            are those that :meth:`held_by` is compared with. None where the rule was not asked at every tick.
        """
        ...

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """What the trigger rule compares with after a message that was sent at a tick."""
        ...


def triggering_modules(graph: Graph) -> tuple[str, ...]:
    """Names of the modules whose own acts are triggering instants."""
    return tuple(name for name in graph.reporters if graph.modules[name].triggers)


def event_triggered_modules(graph: Graph) -> tuple[str, ...]:
    """Those of them that are triggered by events: a rule decides, and it goes by more than the time."""
    rules = {name: getattr(graph.modules[name], "trigger", None) for name in triggering_modules(graph)}
    return tuple(name for name, rule in rules.items() if rule is not None and not isinstance(rule, Periodic))
