"""RTPS messages: the header, the submessages, and of each what is needed to know whose it is.

OMG DDSI-RTPS 2.5: header (8.3.3, 9.4.1), submessages and their headers (8.3.4, 9.4.5), entity identifiers (9.3.1.2,
9.3.1.5). Nothing is decoded that is not asked for, and nothing is ever taken from outside a submessage.
"""

from __future__ import annotations

from collections.abc import Iterator
from enum import IntEnum
from typing import Literal, NamedTuple

HEADER_BYTES = 20
SUBMESSAGE_HEADER_BYTES = 4
_MAGIC = b"RTPS"


class Kind(IntEnum):
    """Submessages (table 9.13), and one of the vendor of Fast DDS."""

    PAD = 0x01
    ACKNACK = 0x06
    HEARTBEAT = 0x07
    GAP = 0x08
    INFO_TS = 0x09
    INFO_SRC = 0x0C
    INFO_REPLY_IP4 = 0x0D
    INFO_DST = 0x0E
    INFO_REPLY = 0x0F
    NACK_FRAG = 0x12
    HEARTBEAT_FRAG = 0x13
    DATA = 0x15
    DATA_FRAG = 0x16
    STATISTICS = 0x80
    """Of Fast DDS, where it was compiled with its statistics: locator, time and counts of what was sent."""


FROM_WRITER = (Kind.DATA, Kind.DATA_FRAG, Kind.HEARTBEAT, Kind.HEARTBEAT_FRAG, Kind.GAP)
FROM_READER = (Kind.ACKNACK, Kind.NACK_FRAG)
_READER_AND_WRITER = {
    Kind.DATA: 4,
    Kind.DATA_FRAG: 4,
    Kind.HEARTBEAT: 0,
    Kind.HEARTBEAT_FRAG: 0,
    Kind.GAP: 0,
    Kind.ACKNACK: 0,
    Kind.NACK_FRAG: 0,
}
"""Where readerEntityId stands in the body; writerEntityId follows it."""

Prefix = bytes
"""The 12 bytes that all entities of a participant have in common."""
EntityId = bytes
"""The 4 bytes that tell them apart."""
Order = Literal["little", "big"]


class Malformed(ValueError):
    """What was captured is no RTPS message."""


class Submessage(NamedTuple):
    """One submessage.

    Attributes
    ----------
    kind
        Also of vendors and of later versions: then no member of :class:`Kind`.
    size
        Header included [bytes].
    destination
        Participant for which it is, by an INFO_DST before it; empty for all.
    """

    kind: int
    flags: int
    size: int
    body: bytes
    destination: Prefix

    @property
    def order(self) -> Order:
        """Byte order of its numbers."""
        return "little" if self.flags & 1 else "big"

    @property
    def of_entity(self) -> bool:
        """Whether a writer or a reader has sent it, instead of telling something of the message."""
        return self.kind in _READER_AND_WRITER

    @property
    def reader(self) -> EntityId:
        """The reader for which it is, or whose it is."""
        return self._entity(0)

    @property
    def writer(self) -> EntityId:
        """The writer whose it is, or for which it is."""
        return self._entity(4)

    def _entity(self, offset: int) -> EntityId:
        start = _READER_AND_WRITER[Kind(self.kind)] + offset
        if len(self.body) < start + 4:
            raise Malformed("a submessage without an entity")
        return self.body[start : start + 4]

    @property
    def sequence(self) -> int:
        """Sequence number of a DATA or DATA_FRAG: SequenceNumber_t, high and low word (9.3.2.3)."""
        if len(self.body) < 20:
            raise Malformed("data without a sequence number")
        return (self._number(12, 4) << 32) + self._number(16, 4)

    @property
    def serialized(self) -> bytes:
        """What a DATA carries: the serialized payload with its encapsulation header; empty for a key, or nothing.

        It begins after the inline QoS, a parameter list (9.4.2.11), where flag Q says that there is one. A DATA_FRAG
        has four more members before it: number and count of fragments, their size, and that of the sample.
        """
        with_data, with_inline_qos = (0x04, 0x02) if self.kind == Kind.DATA else (~0, 0x02)
        if not self.flags & with_data:
            return b""
        start = 4 + self._number(2, 2)
        if self.flags & with_inline_qos:
            start = self._end_of_parameters(start)
        if start > len(self.body):
            raise Malformed("data that begins behind its end")
        return self.body[start:]

    def _end_of_parameters(self, start: int) -> int:
        for number, _, end in parameters(self.body, start, self.order):
            if number == SENTINEL:
                return end
        raise Malformed("inline QoS without an end")

    def _number(self, start: int, size: int) -> int:
        if len(self.body) < start + size:
            raise Malformed("a submessage that ends in a number")
        return int.from_bytes(self.body[start : start + size], self.order)


SENTINEL = 0x0001
"""PID_SENTINEL ends a parameter list."""


def parameters(data: bytes, start: int, order: Order) -> Iterator[tuple[int, bytes, int]]:
    """Number, value, and end of each parameter of a list (9.4.2.11), its sentinel included.

    Raises
    ------
    Malformed
        If a parameter ends behind the list.
    """
    while start + 4 <= len(data):
        number = int.from_bytes(data[start : start + 2], order)
        size = 0 if number == SENTINEL else int.from_bytes(data[start + 2 : start + 4], order)
        end = start + 4 + size
        if end > len(data):
            raise Malformed("a parameter that ends behind its list")
        yield number, data[start + 4 : end], end
        if number == SENTINEL:
            return
        start = end


class RtpsMessage(NamedTuple):
    """One RTPS message.

    Attributes
    ----------
    prefix
        Participant that sent it.
    header_bytes
        Of the message alone; together with the sizes of the submessages it is the whole message.
    """

    prefix: Prefix
    header_bytes: int
    submessages: tuple[Submessage, ...]


def parse(content: bytes) -> RtpsMessage:
    """Take an RTPS message apart.

    Raises
    ------
    Malformed
        If it is none, or if it ends before one of its submessages.
    """
    if len(content) < HEADER_BYTES or content[:4] != _MAGIC:
        raise Malformed("no RTPS header")
    found: list[Submessage] = []
    destination, start = b"", HEADER_BYTES
    while start < len(content):
        if len(content) < start + SUBMESSAGE_HEADER_BYTES:
            raise Malformed("half the header of a submessage")
        kind, flags = content[start], content[start + 1]
        length = int.from_bytes(content[start + 2 : start + 4], "little" if flags & 1 else "big")
        begin = start + SUBMESSAGE_HEADER_BYTES
        # 9.4.5.1.3: a length of 0 is that of the rest of the message, but for PAD and INFO_TS, which may be empty.
        end = len(content) if length == 0 and kind not in (Kind.PAD, Kind.INFO_TS) else begin + length
        if end > len(content):
            raise Malformed("a submessage that ends behind its message")
        body = content[begin:end]
        if kind == Kind.INFO_DST:
            if len(body) < 12:
                raise Malformed("a destination that is none")
            destination = body[:12] if any(body[:12]) else b""  # unknown stands for everybody
        found.append(Submessage(kind, flags, end - start, body, destination))
        start = end
    return RtpsMessage(content[8:20], HEADER_BYTES, tuple(found))
