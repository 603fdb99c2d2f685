"""The bag of a run while it is recorded: messages first, truth behind them, and what is derived of the truth."""

from __future__ import annotations

import sys
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import NamedTuple, Self

import numpy as np

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns, step_of, tick_of, tick_time_ns
from etac_ros.bag.codec import decode, decode_truth, encode_truth
from etac_ros.bag.compression import Compression
from etac_ros.bag.derived import derivations
from etac_ros.bag.description import DESCRIPTION_ATTACHMENT, describe_run, to_json
from etac_ros.bag.live import Viewer
from etac_ros.bag.run_metadata import TICKS_PER_SECOND, TRUTH_EVERY
from etac_ros.bag.state import StateStreams
from etac_ros.bag.topics import TopicDescription, derived_topic, recorded_topics, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.graph.graph import Graph
from etac_ros.graph.ledger import from_rows
from etac_ros.graph.spool import TruthFile
from etac_ros.graph.topics import ledger_topic
from etac_ros.maths.wall_clock import WallClock
from etac_ros.parameters import FloatArray

_MOST_HELD_BYTES = 1024 * 1024
_HELD_FOR_S = 0.5
_LARGE_BYTES = 4096
"""Before truth of this size a chunk ends, so that the messages before it are whole wherever the file ends in it."""


class _Held(NamedTuple):
    topic: str
    cdr: bytes
    log_time_ns: int
    publish_time_ns: int
    sequence: int
    since: float


class _NoFile:
    """Where nothing is kept."""

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        """Keep nothing."""

    def flush(self) -> None:
        """Nothing is on its way."""

    def close(self) -> None:
        """Nothing is open."""


class RunBag:
    """Writes the bag of one run.

    Truth comes by itself, and a message only once its place in time is known. So truth waits, within limits of bytes
    and time, until :meth:`placed_until` says that all messages up to its last tick are written: wherever the file
    ends, the messages that led to the samples in it are there.

    Parameters
    ----------
    directory
        Created by this; None writes no file, and only shows what would be in it.
    graph
        What runs.
    attachments, metadata
        As for :class:`~etac_ros.bag.write.BagWriter`; the description of the run and ``ticks_per_second`` are added.
    extra
        Topics beyond those of the links and the truth.
    derive_with
        A graph of the same scenario that no engine runs. With it, what only its classes can compute of the samples
        is recorded too. None where everybody has the classes.
    state
        What shows the state of the bodies; None shows none.
    wall
        The instants of ticks in a run in real time: they are then the times of the state, too.
    live
        Makes, of all topics, what shows messages while they are written; None shows none.
    compression
        Of the chunks.
    every
        Of the committed samples those at multiples of so many ticks are kept, and the last one; 0 keeps none. State and
        what is derived are made of all.
    whole
        Where all committed samples go if the bag does not keep them.

    Raises
    ------
    BagError
        If the bag cannot be created.
    RunError
        If a class of the scenario cannot say what its samples mean.
    """

    def __init__(
        self,
        directory: Path | None,
        graph: Graph,
        attachments: Mapping[str, bytes],
        metadata: Mapping[str, str],
        extra: Sequence[TopicDescription] = (),
        derive_with: Graph | None = None,
        state: StateStreams | None = None,
        wall: WallClock | None = None,
        live: Callable[[Sequence[TopicDescription]], Viewer] | None = None,
        compression: Compression = Compression.NONE,
        every: int = 1,
        whole: TruthFile | None = None,
    ) -> None:
        derived = () if derive_with is None else derivations(derive_with)
        self._derived = {truth_topic(plant).name: [d for d in derived if d.plant == plant] for plant in graph.plants}
        self._numbers: dict[str, int] = {}
        self._every = every
        self._whole = whole
        self._lasts: dict[str, tuple[int, FloatArray]] = {}
        description = describe_run(graph, {d.node: d.columns for d in derived})
        self._held: deque[_Held] = deque()
        self._held_bytes = 0
        self._led = False
        """Whether messages stand before the next samples, in the open chunk."""
        self._placed_ns = -1
        self._ticks_per_second = graph.ticks_per_second
        self._state = state
        self._wall = wall
        self._plants = {truth_topic(plant).name: plant for plant in graph.plants}
        self._to_plants = {
            link.topic: link for link in graph.links.values() if state is not None and state.hears(link.name)
        }
        in_real_time = state is not None and wall is not None
        self._ledgers = {ledger_topic(plant): plant for plant in graph.plants} if in_real_time else {}
        shown = () if state is None else state.topics
        topics = (*recorded_topics(graph), *extra, *(derived_topic(d.node) for d in derived), *shown)
        thinned = {} if every == 1 else {TRUTH_EVERY: str(every)}
        self._writer: BagWriter | _NoFile = _NoFile()
        if directory is not None:
            self._writer = BagWriter(
                directory,
                topics,
                {**attachments, DESCRIPTION_ATTACHMENT: to_json(description)},
                {**metadata, TICKS_PER_SECOND: str(graph.ticks_per_second), **thinned},
                compression,
            )
        self._live = None if live is None else live(topics)

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        """Add one message, as :meth:`~etac_ros.bag.write.BagWriter.write` does; truth waits for its messages."""
        if topic in self._derived:
            self._held.append(_Held(topic, cdr, log_time_ns, publish_time_ns, sequence, time.monotonic()))
            self._held_bytes += len(cdr)
        else:
            self._put(topic, cdr, log_time_ns, publish_time_ns, sequence)
            self._led = True
            if topic in self._to_plants:
                self._note_input(topic, cdr, log_time_ns, publish_time_ns, sequence)
            elif topic in self._ledgers:
                assert self._state is not None
                self._state.take_ledger(self._ledgers[topic], from_rows(decode_truth(cdr)[1]))
        self._release()

    def placed_until(self, tick_time_ns: int) -> None:
        """Take note that all messages up to a simulated time [ns] are written: truth up to there may follow."""
        self._placed_ns = max(self._placed_ns, tick_time_ns)
        self._release()

    def secure(self) -> None:
        """Hand what is written to the operating system: a kill cannot take it back. Truth that waits still waits."""
        self._writer.flush()

    def flush(self) -> None:
        """Hand all that there is to the operating system, truth that waits included."""
        self._release(everything=True)
        self._writer.flush()

    def close(self) -> None:
        """Finish the bag. A second call does nothing."""
        self._release(everything=True)
        self._put_last()
        self._writer.close()
        if self._live is not None:
            self._live.close()
            self._live = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _put(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        self._writer.write(topic, cdr, log_time_ns, publish_time_ns, sequence)
        if self._live is not None:
            self._live.show(topic, cdr, log_time_ns)

    def _release(self, everything: bool = False) -> None:
        while self._held and (everything or self._may_go(self._held[0])):
            held = self._held.popleft()
            self._held_bytes -= len(held.cdr)
            if len(held.cdr) > _LARGE_BYTES and self._led:
                self._writer.flush()
                self._led = False
            self._derive(held)
            if self._every == 1:
                self._put(*held[:5])
            else:
                if self._live is not None:  # who looks sees all of it
                    self._live.show(held.topic, held.cdr, held.log_time_ns)
                self._thin_out(self._plants[held.topic], *decode_truth(held.cdr))
            if self._state is not None:
                self._state.take_truth(self._plants[held.topic], *decode_truth(held.cdr))
        if self._state is not None and (everything or self._placed_ns >= 0):
            self._show(self._state, everything)

    def _thin_out(self, plant: str, first: int, samples: FloatArray) -> None:
        """Keep a part of the samples in the bag, and all of them where they are summed up."""
        if self._whole is not None:
            self._whole.append(plant, first, samples)
        self._lasts[plant] = first + samples.shape[0] - 1, samples[-1:]
        if self._every:
            skipped = -first % self._every
            self._put_samples(truth_topic(plant).name, first + skipped, samples[skipped :: self._every])

    def _put_samples(self, topic: str, first: int, samples: FloatArray) -> None:
        if not samples.shape[0]:
            return
        tick = first + self._every * (samples.shape[0] - 1)
        self._numbers[topic] = self._numbers.get(topic, 0) + 1
        cdr = encode_truth(first, np.ascontiguousarray(samples))
        logged, published = self._instant_ns(tick)
        self._writer.write(topic, cdr, logged, published, self._numbers[topic])

    def _put_last(self) -> None:
        """The last sample is kept in any case: the state at the end."""
        for plant, (tick, sample) in self._lasts.items():
            if self._every and tick % self._every:
                self._put_samples(truth_topic(plant).name, tick, sample)
        self._lasts.clear()

    def _instant_ns(self, tick: int) -> tuple[int, int]:
        """When what belongs to a tick is logged and published, behind all its steps [ns]."""
        if self._wall is not None:
            return self._wall.instant_ns(tick), self._wall.instant_ns(tick)
        published = tick_time_ns(tick, self._ticks_per_second)
        return log_time_ns(published, AFTER_ALL_STEPS), published

    def _note_input(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        assert self._state is not None
        link = self._to_plants[topic]
        if self._wall is not None:
            tick, step = self._wall.tick_at(publish_time_ns), 0
        else:
            tick, step = tick_of(publish_time_ns, self._ticks_per_second), step_of(log_time_ns, publish_time_ns)
        self._state.take_message(link.name, sequence, tick, step, decode(link.wire.type_name, cdr))

    def _show(self, state: StateStreams, everything: bool) -> None:
        whole = everything or self._wall is not None  # in real time torques wait for the ledger, and nothing else
        until = sys.maxsize if whole else tick_of(self._placed_ns, self._ticks_per_second)
        for topic, cdr, tick, sequence in state.ready(until, everything):
            logged, published = self._instant_ns(tick)
            self._put(topic, cdr, logged, published, sequence)

    def _may_go(self, held: _Held) -> bool:
        return (
            held.publish_time_ns <= self._placed_ns
            or self._held_bytes > _MOST_HELD_BYTES
            or time.monotonic() - held.since > _HELD_FOR_S
        )

    def _derive(self, held: _Held) -> None:
        """Before the truth itself, so that a bag that ends between the two lacks nothing of the truth that it has."""
        if not self._derived[held.topic]:
            return
        first, samples = decode_truth(held.cdr)
        for derivation in self._derived[held.topic]:
            name = derived_topic(derivation.node).name
            rows = derivation.rows(first, samples)
            if self._every != 1:
                if self._every:
                    skipped = -first % self._every
                    self._put_samples(name, first + skipped, rows[skipped :: self._every])
                continue
            number = self._numbers[name] = self._numbers.get(name, 0) + 1
            cdr = encode_truth(first, rows)
            self._put(name, cdr, held.log_time_ns, held.publish_time_ns, number)
