"""Reading a bag: what is in it, and the recording that it holds."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from etac_ros.bag.chunks import BagChunks
from etac_ros.bag.clock import tick_of
from etac_ros.bag.codec import decode, decode_truth
from etac_ros.bag.contents import Contents, RawMessage, mcap_file
from etac_ros.bag.lock import is_being_written
from etac_ros.bag.metadata import FILE_NAME, read_counts
from etac_ros.bag.run_metadata import ticks_per_second, truth_every, wall_clock
from etac_ros.bag.topics import AIR, TopicDescription
from etac_ros.errors import BagError
from etac_ros.graph.air import from_rows
from etac_ros.graph.ledger import Entry
from etac_ros.graph.ledger import from_rows as from_ledger_rows
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.spool import KEPT_BYTES
from etac_ros.graph.topics import node_of_ledger
from etac_ros.media.frame import Fate
from etac_ros.parameters import FloatArray

_Chunks = dict[str, list[tuple[int, FloatArray]]]
"""First tick and samples of each part, by node."""


@dataclass
class TopicCount:
    """How much of a topic there is.

    Attributes
    ----------
    first_ns, last_ns
        Simulated time of the first and of the last message [ns]; None without messages.
    """

    messages: int = 0
    cdr_bytes: int = 0
    first_ns: int | None = None
    last_ns: int | None = None

    def add(self, message: RawMessage) -> None:
        """Count one more."""
        time = message.tick_time_ns
        self.messages += 1
        self.cdr_bytes += len(message.cdr)
        self.first_ns = time if self.first_ns is None else min(self.first_ns, time)
        self.last_ns = time if self.last_ns is None else max(self.last_ns, time)


@dataclass(frozen=True)
class Bag:
    """A bag of which every byte has been checked.

    Attributes
    ----------
    directory, path
        The bag and its MCAP file.
    topics
        What there is of each topic, in the order in which the recorder announced them.
    metadata
        What is known of the run, as text by key.
    attachments
        Files kept with the run, by name.
    """

    directory: Path
    path: Path
    topics: dict[TopicDescription, TopicCount]
    metadata: dict[str, str]
    attachments: dict[str, bytes]

    @property
    def ticks_per_second(self) -> int:
        """Rate of the tick grid [1/s]."""
        return ticks_per_second(self.metadata)

    def messages(self) -> Iterator[RawMessage]:
        """Read all messages in the order in which they were written, afresh from the file."""
        return Contents(self.path).messages()

    def recording(self) -> Recording:
        """Read the messages of the links and the truth of the plants, as the engine had them in memory.

        Raises
        ------
        BagError
            If a message does not fit its topic or the tick grid, a sequence number stands twice, or the truth
            of a plant has gaps.
        """
        return self._everything()[0]

    def recording_and_derived(self) -> tuple[Recording, dict[str, FloatArray]]:
        """The recording, and by node what was derived of its plant's truth: a row a sample, for the samples there are.

        Raises
        ------
        BagError
            As :meth:`recording`, and likewise for what was derived.
        """
        recording, derived = self._everything()
        rows = {}
        for node, chunks in derived.items():
            self._check_continuous(f"derived of {node}", chunks, recording.every)
            rows[node] = np.concatenate([samples for _, samples in chunks]) if chunks else np.empty((0, 0))
        return recording, rows

    def _everything(self) -> tuple[Recording, _Chunks]:
        every = truth_every(self.metadata)
        links: dict[str, list[Message]] = {t.link: [] for t in self.topics if t.link is not None}
        truth: _Chunks = {t.plant: [] for t in self.topics if t.plant is not None}
        derived: _Chunks = {t.derived: [] for t in self.topics if t.derived is not None and t.derived != AIR}
        air: list[tuple[int, list[Fate]]] = []
        wall = wall_clock(self.metadata)
        ledgers: dict[str, list[Entry]] = {}
        contents = Contents(self.path)
        large = {plant: BagChunks(self.path, every) for plant in truth if self._is_large(plant)}
        widths: dict[str, int] = {}
        for raw in contents.messages():
            topic = raw.topic
            try:
                if topic.link is not None:
                    links[topic.link].append(self._message(raw))
                elif topic.plant is not None:
                    first, samples = self._samples(raw, every)
                    if topic.plant in large:
                        self._take_note(large[topic.plant], topic.plant, first, samples, contents.place, widths)
                    else:
                        truth[topic.plant].append((first, samples))
                elif topic.derived == AIR:
                    rows = decode_truth(raw.cdr)[1]
                    air.append((raw.sequence, from_rows(rows, list(links))))
                elif topic.derived is not None:
                    derived[topic.derived].append(self._samples(raw, every))
                elif (node := node_of_ledger(topic.name)) is not None:
                    ledgers.setdefault(node, []).extend(from_ledger_rows(decode_truth(raw.cdr)[1]))
            except ValueError as error:
                raise self._unfit(topic.name, f"message {raw.sequence}: {error}") from None
        for link, messages in links.items():
            messages.sort(key=lambda message: message.sequence)
            for before, after in pairwise(messages):
                if before.sequence == after.sequence:
                    raise self._unfit(f"link {link}", f"message {after.sequence} stands there twice")
        for plant, chunks in truth.items():
            self._check_continuous(f"truth of {plant}", chunks, every)
        fates = [fate for _, some in sorted(air, key=lambda item: item[0]) for fate in some]
        recording = Recording(links, {**truth, **large}, air=fates, wall=wall, ledgers=ledgers, every=every)
        return recording, derived

    def _is_large(self, plant: str) -> bool:
        return any(topic.plant == plant and count.cdr_bytes > KEPT_BYTES for topic, count in self.topics.items())

    def _take_note(
        self,
        chunks: BagChunks,
        plant: str,
        first: int,
        samples: FloatArray,
        place: tuple[int, int],
        widths: dict[str, int],
    ) -> None:
        """Remember where samples stand. So much is only ever recorded in order."""
        if len(chunks):
            due = chunks.first_tick + chunks.ticks - 1 + chunks.every
            self._check_joins(f"truth of {plant}", due, first, chunks.every, samples.shape[0])
            if samples.shape[1] != widths[plant]:
                raise self._unfit(f"truth of {plant}", f"the number of states changes at tick {first}")
        widths[plant] = samples.shape[1]
        chunks.add(first, samples.shape[0], place)

    def _message(self, raw: RawMessage) -> Message:
        tick = tick_of(raw.tick_time_ns, self.ticks_per_second)
        return Message(raw.sequence, tick, raw.step, decode(raw.topic.type_name, raw.cdr))

    def _samples(self, raw: RawMessage, every: int) -> tuple[int, FloatArray]:
        first, samples = decode_truth(raw.cdr)
        last = first + every * (samples.shape[0] - 1)
        logged = tick_of(raw.tick_time_ns, self.ticks_per_second)
        if logged != last:
            raise ValueError(f"it is logged at tick {logged} and ends with tick {last}")
        return first, samples

    def _check_continuous(self, what: str, chunks: list[tuple[int, FloatArray]], every: int) -> None:
        """Put chunks in order, and make sure that they join."""
        chunks.sort(key=lambda chunk: chunk[0])
        for (first, samples), (following, next_samples) in pairwise(chunks):
            self._check_joins(what, first + every * samples.shape[0], following, every, next_samples.shape[0])
            if next_samples.shape[1] != samples.shape[1]:
                raise self._unfit(what, f"the number of states changes at tick {following}")

    def _check_joins(self, what: str, due: int, following: int, every: int, rows: int) -> None:
        last = rows == 1 and due - every < following < due  # kept in any case
        if following != due and not last:
            raise self._unfit(what, f"tick {following} stands where tick {due} should")

    def _unfit(self, what: str, found: str) -> BagError:
        return BagError(f"{self.path}: {what}", found, "the messages of one run, each once, without gaps")


def read_bag(directory: Path) -> Bag:
    """Open a bag, going through it once and checking every byte.

    Raises
    ------
    BagError
        If there is no bag, it is still being written, it was cut off or damaged (the remedy is ``etac recover``), or
        it is not one of etac_ros.
    """
    path = mcap_file(directory)
    if is_being_written(path):
        raise BagError(
            str(directory), "is still being written", "a bag that was closed", "wait until its run has ended"
        )
    return read_file(directory, path)


def read_file(directory: Path, path: Path) -> Bag:
    """Open a bag by its MCAP file, whether or not somebody has that open. Otherwise as :func:`read_bag`."""
    announced = read_counts(directory)
    contents = Contents(path)
    counts: dict[str, TopicCount] = defaultdict(TopicCount)
    for message in contents.messages():
        counts[message.topic.name].add(message)
    check_origin(contents)
    topics = {topic: counts[topic.name] for topic in contents.topics.values()}
    found = {topic.name: count.messages for topic, count in topics.items()}
    _compare(directory, found, announced, FILE_NAME)
    if contents.announced is not None:
        in_statistics = dict.fromkeys(found, 0)
        for channel, messages in contents.announced.items():
            name = contents.topics[channel].name if channel in contents.topics else f"channel {channel}"
            in_statistics[name] = in_statistics.get(name, 0) + messages
        _compare(directory, found, in_statistics, "its statistics")
    return Bag(directory, path, topics, contents.metadata, contents.attachments)


def _compare(directory: Path, found: Mapping[str, int], announced: Mapping[str, int], where: str) -> None:
    if found == announced:
        return
    odd = next(name for name in [*found, *announced] if found.get(name) != announced.get(name))
    raise BagError(
        f"{directory}: {odd}",
        f"{found.get(odd, 0)} messages in the .mcap file, {announced.get(odd, 0)} in {where}",
        "the same number",
        f"etac recover {directory}",
    )


def check_origin(contents: Contents) -> None:
    """Make sure that etac_ros wrote this.

    Raises
    ------
    BagError
        If the metadata of the run is missing.
    """
    try:
        ticks_per_second(contents.metadata)
    except ValueError as error:
        raise BagError(str(contents.path), str(error), "a bag that etac_ros recorded") from None
