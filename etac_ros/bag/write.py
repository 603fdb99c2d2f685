"""Writing a bag: a rosbag2 directory with one MCAP file."""

from __future__ import annotations

import contextlib
import os
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from mcap.writer import LIBRARY_IDENTIFIER, CompressionType, Writer

from etac_ros import __version__
from etac_ros.bag.compression import Compression
from etac_ros.bag.definitions import offered_qos_yaml, schema_text, type_hash
from etac_ros.bag.lock import give_back, take
from etac_ros.bag.metadata import bag_information, to_yaml, write_metadata
from etac_ros.bag.reserve import claim, is_reserved
from etac_ros.bag.run_metadata import RECORD_NAME, sealed, ticks_per_second
from etac_ros.bag.topics import TopicDescription, to_channel_metadata
from etac_ros.errors import BagError

_CHUNK_BYTES = 128 * 1024
"""The index at the end of a file has an entry a chunk, and whoever writes keeps it until then; a chunk also ends after
half a second, and before anything is acknowledged."""
_FLUSH_AFTER_S = 0.5
_WANTED = "a bag directory that is not there yet, in a place that may be written to"


def check_writable(directory: Path) -> None:
    """Make sure that a bag can be created here, and leave nothing there.

    Raises
    ------
    BagError
        If something stands there already, or nothing may be created there.
    """
    if os.path.lexists(directory) and not is_reserved(directory):
        raise _occupied(directory)
    parent = next(path for path in directory.absolute().parents if os.path.lexists(path))
    if not parent.is_dir():
        raise BagError(str(directory), f"{parent} is no directory", _WANTED, "choose another")
    if not os.access(parent, os.W_OK | os.X_OK):
        raise BagError(str(directory), f"{parent} may not be written to", _WANTED, "choose another")
    try:
        with contextlib.suppress(FileNotFoundError):
            os.lstat(directory)  # else: a name that is too long
        os.rmdir(tempfile.mkdtemp(prefix=".etac_", dir=parent))  # permissions alone do not say: not of /proc, say
    except OSError as error:
        raise BagError(str(directory), f"cannot be made: {error.strerror}", _WANTED, "choose another") from None


def _occupied(directory: Path) -> BagError:
    return BagError(str(directory), "exists already", _WANTED, "choose another, or remove it")


class BagWriter:
    """Writes one bag. Whatever was flushed survives a killed process.

    It makes the directory itself, so two writers never share one, and keeps a lock on the file until it is closed,
    so nobody repairs what is still being written.

    Parameters
    ----------
    directory
        Created by this; ``NAME/NAME_0.mcap`` and, at the end, ``NAME/metadata.yaml``.
    topics
        All topics that will be written.
    attachments
        Files to keep with the run by name, the resolved scenario above all.
    metadata
        What is known of the run, as text by key; ``ticks_per_second`` must be there.
    compression
        Of the chunks.

    Raises
    ------
    BagError
        If the directory exists or cannot be created, a type is not known, or ``ticks_per_second`` is missing.
    """

    def __init__(
        self,
        directory: Path,
        topics: Sequence[TopicDescription],
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, str],
        compression: Compression = Compression.NONE,
    ) -> None:
        check_writable(directory)
        try:
            ticks_per_second(metadata)
        except ValueError as error:
            raise BagError(str(directory), str(error), "a whole number, as text") from None
        self._directory = directory
        self._mcap_path = directory / f"{directory.absolute().name}_0.mcap"
        self._metadata = dict(metadata)
        self._topics = tuple(topics)
        self._counts = {topic.name: 0 for topic in topics}
        self._first_ns: int | None = None
        self._last_ns = 0
        types = dict.fromkeys(topic.type_name for topic in topics)
        definitions = {name: (schema_text(name), type_hash(name)) for name in types}
        try:
            claim(directory)
            self._file = self._mcap_path.open("xb")
            take(self._file)
            self._mcap = self._begin(attachments, compression)
        except FileExistsError:
            raise _occupied(directory) from None
        except OSError as error:
            raise self._failed(error) from error
        self._channels = self._announce(definitions)
        self.flush()

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        """Add one message.

        Parameters
        ----------
        topic
            One of the topics given at the start.
        cdr
            The serialized message as it came off the wire.
        log_time_ns, publish_time_ns
            Simulated time of its tick and step, and of its tick (:mod:`etac_ros.bag.clock`).
        sequence
            Its number on the topic: 1, 2, ...

        Raises
        ------
        BagError
            If the disk is full, or the topic is none of the bag's.
        """
        channel = self._channels.get(topic)
        if channel is None:
            known = ", ".join(self._channels)
            raise BagError(str(self._directory), f"a message on {topic}", f"topics: {known}")
        try:
            self._mcap.add_message(channel, log_time_ns, cdr, publish_time_ns, sequence)
        except OSError as error:
            raise self._failed(error) from error
        self._counts[topic] += 1
        if self._first_ns is None or log_time_ns < self._first_ns:
            self._first_ns = log_time_ns
        if log_time_ns > self._last_ns:
            self._last_ns = log_time_ns
        # Wall time decides only where one chunk ends and the next begins, never what stands in them.
        if time.monotonic() - self._flushed > _FLUSH_AFTER_S:
            self.flush()

    def flush(self) -> None:
        """End the open chunk and hand it to the operating system: a kill can no longer take it back.

        Messages wait in the open chunk until it is full. :meth:`write` flushes after half a second, but only
        when there is something to write: in a run that pauses, whoever owns this writer has to.
        """
        try:
            # Public since mcap 1.5: ends the chunk, empties the record buffer and flushes our file.
            self._mcap.flush()
        except OSError as error:
            raise self._failed(error) from error
        self._flushed = time.monotonic()

    def close(self) -> None:
        """Finish the bag: index, checksums, ``metadata.yaml``. A second call does nothing."""
        if self._file.closed:
            return
        counts = {topic: self._counts[topic.name] for topic in self._topics}
        first_ns = self._first_ns or 0
        information = bag_information(self._mcap_path.name, counts, first_ns, self._last_ns, self._metadata)
        try:
            with self._file:
                # With this record rosbag2 understands the file by itself too: `ros2 bag info FILE.mcap`.
                self._mcap.add_metadata("rosbag2", {"serialized_metadata": to_yaml(information)})
                self._mcap.finish()
                write_metadata(self._directory, information)
                give_back(self._file)
        except OSError as error:
            raise self._failed(error) from error

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _begin(self, attachments: Mapping[str, bytes], compression: Compression) -> Any:
        # With the data checksum every single byte of a closed bag is checked, not those of the chunks alone.
        mcap: Any = Writer(
            self._file,
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType[compression.name],
            enable_crcs=True,
            enable_data_crcs=True,
        )
        mcap.start(profile="ros2", library=f"etac_ros {__version__}, {LIBRARY_IDENTIFIER}")
        # Before any message, so that a bag that is cut off still knows whose it is.
        mcap.add_metadata(RECORD_NAME, sealed(self._metadata))
        for name, data in attachments.items():
            media_type = "application/yaml" if name.endswith(".yaml") else "application/octet-stream"
            mcap.add_attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data)
        return mcap

    def _announce(self, definitions: Mapping[str, tuple[str, str]]) -> dict[str, int]:
        schemas = {
            name: self._mcap.register_schema(name, "ros2msg", text.encode()) for name, (text, _) in definitions.items()
        }
        channels = {}
        for topic in self._topics:
            keys = {
                "offered_qos_profiles": offered_qos_yaml(topic.reliability.value, topic.latched),
                "topic_type_hash": definitions[topic.type_name][1],
                **to_channel_metadata(topic),
            }
            schema = schemas[topic.type_name]
            channels[topic.name] = self._mcap.register_channel(topic.name, "cdr", schema, keys)
        return channels

    def _failed(self, error: OSError) -> BagError:
        return BagError(
            str(self._directory),
            f"the bag cannot be written: {error.strerror or error}",
            "a disk that can be written to and has space left",
            "free some space, or choose another directory",
        )
