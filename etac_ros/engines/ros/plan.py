"""What every process of a run knows beforehand: the graph, who plays which part of it, and who listens to what."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import Any

from etac_ros.engines.ros.liveness import QUIET_S
from etac_ros.errors import ScenarioError
from etac_ros.graph.faults import Fault
from etac_ros.graph.graph import Graph, Link, Reliability
from etac_ros.graph.topics import RECORDED, ledger_topic, next_topic, truth_topic, window_topic
from etac_ros.maths.ticks import NANOSECONDS
from etac_ros.maths.wall_clock import WallClock
from etac_ros.timing.duties import Duties
from etac_ros.timing.membership import mortals, restarts_of, surely_there
from etac_ros.timing.windows import WindowPolicy, short_windows

_BY_HAND = "by hand"
_LOOKS_FOR_NS = 5 * NANOSECONDS
"""How long a process that takes the place of a dead one may be about finding the others, by far."""
COORDINATOR = "/coordinator"
RECORDER = "/recorder"


@dataclass(frozen=True)
class RealTime:
    """How a run goes in real time.

    Attributes
    ----------
    rate
        Simulated seconds a second.
    strict
        Whether the first missed tick ends the run.
    priority
        Of its processes among those with a real-time priority (SCHED_FIFO, 1 to 99); 0 for an ordinary one.
    """

    rate: Fraction
    strict: bool = False
    priority: int = 0


@dataclass(frozen=True)
class Birth:
    """A process that takes the place of one that a fault has killed, while the run is under way.

    Attributes
    ----------
    incarnation
        Which of its node's processes it is: 1, 2, ...
    fault
        Which made room for it.
    clock
        The instants of ticks on the wall clock.
    """

    incarnation: int
    fault: Fault
    clock: WallClock


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
    token
        Known to the processes of this run only; empty where they are started by hand, and know the digest only.
    quiet_s
        How long a node may owe an answer, or stand still, before it is reported [s].
    wall
        How it runs in real time; None for simulated time.
    pace
        Simulated seconds a second that simulated time may make at most; None lets it run. Changes no bit, and concerns
        the coordinator alone.
    faults
        In real time: what the launcher does to processes. In simulated time the graph has them.
    rehearse
        In simulated time: what each process with a module does before it joins. It was forked from one that has done it
        already, and owns nothing yet of what that takes: the first act would be several times as long.
    anew
        In real time with a priority: builds the graph once more, for rehearsals of tick 0, which are to leave the
        modules of the run alone.
    birth
        Of a process that takes the place of a dead one; None of one that is there from the start.
    parameters
        What each node shows to ROS tools, by node; None where nobody is shown anything: in launched runs, unless they
        are asked to, since it makes their start slower.
    told
        The complete parameters of the run as JSON, for who listens.
    ros_args
        Of a node that is started by hand: what is for its own logging and security, as behind ``--ros-args``.
    """

    scenario: str
    digest: str
    graph: Graph
    windows: WindowPolicy
    record_windows: bool = False
    token: str = ""
    quiet_s: float = QUIET_S
    wall: RealTime | None = None
    pace: float | None = None
    faults: tuple[Fault, ...] = ()
    rehearse: Callable[[], None] | None = None
    anew: Callable[[], Graph] | None = None
    birth: Birth | None = None
    parameters: Mapping[str, Mapping[str, Any]] | None = None
    told: str = ""
    ros_args: tuple[str, ...] = ()

    @property
    def windows_ahead(self) -> WindowPolicy:
        """How far plants are asked to compute ahead; who does what, on which all agree, goes by ``windows``."""
        return short_windows(self.windows, self.pace, self.graph.ticks_per_second)

    @property
    def clock(self) -> str:
        """Which time it runs in: ``wall``, or empty for simulated time."""
        return "" if self.wall is None else "wall"

    @cached_property
    def mortals(self) -> frozenset[str]:
        """Nodes of which a fault kills a process."""
        return mortals(self.faults)

    @cached_property
    def revived(self) -> frozenset[str]:
        """Those of them in whose place others are started."""
        return frozenset(name for name in self.mortals if restarts_of(self.faults, name))

    def surely_there(self, name: str) -> bool:
        """Whether a process of this plan may wait until it has found a node: it is not dead meanwhile."""
        if self.birth is None or name not in self.mortals:
            return True
        return surely_there(self.faults, name, self.birth.fault, self.birth.clock, _LOOKS_FOR_NS)

    @cached_property
    def modules(self) -> tuple[str, ...]:
        """The modules that etac_ros plays itself."""
        return tuple(name for name in self.graph.modules if name not in self.graph.external)

    @cached_property
    def nodes(self) -> tuple[str, ...]:
        """All nodes that say join."""
        return (*self.modules, COORDINATOR, RECORDER)

    @cached_property
    def duties(self) -> Duties:
        """Who waits for orders, who acts on arrival, who reports."""
        return Duties(self.graph, self.windows)

    @property
    def timekeeper_with(self) -> str | None:
        """The plant in whose process the coordinator lives; None gives it a process of its own."""
        return self.duties.timekeeper_with if self.wall is None else None

    @property
    def run_id(self) -> str:
        """What every note of this run bears; nodes that are started by hand have to hear whom they do not fit."""
        return self.token or _BY_HAND

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
            if topic in (window_topic(name), truth_topic(name), next_topic(name), ledger_topic(name)):
                return name
        return RECORDER if topic == RECORDED else COORDINATOR

    def listeners(self, link: Link) -> tuple[tuple[str, ...], int]:
        """Who has to hear a link's topic: nodes of ours by name, and how many foreign ones."""
        own = tuple(name for name in link.receivers if name not in self.graph.external)
        coordinator = (COORDINATOR,) if self.listens_to_question(link) else ()
        return (*own, RECORDER, *coordinator), len(link.receivers) - len(own)

    def listens_to_question(self, link: Link) -> bool:
        """Whether the coordinator hears what a foreign node is asked, to compare the times of questions and answers.

        Clocks of several machines cannot be compared, and in real time nobody is asked.
        """
        asked = bool(self.graph.external & link.receivers.keys())
        return asked and bool(self.token) and self.wall is None and link.qos.reliability is Reliability.RELIABLE
