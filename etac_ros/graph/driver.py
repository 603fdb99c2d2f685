"""A module together with the window it looks at: the bookkeeping that both engines need alike."""

from __future__ import annotations

from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.module import Arrival, Module, Outputs, Window
from etac_ros.parameters import FloatArray

Sent = list[tuple[Link, FloatArray]]


class Driver:
    """Drives one module through windows and ticks.

    Parameters
    ----------
    graph
        The graph that the module stands in.
    name
        The module's full name.
    """

    def __init__(self, graph: Graph, name: str) -> None:
        self.name = name
        self.module: Module = graph.modules[name]
        self.window: Window | None = None
        self._links = graph.sends[name]
        self._advanced = -1

    def see(self, window: Window) -> None:
        """Take a new window; everything before its start is committed."""
        self._advance(window.start - 1)
        self.window = window

    def look(self, after: int) -> int | None:
        """First tick after ``after`` at which the module acts by itself."""
        return self.module.scan(self.window, after)

    def fire(self, tick: int) -> Sent:
        """Let the module act by itself."""
        self._advance(tick)
        return self._named(self.module.fire(tick, self._sample(tick)))

    def conclude(self, tick: int) -> Sent:
        """Let a module conclude that fired where nothing arrives."""
        return self.receive(tick, ())

    def receive(self, tick: int | None, arrivals: tuple[Arrival, ...]) -> Sent:
        """Hand over all that arrives in one step."""
        if tick is None or self.window is None:
            return self._named(self.module.receive(tick, arrivals, None))
        self._advance(tick)
        return self._named(self.module.receive(tick, arrivals, self._sample(tick)))

    def _advance(self, tick: int) -> None:
        if self.window is not None and tick > self._advanced:
            self.module.advance(tick, self.window)
            self._advanced = tick

    def _sample(self, tick: int) -> FloatArray | None:
        return None if self.window is None else self.window.at(tick)

    def _named(self, outputs: Outputs) -> Sent:
        return [(link, outputs[link.port]) for link in self._links if link.port in outputs]
