"""Who is who on the wire, learned from the discovery data that is captured with everything else.

OMG DDSI-RTPS 2.5: the simple discovery protocols SPDP and SEDP (8.5), their entity identifiers (9.3.1.5) and the
parameters of their data (9.6.3). What ROS 2 makes of a topic's name: design.ros2.org, "Topic and Service name mapping
to DDS": ``rt/`` stands before the name of a topic.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from etac_ros.capture.rtps import EntityId, Kind, Malformed, Order, Prefix, RtpsMessage, Submessage, parameters

SPDP = (bytes.fromhex("000100c2"), bytes.fromhex("000100c7"))
"""Writer and reader of the participants' announcements."""
PUBLICATIONS = (bytes.fromhex("000003c2"), bytes.fromhex("000003c7"))
SUBSCRIPTIONS = (bytes.fromhex("000004c2"), bytes.fromhex("000004c7"))
LIVELINESS = (bytes.fromhex("000200c2"), bytes.fromhex("000200c7"))
"""ParticipantMessageData: the liveliness of writers that assert it."""
ROS_DISCOVERY = "ros_discovery_info"
"""Topic on which the rmw layer tells which node has which endpoint."""

_PL_CDR: dict[bytes, Order] = {b"\x00\x02": "big", b"\x00\x03": "little"}
_TOPIC_NAME, _PARTICIPANT_GUID, _ENDPOINT_GUID = 0x0005, 0x0050, 0x005A
_LOCATORS = (0x002F, 0x0031, 0x0032)
"""Unicast locators: of an endpoint, of a participant by default, and for its discovery."""
_UDP_V4 = 1
_ROS_TOPIC = "rt/"

Address = tuple[bytes, int]


def is_built_in(entity: EntityId) -> bool:
    """Whether an entity belongs to the protocols of discovery and liveliness (9.3.1.2: the top bits of its kind)."""
    return entity[3] & 0xC0 == 0xC0


@dataclass
class Directory:
    """Topics by endpoint, and participants by address.

    Attributes
    ----------
    topics
        Name of the topic, as ROS has it, of each writer and each reader that was announced.
    participants
        Who listens at an address.
    """

    topics: dict[tuple[Prefix, EntityId], str] = field(default_factory=dict)
    participants: dict[Address, Prefix] = field(default_factory=dict)

    def learn(self, messages: Iterable[RtpsMessage]) -> None:
        """Take in what messages announce."""
        for message in messages:
            for submessage in message.submessages:
                if submessage.kind == Kind.DATA and submessage.writer in (SPDP[0], PUBLICATIONS[0], SUBSCRIPTIONS[0]):
                    try:
                        self._learn(submessage)
                    except Malformed:
                        continue  # its bytes are counted all the same

    def participants_of(self, topic: str) -> set[Prefix]:
        """Whose endpoints of a topic were announced."""
        return {prefix for (prefix, _), name in self.topics.items() if name == topic}

    def topic_of(self, prefix: Prefix, submessage: Submessage) -> str | None:
        """The topic of a submessage's writer.

        Where it comes from a reader, as an ACKNACK does, the message's sender has the reader, and the reader's topic
        is the writer's.
        """
        if submessage.kind in (Kind.ACKNACK, Kind.NACK_FRAG):
            return self.topics.get((prefix, submessage.reader))
        return self.topics.get((prefix, submessage.writer))

    def _learn(self, submessage: Submessage) -> None:
        data = submessage.serialized
        order = _PL_CDR.get(data[:2])
        if order is None:
            return
        topic, guid, addresses = None, b"", []
        for number, value, _ in parameters(data, 4, order):
            if number == _TOPIC_NAME and len(value) >= 4:
                length = int.from_bytes(value[:4], order)
                topic = value[4 : 4 + length].rstrip(b"\0").decode(errors="replace")
            elif number in (_ENDPOINT_GUID, _PARTICIPANT_GUID) and len(value) == 16:
                guid = guid if number == _PARTICIPANT_GUID and guid else value
            elif number in _LOCATORS and len(value) == 24 and int.from_bytes(value[:4], order) == _UDP_V4:
                addresses.append((value[20:24], int.from_bytes(value[4:8], order)))
        if not guid:
            return
        for address in addresses:
            self.participants[address] = guid[:12]
        if topic is not None:
            self.topics[guid[:12], guid[12:]] = ros_name(topic)


def ros_name(topic: str) -> str:
    """A topic's name in ROS; that of what is no ROS topic stays as it is."""
    return f"/{topic.removeprefix(_ROS_TOPIC)}" if topic.startswith(_ROS_TOPIC) else topic
