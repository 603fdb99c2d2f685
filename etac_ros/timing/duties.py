"""Who waits for orders, who acts on arrival, and who reports: what all processes of a run know beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property

from etac_ros.graph.graph import Graph
from etac_ros.graph.plant import PlantModule
from etac_ros.timing.windows import WindowPolicy


class Duties:
    """How a graph is driven by messages.

    Parameters
    ----------
    graph
        Modules and links.
    windows
        How far plants compute ahead.
    """

    def __init__(self, graph: Graph, windows: WindowPolicy) -> None:
        self._graph = graph
        self._windows = windows
        self._on_arrival: dict[str, bool] = {}

    @cached_property
    def timekeeper_with(self) -> str | None:
        """The plant in whose process the coordinator lives; None gives it a process of its own."""
        return self._graph.plants[0] if len(self._graph.plants) == 1 else None

    @cached_property
    def remote_plants(self) -> tuple[str, ...]:
        """Plants that get their orders as messages."""
        return () if self.timekeeper_with else self._graph.plants

    @cached_property
    def acting(self) -> Mapping[str, str]:
        """By plant whose windows end by themselves: the reader that says what it compares with, and so where.

        The plant lives beside the coordinator, which hears it, and whom it tells how long its window is.
        """
        plant = self.timekeeper_with
        if plant is None:
            return {}
        readers, module = self._graph.readers[plant], self._graph.modules[plant]
        assert isinstance(module, PlantModule)
        if len(readers) != 1 or not (self._graph.modules[readers[0]].stops and module.can_stop):
            return {}
        return {plant: readers[0]} if self.reports(readers[0]) else {}

    @property
    def untold(self) -> int:
        """How long such a window is while its reader cannot tell."""
        return self._windows.first

    def needs_orders(self, module: str) -> bool:
        """Whether a module waits for orders; the others act on arrival, or live with the coordinator."""
        if module in self._graph.plants:
            return module in self.remote_plants
        return not self.acts_on_arrival(module)

    def acts_on_arrival(self, module: str) -> bool:
        """Whether a module needs no order for what arrives.

        Who sees a plant has to take the sample of the newest window. Where windows have one sample, a tick is in one
        window only, so there is nothing to mistake.
        """
        if module not in self._on_arrival:
            sees_one = module not in self._graph.reads or self._windows.longest == 1
            self._on_arrival[module] = sees_one and self._graph.acts_on_arrival(module)
        return self._on_arrival[module]

    def reports(self, module: str) -> bool:
        """Whether the coordinator hears what a module does; what the others do it knows beforehand.

        It knows it of modules that only answer, and of those that act at regular ticks, which one with a fault does
        not. With several plants the
        latter report nevertheless: else nothing would tell a coordinator in a process of its own how far the run is.
        """
        regular = self._graph.modules[module].every is not None and self.timekeeper_with is not None
        return module in self._graph.reporters and not (regular and not self._graph.faults_of(module))
