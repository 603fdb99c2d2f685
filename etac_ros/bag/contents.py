"""What the records of a bag say: topics, messages, attachments and what is known of the run."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Metadata, Schema, Statistics

from etac_ros.bag.clock import published_ns, step_of
from etac_ros.bag.records import Record, damaged, record_at, records
from etac_ros.bag.run_metadata import RECORD_NAME, unsealed, wall_clock
from etac_ros.bag.topics import TopicDescription, from_channel_metadata
from etac_ros.errors import BagError
from etac_ros.maths.ticks import nanoseconds
from etac_ros.maths.wall_clock import WallClock

_MESSAGE = struct.Struct("<HIQQ")


class RawMessage(NamedTuple):
    """One message of a bag as it was recorded."""

    topic: TopicDescription
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    cdr: bytes

    @property
    def tick_time_ns(self) -> int:
        """Simulated time of its tick [ns]."""
        return published_ns(self.log_time_ns, self.publish_time_ns)

    @property
    def step(self) -> int:
        """Its step within the tick; ValueError if the two times are not those of one step."""
        return step_of(self.log_time_ns, self.publish_time_ns)


class RealTimeMessage(RawMessage):
    """One message of the bag of a real-time run.

    Its two times are of the wall clock: when it was received, and when it was published.

    Attributes
    ----------
    wall
        The instants of ticks.
    """

    wall: WallClock

    @property
    def tick_time_ns(self) -> int:
        """Simulated time of the tick in which it was published [ns]."""
        return nanoseconds(max(0, self.wall.tick_at(self.publish_time_ns)), self.wall.ticks_per_second)

    @property
    def step(self) -> int:
        """None: in real time all is as it came."""
        return 0


class Contents:
    """Everything in an MCAP file but its messages, gathered while these pass by.

    Parameters
    ----------
    path
        The file.

    Attributes
    ----------
    topics
        By channel.
    metadata
        What is known of the run; empty before its record was met.
    attachments
        By name.
    announced
        Messages by channel as the statistics at the end of the file say; None before they were met.
    place
        Where the message stands that :meth:`messages` has handed out last: for :func:`read_again`.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, TopicDescription] = {}
        self.metadata: dict[str, str] = {}
        self.attachments: dict[str, bytes] = {}
        self.announced: dict[int, int] | None = None
        self.place = (-1, -1)
        self._wall: WallClock | None = None
        self._types: dict[int, str] = {}
        self._chunked: bool | None = None

    def messages(self) -> Iterator[RawMessage]:
        """Read the file from its beginning.

        Raises
        ------
        DamagedBagError
            At the first place that is not whole, after all messages before it.
        BagError
            If the file is no bag of etac_ros.
        """
        for record in records(self.path):
            try:
                message = self._take(record)
            except (struct.error, ValueError, LookupError, OverflowError, McapError) as error:
                raise damaged(self.path, record.offset, f"this record makes no sense ({error})") from None
            if message is not None:
                self.place = (record.offset, record.chunk)
                yield message

    def _take(self, record: Record) -> RawMessage | None:
        # Schemas and channels stand a second time in the summary, whose checksum comes too late to vouch for
        # them. They are needed from there only if there are no chunks: then there is no message to spoil.
        self._keep_to_one_form(record)
        vouched = record.in_chunk or not self._chunked
        if record.opcode == Opcode.MESSAGE:  # nearly all records are messages
            channel_id, sequence, log_time, publish_time = _MESSAGE.unpack_from(record.content)
            cdr = record.content[_MESSAGE.size :]
            values = (self.topics[channel_id], log_time, publish_time, sequence, cdr)
            if self._wall is None:
                return RawMessage(*values)
            message = RealTimeMessage(*values)
            message.wall = self._wall
            return message
        stream = ReadDataStream(BytesIO(record.content))
        match record.opcode:
            case Opcode.SCHEMA if vouched:
                schema = Schema.read(stream)
                self._types[schema.id] = schema.name
            case Opcode.CHANNEL if vouched:
                channel = Channel.read(stream)
                topic = self._topic(channel)
                if self.topics.setdefault(channel.id, topic) != topic:
                    raise ValueError(f"channel {channel.id} is {self.topics[channel.id].name}, then {topic.name}")
                if any(other.name == topic.name and other != topic for other in self.topics.values()):
                    raise ValueError(f"two channels say different things of topic {topic.name}")
            case Opcode.STATISTICS:
                self.announced = dict(Statistics.read(stream).channel_message_counts)
            case Opcode.METADATA:
                entry = Metadata.read(stream)
                if entry.name == RECORD_NAME:
                    self.metadata = unsealed(entry.metadata)
                    self._wall = wall_clock(self.metadata)
            case Opcode.ATTACHMENT:
                attachment = Attachment.read(stream)
                (crc,) = struct.unpack("<I", record.content[-4:])
                if crc not in (0, zlib.crc32(record.content[:-4])):
                    raise ValueError("the checksum of this attachment is wrong")
                self.attachments[attachment.name] = attachment.data
        return None

    def _keep_to_one_form(self, record: Record) -> None:
        # Writers put all messages into chunks, or none. A chunk whose opcode was changed would look like a message.
        if not record.in_chunk and record.opcode != Opcode.MESSAGE:
            return
        if self._chunked is None:
            self._chunked = record.in_chunk
        if self._chunked != record.in_chunk:
            raise ValueError("some messages stand in chunks and some do not")

    def _topic(self, channel: Channel) -> TopicDescription:
        topic = from_channel_metadata(channel.topic, self._types[channel.schema_id], channel.metadata)
        if topic is None:
            found = f"nothing tells what part topic {channel.topic} had in a run"
            raise BagError(str(self.path), found, "a bag that etac_ros recorded")
        return topic


def read_again(file: BinaryIO, path: Path, place: tuple[int, int]) -> bytes:
    """The serialized message at a place that :class:`Contents` has passed.

    Raises
    ------
    DamagedBagError
        If it does not stand there any more.
    """
    record = record_at(file, path, *place)
    if record.opcode != Opcode.MESSAGE or len(record.content) < _MESSAGE.size:
        raise damaged(path, record.offset, "this is not the message that stood here before")
    return record.content[_MESSAGE.size :]


def mcap_file(directory: Path) -> Path:
    """Find the one MCAP file of a bag.

    Raises
    ------
    BagError
        If there is no such directory, or it is no bag.
    """
    wanted = "the directory of a bag"
    if not directory.is_dir():
        if directory.exists():
            raise BagError(str(directory), "is a file", wanted, "name the directory that it stands in")
        raise BagError(str(directory), "is not there", wanted)
    files = sorted(path for path in directory.glob("*.mcap") if path.is_file())
    if len(files) != 1:
        raise BagError(str(directory), f"it holds {len(files)} .mcap files", f"{wanted}, which holds one")
    return files[0]
