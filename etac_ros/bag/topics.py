"""What a bag says of each of its topics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, get_args

from etac_ros.graph import topics
from etac_ros.graph.graph import Graph, Link, LinkKind, Reliability
from etac_ros.graph.wire import TABLE_TYPE

TopicKind = Literal["network", "internal", "physical", "emulation", "derived", "state"]
"""The kinds of link, ``emulation`` for what only the simulation needs, and two for what was computed of truth while it
was recorded, and never sent: ``derived`` is for our own readers, ``state`` for everybody's (:mod:`etac_ros.bag.state`).
"""

_KIND_OF_LINK: dict[LinkKind, TopicKind] = {
    LinkKind.NETWORK: "network",
    LinkKind.INTERNAL: "internal",
    LinkKind.PHYSICAL: "physical",
}
SHAPE = "shape"
"""Last word of the topic that shows what a body looks like."""
AIR = "the air"
"""Of what the fates of frames are derived, where others have the name of a node."""
_RELIABILITY = "etac_ros.reliability"
_KIND, _LINK, _PLANT, _DERIVED = "etac_ros.kind", "etac_ros.link", "etac_ros.plant", "etac_ros.derived"


@dataclass(frozen=True, slots=True)
class TopicDescription:
    """One topic of a bag.

    Parameters
    ----------
    name, type_name
        ROS topic and type, for instance ``geometry_msgs/msg/Point32``.
    kind
        Where its messages are counted.
    link
        The link whose messages these are; None for any other topic.
    plant
        The plant whose committed samples (truth) these are; None for any other topic, windows included.
    derived
        The node of which this was derived (:mod:`etac_ros.bag.derived`); None for any other topic.
    reliability
        What its publisher offered.
    """

    name: str
    type_name: str
    kind: TopicKind
    link: str | None = None
    plant: str | None = None
    derived: str | None = None
    reliability: Reliability = Reliability.RELIABLE

    @property
    def latched(self) -> bool:
        """Whether late subscribers need its messages too: what is said once at the start of a run."""
        return self.kind == "state" and (self.name == topics.TF_STATIC or self.name.endswith(f"/{SHAPE}"))


def link_topic(link: Link) -> TopicDescription:
    """Describe the topic of a link."""
    kind = _KIND_OF_LINK[link.kind]
    return TopicDescription(link.topic, link.wire.type_name, kind, link=link.name, reliability=link.qos.reliability)


def truth_topic(plant: str) -> TopicDescription:
    """Describe the topic of a plant's committed samples, given the plant's full name."""
    return TopicDescription(topics.truth_topic(plant), TABLE_TYPE, "emulation", plant=plant)


def derived_topic(node: str) -> TopicDescription:
    """Describe the topic of what is derived of a plant's samples for a node, given its full name."""
    return TopicDescription(topics.derived_topic(node), TABLE_TYPE, "derived", derived=node)


AIR_TOPIC = TopicDescription(topics.AIR, TABLE_TYPE, "derived", derived=AIR)
"""What became of frames on shared media (:mod:`etac_ros.graph.air`): a table that the recorder writes itself."""


def recorded_topics(graph: Graph) -> tuple[TopicDescription, ...]:
    """Describe what every bag of a graph holds: its links, the truth of its plants, and what happened on media."""
    links = tuple(link_topic(link) for link in graph.links.values())
    air = (AIR_TOPIC,) if graph.media or graph.acknowledged else ()
    return links + tuple(truth_topic(plant) for plant in graph.plants) + air


def to_channel_metadata(topic: TopicDescription) -> dict[str, str]:
    """Make the keys that tell a topic's part in the run; they stand in the metadata of its MCAP channel."""
    keys = {_KIND: topic.kind, _LINK: topic.link, _PLANT: topic.plant, _DERIVED: topic.derived}
    if topic.reliability is not Reliability.RELIABLE:
        keys[_RELIABILITY] = topic.reliability.value
    return {key: value for key, value in keys.items() if value is not None}


def from_channel_metadata(name: str, type_name: str, metadata: Mapping[str, str]) -> TopicDescription | None:
    """Read the keys back: the inverse of :func:`to_channel_metadata`; None if they are not there."""
    for kind in get_args(TopicKind):
        if metadata.get(_KIND) == kind:
            link, plant, derived = (metadata.get(key) for key in (_LINK, _PLANT, _DERIVED))
            best_effort = metadata.get(_RELIABILITY) == Reliability.BEST_EFFORT
            offered = Reliability.BEST_EFFORT if best_effort else Reliability.RELIABLE
            return TopicDescription(name, type_name, kind, link, plant, derived, offered)
    return None
