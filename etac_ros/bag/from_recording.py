"""Writing a bag from a recording in memory, for a run that no DDS carried; and showing it while it grows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path

import numpy as np

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns, tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.live import Viewer
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.state import StateStreams
from etac_ros.bag.topics import TopicDescription, link_topic, truth_topic
from etac_ros.graph import topics
from etac_ros.graph.air import to_rows
from etac_ros.graph.graph import Graph
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
    metadata, attachments, derive_with, state
        As for :class:`~etac_ros.bag.run_bag.RunBag`.

    Raises
    ------
    BagError
        If the bag cannot be written.
    """
    entries = _messages(graph, recording) + _truth(graph, recording) + _air(graph, recording)
    with RunBag(directory, graph, attachments, metadata, derive_with=derive_with, state=state) as writer:
        _write(writer, entries, graph.ticks_per_second)


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
        self._shown = Recording({name: [] for name in graph.links}, {name: [] for name in graph.plants})

    def follow(self, tick: int) -> None:
        """Show what has happened before a tick, which is being worked on."""
        fresh = Recording()
        for name, shown in self._shown.messages.items():
            fresh.messages[name] = [one for one in self._recording.messages[name][len(shown) :] if one.tick < tick]
            shown += fresh.messages[name]
        for name, chunks in self._shown.truth.items():
            news = self._recording.truth[name][len(chunks) :]
            fresh.truth[name] = [chunk for chunk in news if chunk[0] + chunk[1].shape[0] <= tick]
            chunks += fresh.truth[name]
        fresh.air = self._recording.air[len(self._shown.air) :]
        self._shown.air += fresh.air
        entries = _messages(self._graph, fresh) + _truth(self._graph, fresh)
        _write(self._bag, entries + _air(self._graph, fresh), self._graph.ticks_per_second)

    def close(self) -> None:
        """Show the rest, and no more."""
        self.follow(self._graph.end_tick + 1)
        self._bag.close()


def _write(writer: RunBag, entries: list[_Entry], ticks_per_second: int) -> None:
    for (tick, step, _, sequence), topic, serialized in sorted(entries, key=lambda entry: entry[0]):
        published = tick_time_ns(tick, ticks_per_second)
        writer.placed_until(published)  # they are sorted
        writer.write(topic, serialized(), log_time_ns(published, step), published, sequence)


def _messages(graph: Graph, recording: Recording) -> list[_Entry]:
    entries: list[_Entry] = []
    for place, link in enumerate(graph.links.values()):
        topic = link_topic(link)
        for message in recording.messages.get(link.name, []):
            stamp = tick_time_ns(message.tick, graph.ticks_per_second)
            serialized = partial(encode, topic.type_name, message.value, stamp)
            entries.append(((message.tick, message.step, place, message.sequence), topic.name, serialized))
    return entries


def _air(graph: Graph, recording: Recording) -> list[_Entry]:
    rows = to_rows(recording.air, list(graph.links))
    tick = max((landing_tick(fate.end_ns, graph.ticks_per_second) for fate in recording.air), default=0)
    place = len(graph.links) + len(graph.plants)
    return [
        ((tick, AFTER_ALL_STEPS, place, 1 + number), topics.AIR, partial(encode_truth, tick, some))
        for number, some in enumerate(np.split(rows, range(MOST_SAMPLES, rows.shape[0], MOST_SAMPLES)))
        if some.size
    ]


def _truth(graph: Graph, recording: Recording) -> list[_Entry]:
    entries: list[_Entry] = []
    for place, plant in enumerate(graph.plants):
        topic = truth_topic(plant)
        sequence = 0
        for first, samples in recording.truth.get(plant, []):
            for start in range(0, samples.shape[0], MOST_SAMPLES):
                part = samples[start : start + MOST_SAMPLES]
                last = first + start + part.shape[0] - 1
                sequence += 1
                serialized = partial(encode_truth, first + start, part)
                entries.append(((last, AFTER_ALL_STEPS, len(graph.links) + place, sequence), topic.name, serialized))
    return entries
