"""What every process of a run knows beforehand: the graph, who plays which part of it, and who listens to what."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.topics import next_topic, truth_topic, window_topic
from etac_ros.timing.windows import WindowPolicy

COORDINATOR = "/coordinator"
RECORDER = "/recorder"


@dataclass(frozen=True)
class Plan:
    """The distribution of one run.

    Attributes
    ----------
    scenario, digest
        Name of the scenario, and what all processes have to agree on.
    graph
        The modules; each process drives only its own.
    windows
        How far plants compute ahead.
    record_windows
        Whether the bag also gets windows; they are not committed, so only for looking at the protocol.
    """

    scenario: str
    digest: str
    graph: Graph
    windows: WindowPolicy
    record_windows: bool = False

    @cached_property
    def modules(self) -> tuple[str, ...]:
        """The modules that etac_ros plays itself."""
        return tuple(name for name in self.graph.modules if name not in self.graph.external)

    @cached_property
    def nodes(self) -> tuple[str, ...]:
        """All nodes that say join."""
        return (*self.modules, COORDINATOR, RECORDER)

    @cached_property
    def timekeeper_with(self) -> str | None:
        """The plant in whose process the coordinator lives; None gives it a process of its own."""
        return self.graph.plants[0] if len(self.graph.plants) == 1 else None

    @cached_property
    def remote_plants(self) -> tuple[str, ...]:
        """Plants that get their orders as messages."""
        return () if self.timekeeper_with else self.graph.plants

    @cached_property
    def ordered(self) -> tuple[str, ...]:
        """Modules that get orders as messages."""
        return tuple(name for name in self.modules if self.needs_orders(name))

    def needs_orders(self, module: str) -> bool:
        """Whether a module waits for orders; the others act on arrival, or live with the coordinator."""
        if module in self.graph.plants:
            return module in self.remote_plants
        return not self.acts_on_arrival(module)

    def acts_on_arrival(self, module: str) -> bool:
        """Whether a module needs no order for what arrives.

        Who sees a plant has to take the sample of the newest window. Where windows have one sample, a tick is in one
        window only, so there is nothing to mistake.
        """
        sees_one = module not in self.graph.reads or self.windows.longest == 1
        return sees_one and self.graph.acts_on_arrival(module)

    def reports(self, module: str) -> bool:
        """Whether the coordinator hears what a module does; what the others do it knows beforehand.

        It knows it of modules that only answer, and of those that act at regular ticks. With several plants the
        latter report nevertheless: else nothing would tell a coordinator in a process of its own how far the run is.
        """
        regular = self.graph.modules[module].every is not None and self.timekeeper_with is not None
        return module in self.graph.reporters and not regular

    def namespace_of(self, node: str) -> str:
        """The namespace to whose part of the run a node belongs; time and recording go with the first plant."""
        name = self.graph.plants[0] if node in (COORDINATOR, RECORDER) else node
        return name.rpartition("/")[0] or "/"

    def part(self, namespace: str) -> tuple[str, ...]:
        """The nodes of one part of a run that is started in several terminals.

        Raises
        ------
        ScenarioError
            If there is no such namespace.
        """
        names = tuple(name for name in self.nodes if self.namespace_of(name) == "/" + namespace.strip("/"))
        if not names:
            known = sorted({self.namespace_of(name) for name in self.nodes})
            raise ScenarioError(
                f"--only {namespace}", "is no namespace of this scenario", f"one of: {', '.join(known)}"
            )
        return names

    def sender_of(self, topic: str) -> str:
        """The node that publishes a topic."""
        for link in self.graph.links.values():
            if link.topic == topic:
                return link.sender
        for name in self.graph.modules:
            if topic in (window_topic(name), truth_topic(name), next_topic(name)):
                return name
        return COORDINATOR

    def listeners(self, link: Link) -> int:
        """Subscriptions of a link's topic: its receivers and the recorder."""
        return len(link.receivers) + 1
