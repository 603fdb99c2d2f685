"""Writing a bag from a recording in memory, for a run that no DDS carried; and showing it while it grows."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns, tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.compression import Compression
from etac_ros.bag.live import Viewer
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.state import StateStreams
from etac_ros.bag.topics import TopicDescription, link_topic, truth_topic
from etac_ros.graph import topics
from etac_ros.graph.air import to_rows
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.recording import Recording
from etac_ros.graph.truth import MOST_SAMPLES
from etac_ros.media.frame import landing_tick

_Entry = tuple[tuple[int, int, int, int], str, Callable[[], bytes]]
"""Place in the bag (tick, step, topic, sequence), topic, and how to serialize the message."""


def write_recording(
    directory: Path,
    graph: Graph,
    recording: Recording,
    metadata: Mapping[str, str],
    attachments: Mapping[str, bytes],
    derive_with: Graph | None = None,
    state: StateStreams | None = None,
    compression: Compression = Compression.NONE,
    every: int = 1,
) -> None:
    """Write all messages and all truth of a run, in the order in which things happened.

    Parameters
    ----------
    directory
        The bag that is made.
    graph
        The graph that ran.
    recording
        What it left behind.
    metadata, attachments, derive_with, state, compression, every
        As for :class:`~etac_ros.bag.run_bag.RunBag`.

    Raises
    ------
    BagError
        If the bag cannot be written.
    """
    with RunBag(
        directory,
        graph,
        attachments,
        metadata,
        derive_with=derive_with,
        state=state,
        compression=compression,
        every=every,
    ) as writer:
        _write(writer, graph, recording)


class Follower:
    """Shows a recording while a run makes it, as a recorder shows what it writes; no file is written.

    Parameters
    ----------
    graph
        What runs.
    recording
        What grows.
    live
        As for :class:`~etac_ros.bag.run_bag.RunBag`.
    state
        As for :class:`~etac_ros.bag.run_bag.RunBag`.
    """

    def __init__(
        self,
        graph: Graph,
        recording: Recording,
        live: Callable[[Sequence[TopicDescription]], Viewer],
        state: StateStreams | None = None,
    ) -> None:
        self._graph = graph
        self._recording = recording
        self._bag = RunBag(None, graph, {}, {}, state=state, live=live)
        self._messages = dict.fromkeys(graph.links, 0)
        self._chunks = dict.fromkeys(graph.plants, 0)
        self._fates = 0
        """How much of each has been shown."""

    def follow(self, tick: int) -> None:
        """Show what has happened before a tick, which is being worked on."""
        fresh = Recording(air=self._recording.air[self._fates :])
        self._fates += len(fresh.air)
        for name, shown in self._messages.items():
            fresh.messages[name] = [one for one in self._recording.messages[name][shown:] if one.tick < tick]
            self._messages[name] += len(fresh.messages[name])
        truth = {}
        for name, shown in self._chunks.items():
            news = self._recording.truth[name][shown:]
            truth[name] = [chunk for chunk in news if chunk[0] + chunk[1].shape[0] <= tick]
            self._chunks[name] += len(truth[name])
        fresh.truth = truth
        _write(self._bag, self._graph, fresh)

    def close(self) -> None:
        """Show the rest, and no more."""
        self.follow(self._graph.end_tick + 1)
        self._bag.close()


def _write(writer: RunBag, graph: Graph, recording: Recording) -> None:
    # Each part is sorted by itself and made as it is needed: a long run need not stand in memory twice.
    parts = [*_messages(graph, recording), *_truth(graph, recording), iter(_air(graph, recording))]
    for (tick, step, _, sequence), topic, serialized in heapq.merge(*parts, key=lambda entry: entry[0]):
        published = tick_time_ns(tick, graph.ticks_per_second)
        writer.placed_until(published)  # they are sorted
        writer.write(topic, serialized(), log_time_ns(published, step), published, sequence)


def _messages(graph: Graph, recording: Recording) -> list[Iterator[_Entry]]:
    return [_of_link(graph, recording, place, link) for place, link in enumerate(graph.links.values())]


def _of_link(graph: Graph, recording: Recording, place: int, link: Link) -> Iterator[_Entry]:
    topic = link_topic(link)
    for message in sorted(recording.messages.get(link.name, ()), key=lambda one: (one.tick, one.step, one.sequence)):
        stamp = tick_time_ns(message.tick, graph.ticks_per_second)
        serialized = partial(encode, topic.type_name, message.value, stamp)
        yield (message.tick, message.step, place, message.sequence), topic.name, serialized


def _air(graph: Graph, recording: Recording) -> list[_Entry]:
    rows = to_rows(recording.air, list(graph.links))
    tick = max((landing_tick(fate.end_ns, graph.ticks_per_second) for fate in recording.air), default=0)
    place = len(graph.links) + len(graph.plants)
    return [
        ((tick, AFTER_ALL_STEPS, place, 1 + number), topics.AIR, partial(encode_truth, tick, some))
        for number, some in enumerate(np.split(rows, range(MOST_SAMPLES, rows.shape[0], MOST_SAMPLES)))
        if some.size
    ]


def _truth(graph: Graph, recording: Recording) -> list[Iterator[_Entry]]:
    return [_of_plant(recording, len(graph.links) + place, plant) for place, plant in enumerate(graph.plants)]


def _of_plant(recording: Recording, place: int, plant: str) -> Iterator[_Entry]:
    topic = truth_topic(plant)
    sequence = 0
    for first, samples in recording.truth.get(plant, ()):
        for start in range(0, samples.shape[0], MOST_SAMPLES):
            part = samples[start : start + MOST_SAMPLES]
            last = first + start + part.shape[0] - 1
            sequence += 1
            serialized = partial(encode_truth, first + start, part)
            yield (last, AFTER_ALL_STEPS, place, sequence), topic.name, serialized
