"""What a run leaves behind in memory, whichever engine ran it and whether or not it came back from a bag."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from hashlib import blake2b
from typing import NamedTuple, TypeVar, cast

import numpy as np
import numpy.typing as npt

from etac_ros.errors import BagError
from etac_ros.graph.acknowledged import Event
from etac_ros.graph.ledger import Entry
from etac_ros.graph.ledger import Event as LedgerEvent
from etac_ros.graph.spool import Chunk, StoredChunks
from etac_ros.maths.wall_clock import WallClock
from etac_ros.media.frame import Fate, Outcome
from etac_ros.parameters import FloatArray

_NONE = np.empty((0, 0))
PART_TICKS = 1 << 17
"""Samples of a plant that are looked at together: all of a usual run, and a piece of one that is very long."""
_Made = TypeVar("_Made")


class Message(NamedTuple):
    """One message of a link with its place in time."""

    sequence: int
    tick: int
    step: int
    value: FloatArray


@dataclass
class Recording:
    """Messages of every link and the committed samples of every plant.

    Attributes
    ----------
    messages
        By link name, in order of sequence number.
    truth
        Committed samples of each plant as (first tick, samples) chunks without gaps; of a very long run on disk.
    air
        What became of frames on shared media, in the order in which it did.
    wall
        The instants of ticks, of a run in real time; None of one in simulated time.
    ledgers
        What each node of a run in real time noted down.
    every
        Ticks from one sample to the next, where a bag keeps only a part of them (and the last); 0 where it keeps none.
        Whatever needs all of them, :meth:`samples` above all, is refused then.
    at
        By plant, the ticks of the samples where they are neither all nor evenly spaced: those that a view shows.
    """

    messages: dict[str, list[Message]] = field(default_factory=dict)
    truth: Mapping[str, Sequence[Chunk]] = field(default_factory=dict)
    air: list[Fate] = field(default_factory=list)
    wall: WallClock | None = None
    ledgers: dict[str, list[Entry]] = field(default_factory=dict)
    every: int = 1
    at: Mapping[str, npt.NDArray[np.int64]] = field(default_factory=dict)
    _taken: dict[str, dict[tuple[int, int], int]] = field(default_factory=dict, repr=False, compare=False)
    _landed: tuple[int, dict[str, dict[int, int]]] | None = field(default=None, repr=False, compare=False)
    _joined: dict[str, tuple[int, FloatArray]] = field(default_factory=dict, repr=False, compare=False)
    """By plant: how many chunks there were when they were last joined, and all their samples."""
    _conversations: dict[str, tuple[int, int, list[Event]]] = field(default_factory=dict, repr=False, compare=False)
    """By acknowledged link: how many fates and messages there were when it was last replayed, and what came of it."""
    _begins: dict[str, int] = field(default_factory=dict, repr=False, compare=False)
    """By plant of which this is a part alone: the first tick of the run."""
    _made: dict[tuple[str, str], object] | None = field(default=None, repr=False, compare=False)
    """What all parts of a recording share."""

    @property
    def is_whole(self) -> bool:
        """Whether every committed sample is there."""
        return self.every == 1 and not self.at

    def digest(self) -> str:
        """A number for all that happened, to the last bit: the same for two runs only if they are the same."""
        found = blake2b(digest_size=8)
        for link in sorted(self.messages):
            for message in self.messages[link]:
                found.update(f"{link}#{message.sequence} {message.tick}:{message.step}=".encode())
                found.update(message.value.tobytes())
        for fate in self.air:
            found.update(f"air {tuple(fate)}".encode())
        for plant in sorted(self.truth):
            found.update(f"{plant}@{self.span(plant)[0]}=".encode())
            for _, samples in self.truth[plant]:
                found.update(np.ascontiguousarray(samples).tobytes())
        return found.hexdigest()

    def span(self, plant: str) -> tuple[int, int]:
        """Tick of the first committed sample of a plant, and how many ticks there are up to the last."""
        chunks = self.truth.get(plant) or ()
        if plant in self.at:
            return int(self.at[plant][0]), int(self.at[plant][-1] - self.at[plant][0]) + 1
        if isinstance(chunks, StoredChunks):
            return chunks.first_tick, chunks.ticks
        if not chunks:
            return 0, 0
        first, (last, samples) = chunks[0][0], chunks[-1]
        return first, last + self.every * (samples.shape[0] - 1) + 1 - first

    def final(self, plant: str) -> FloatArray:
        """The last committed sample of a plant."""
        _, samples = self.truth[plant][-1]
        return np.asarray(samples[-1])

    def first_tick(self, plant: str) -> int:
        """The tick with which the samples of a plant begin, also asked of a part of them."""
        return self._begins[plant] if plant in self._begins else self.span(plant)[0]

    def parts(self, plant: str) -> Iterator[Recording]:
        """The recording with a part of the samples of a plant at a time, in ascending order, and all messages.

        A usual run is one part, itself. So whatever is computed tick by tick, part after part, needs little memory for
        a very long run, and has the same bits for all others.
        """
        if self.is_one_part(plant):
            yield self
            return
        begins = {**self._begins, plant: self.first_tick(plant)}
        made: dict[tuple[str, str], object] = {}
        for some in _pieces(self.truth[plant]):
            yield replace(self, truth={**self.truth, plant: some}, _joined={}, _begins=begins, _made=made)

    def kept(self, plant: str) -> tuple[npt.NDArray[np.int64], FloatArray]:
        """Ticks and values of the committed samples that there are: all of them, unless a bag kept only a part."""
        if self.is_whole:
            first, states = self.samples(plant)
            return np.arange(first, first + states.shape[0], dtype=np.int64), states
        chunks = self.truth.get(plant) or [(0, _NONE)]
        if plant in self.at:
            return self.at[plant], np.concatenate([samples for _, samples in chunks])
        ticks = [first + self.every * np.arange(samples.shape[0], dtype=np.int64) for first, samples in chunks]
        return np.concatenate(ticks), np.concatenate([samples for _, samples in chunks])

    def is_one_part(self, plant: str) -> bool:
        """Whether all samples of a plant are looked at together."""
        return self.span(plant)[1] <= PART_TICKS or bool(self.at)

    def once(self, what: str, of: str, make: Callable[[], _Made]) -> _Made:
        """What follows from the messages alone, made once for all parts."""
        if self._made is None:
            return make()
        if (what, of) not in self._made:
            self._made[what, of] = make()
        return cast(_Made, self._made[what, of])

    def landed_ns(self, link: str) -> dict[int, int]:
        """When the messages of a link that crossed a medium had reached its receivers [ns], by sequence number."""
        if self._landed is None or self._landed[0] != len(self.air):
            by_link: dict[str, dict[int, int]] = {}
            for fate in self.air:
                if fate.outcome is Outcome.SENT:
                    by_link.setdefault(fate.link, {})[fate.sequence] = fate.landed_ns
            self._landed = len(self.air), by_link
        return self._landed[1].get(link, {})

    def remembered(self, link: str, make: Callable[[], list[Event]]) -> list[Event]:
        """What happened on an acknowledged link, made once."""
        seen = len(self.air), len(self.messages[link])
        known = self._conversations.get(link)
        if known is None or known[:2] != seen:
            known = self._conversations[link] = (*seen, make())
        return known[2]

    def taken(self, receiver: str) -> Mapping[tuple[int, int], int]:
        """Ticks at which a node of a run in real time took messages, by place of the link and sequence number."""
        if receiver not in self._taken:
            entries = self.ledgers.get(receiver, ())
            self._taken[receiver] = {
                (entry.link, entry.sequence): entry.tick for entry in entries if entry.event is LedgerEvent.TAKEN
            }
        return self._taken[receiver]

    def samples(self, plant: str) -> tuple[int, FloatArray]:
        """All committed samples of a plant: the tick of the first, and an array of shape (n, states).

        Everybody who asks gets the same array: it is there to be read.

        Raises
        ------
        BagError
            If a bag kept only a part of them.
        """
        if not self.is_whole:
            kept = f"only every {self.every}th committed sample is" if self.every else "no committed samples are"
            kept = "only what a view shows of the committed samples is" if self.at else kept
            raise BagError(
                f"truth of {plant}", f"{kept} there", "all of them, for what follows from each",
                "record the run without --truth",
            )  # fmt: skip
        chunks = self.truth.get(plant) or [(0, np.empty((0, 0)))]
        count, joined = self._joined.get(plant, (0, _NONE))
        if count != len(chunks):
            first, *others = chunks
            joined = np.concatenate([samples for _, samples in chunks]) if others else first[1]
            self._joined[plant] = len(chunks), joined
        return chunks[0][0], joined


def _pieces(chunks: Sequence[Chunk]) -> Iterator[list[Chunk]]:
    """The same chunks, so many at a time that they have about ``PART_TICKS`` samples."""
    gathered: list[Chunk] = []
    rows = 0
    for first, samples in chunks:
        gathered.append((first, samples))
        rows += samples.shape[0]
        if rows >= PART_TICKS:
            yield gathered
            gathered, rows = [], 0
    if gathered:
        yield gathered
