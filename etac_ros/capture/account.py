"""How many bytes went over the wire: by topic, by cause and by layer."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from pydantic import BaseModel, ConfigDict, Field


class _Model(BaseModel):
    model_config = ConfigDict(defer_build=True, extra="forbid")


class Cause(StrEnum):
    """Why something was sent on a topic."""

    DATA = "data"
    HEARTBEAT = "heartbeat"
    ACKNACK = "acknack"
    GAP = "gap"
    FRAGMENTS = "fragments"
    """Samples that are larger than a datagram, and what confirms their parts."""


class Layers(_Model):
    """Bytes of frames, each byte in one layer."""

    frames: int = Field(default=0, description="those whose headers are counted here")
    payload_bytes: int = Field(default=0, description="components of values alone; 0 where no value of a link is sent")
    cdr_bytes: int = Field(default=0, description="the rest of the serialized messages")
    rtps_bytes: int = Field(default=0, description="headers of RTPS messages, and submessages but for the above")
    udp_ip_bytes: int = 0
    ethernet_bytes: int = Field(default=0, description="headers of 14 bytes; neither preamble, check sequence nor gap")
    total_bytes: int = Field(default=0, description="all of these layers")

    @classmethod
    def of(cls, counts: Mapping[str, int]) -> Layers:
        """From frames and bytes by layer."""
        return cls(**counts, total_bytes=sum(count for name, count in counts.items() if name != "frames"))

    def __add__(self, other: Layers) -> Layers:
        return Layers(**{name: getattr(self, name) + getattr(other, name) for name in Layers.model_fields})


class TopicWire(_Model):
    """One topic on the wire."""

    messages: int = Field(description="samples of its writers that were seen, each once")
    resent: int = Field(description="samples sent once more to where they had been sent before")
    causes: dict[Cause, Layers] = Field(description="to and from its receivers, by cause")
    all_causes: Layers
    bytes_a_message: float | None = Field(description="all causes, by message; null where the recorder alone gets it")
    recorder: Layers = Field(description="to and from the recorder of etac_ros, which no spacecraft has")


class WireAccount(_Model):
    """Everything that was captured: topics, discovery, liveliness and other are all of its frames and bytes."""

    frames: int
    total_bytes: int = Field(description="of all captured frames, from the Ethernet header on")
    missed_frames: int = Field(description="that the system dropped before they were captured; 0 in a whole capture")
    statistics_bytes: int = Field(
        description="of the RTPS bytes: submessages that a Fast DDS with its statistics compiled in adds to each frame"
    )
    topics: dict[str, TopicWire]
    discovery: Layers = Field(description="who is there, and what it has: SPDP, SEDP and ros_discovery_info")
    liveliness: Layers
    other: dict[str, Layers] = Field(description="what belongs to none of these, by reason")

    @property
    def attributed(self) -> Layers:
        """The sum of all parts, which is that of the frames."""
        parts = [self.discovery, self.liveliness, *self.other.values()]
        for topic in self.topics.values():
            parts += [topic.all_causes, topic.recorder]
        return sum(parts, Layers())
