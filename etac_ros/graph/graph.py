"""The graph of a scenario: which modules there are and which links join them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property

from etac_ros.graph.channel import Channel
from etac_ros.graph.faults import Fault
from etac_ros.graph.module import Module
from etac_ros.graph.plant import PlantModule
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.media.medium import MediumPlan


class LinkKind(StrEnum):
    """What a link is in hardware, and so where its messages are counted."""

    NETWORK = "network"
    """Crosses the network between modules: what the papers count."""
    INTERNAL = "internal"
    """A wire inside one module carrier."""
    PHYSICAL = "physical"
    """Light, current or torque: carried by the emulation plane, never added to the network figures."""


class AfterLast(StrEnum):
    """What happens when the last try has not been acknowledged."""

    GIVE_UP = "give_up"
    """The sender goes on, and knows that the other side holds what it held before."""
    HALT = "halt"
    """The run ends."""


@dataclass(frozen=True, slots=True)
class Acknowledgement:
    """How the messages of a link are acknowledged (:mod:`etac_ros.graph.acknowledged`).

    Attributes
    ----------
    timeout_ns
        From the end of a try to the next [ns].
    retries
        Tries beside the first.
    by
        Receivers that acknowledge, in the order of the link, and the line over which each does.
    any_suffices
        Whether one of them is enough; otherwise all have to.
    frame_bytes
        Of the whole frame of an acknowledgement.
    after_last
        What happens when the last try has not been acknowledged.
    told
        Whether the sender's trigger rule compares with what was acknowledged; otherwise with what was sent.
    """

    timeout_ns: int
    retries: int
    by: Mapping[str, str]
    any_suffices: bool
    frame_bytes: int
    after_last: AfterLast
    told: bool


class Reliability(StrEnum):
    """What DDS does about a sample that is lost on its way."""

    RELIABLE = "reliable"
    """Its reader misses it, and gets it once more."""
    BEST_EFFORT = "best_effort"
    """Nothing. In simulated time, which counts every message, that ends the run."""


@dataclass(frozen=True, slots=True)
class Qos:
    """How DDS carries a link's messages. What a run comes to does not depend on it.

    Attributes
    ----------
    history
        Samples that writer and readers keep: the last so many.
    """

    reliability: Reliability = Reliability.RELIABLE
    history: int = 4096


USUAL_QOS = Qos()


@dataclass(frozen=True, slots=True)
class Link:
    """One sender's port, one topic, any number of receivers."""

    name: str
    topic: str
    kind: LinkKind
    sender: str
    port: str
    receivers: Mapping[str, str]
    """Receiving module to its input port."""
    wire: Wire
    channel: Channel
    medium: str = ""
    """The shared medium that its messages cross before the channel has its say; empty for none."""
    acknowledged: Acknowledgement | None = None
    """None of a link whose messages are sent once."""
    qos: Qos = USUAL_QOS

    @property
    def is_ideal(self) -> bool:
        """Whether every message arrives at the tick of sending, once, and nobody says so."""
        return self.channel.ideal and not self.medium and self.acknowledged is None


@dataclass(frozen=True)
class Graph:
    """Modules and links in a fixed order; the order of every sum and of all arrivals comes from here.

    Attributes
    ----------
    modules
        Built modules by full name, in the order of the scenario file.
    reads
        The plant whose samples a module sees.
    links
        Links by name.
    external
        Modules that a foreign node plays: etac_ros never starts them.
    ticks_per_second, end_tick
        The tick grid and the first tick that is not acted on.
    media
        Shared media by name.
    faults
        What happens to the processes of modules, in the order of the ticks at which it begins.
    spares
        By fault: the module that takes the place of one that is restarted.
    all_own
        Whether all classes in it are of etac_ros, which work in place on nothing that they are shown. Those of others
        get arrays of their own.
    """

    modules: Mapping[str, Module]
    reads: Mapping[str, str]
    links: Mapping[str, Link]
    ticks_per_second: int
    end_tick: int
    external: frozenset[str] = frozenset()
    media: Mapping[str, MediumPlan] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    spares: Mapping[str, Module] = field(default_factory=dict)
    all_own: bool = False

    def in_real_time(self) -> Graph:
        """The same, where real processes are stopped: what arrives late is noted by its receiver, and not computed."""
        links = {name: replace(link, channel=replace(link.channel, down={})) for name, link in self.links.items()}
        return replace(self, links=links)

    @cached_property
    def plants(self) -> tuple[str, ...]:
        """Names of the plants."""
        return tuple(name for name, module in self.modules.items() if isinstance(module, PlantModule))

    def faults_of(self, module: str) -> tuple[Fault, ...]:
        """What happens to the process of a module, in order."""
        return tuple(fault for fault in self.faults if fault.node == module)

    @cached_property
    def acknowledged(self) -> tuple[Link, ...]:
        """The links that are acknowledged."""
        return tuple(link for link in self.links.values() if link.acknowledged is not None)

    @cached_property
    def told(self) -> frozenset[str]:
        """The modules that are told what of theirs was acknowledged."""
        return frozenset(link.sender for link in self.acknowledged if link.acknowledged and link.acknowledged.told)

    @cached_property
    def reporters(self) -> tuple[str, ...]:
        """Names of the modules that report what they did: all but plants and those that only answer."""
        return tuple(
            name for name, module in self.modules.items() if not module.answers and not isinstance(module, PlantModule)
        )

    @cached_property
    def lookers(self) -> tuple[str, ...]:
        """Names of the modules that can act by themselves."""
        return tuple(name for name in self.reporters if not self.modules[name].passive)

    @cached_property
    def readers(self) -> Mapping[str, tuple[str, ...]]:
        """The modules that see each plant's windows."""
        return {plant: tuple(name for name in self.reporters if self.reads.get(name) == plant) for plant in self.plants}

    @cached_property
    def sends(self) -> Mapping[str, tuple[Link, ...]]:
        """Outgoing links of each module."""
        return {name: tuple(link for link in self.links.values() if link.sender == name) for name in self.modules}

    @cached_property
    def hears(self) -> Mapping[str, tuple[Link, ...]]:
        """Incoming links of each module."""
        return {name: tuple(link for link in self.links.values() if name in link.receivers) for name in self.modules}

    def needs_time(self, module: str) -> bool:
        """Whether a module has to know the tick of what arrives: to compute, find its sample or stamp its answers."""
        node = self.modules[module]
        stamps = any(link.wire.format is WireFormat.STAMPED for link in self.sends[module])
        return stamps or node.timed or node.passive

    def acts_on_arrival(self, module: str) -> bool:
        """Whether a message alone tells the module all it needs, so that it waits for no order.

        It never acts by itself, and is not told of acknowledgements. It has one input, which crosses no medium, is not
        acknowledged, and whose channel lets it tell from a message whether that arrives; and where it needs to know
        the time, the message has it.
        """
        incoming = self.hears[module]
        node = self.modules[module]
        if not (node.answers or node.passive) or len(incoming) != 1 or module in self.told:
            return False
        link = incoming[0]
        told = not self.needs_time(module) or link.wire.format is WireFormat.STAMPED
        return link.channel.told_by_message and not link.medium and link.acknowledged is None and told
