"""What a run leaves behind in memory, whichever engine ran it and whether or not it came back from a bag."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import NamedTuple

import numpy as np

from etac_ros.graph.acknowledged import Event
from etac_ros.graph.ledger import Entry
from etac_ros.graph.ledger import Event as LedgerEvent
from etac_ros.maths.wall_clock import WallClock
from etac_ros.media.frame import Fate, Outcome
from etac_ros.parameters import FloatArray

_NONE = np.empty((0, 0))


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
        Committed samples of each plant as (first tick, samples) chunks without gaps.
    air
        What became of frames on shared media, in the order in which it did.
    wall
        The instants of ticks, of a run in real time; None of one in simulated time.
    ledgers
        What each node of a run in real time noted down.
    """

    messages: dict[str, list[Message]] = field(default_factory=dict)
    truth: dict[str, list[tuple[int, FloatArray]]] = field(default_factory=dict)
    air: list[Fate] = field(default_factory=list)
    wall: WallClock | None = None
    ledgers: dict[str, list[Entry]] = field(default_factory=dict)
    _taken: dict[str, dict[tuple[int, int], int]] = field(default_factory=dict, repr=False, compare=False)
    _landed: tuple[int, dict[str, dict[int, int]]] | None = field(default=None, repr=False, compare=False)
    _joined: dict[str, tuple[int, FloatArray]] = field(default_factory=dict, repr=False, compare=False)
    """By plant: how many chunks there were when they were last joined, and all their samples."""
    _conversations: dict[str, tuple[int, int, list[Event]]] = field(default_factory=dict, repr=False, compare=False)
    """By acknowledged link: how many fates and messages there were when it was last replayed, and what came of it."""

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
            first, samples = self.samples(plant)
            found.update(f"{plant}@{first}=".encode())
            found.update(np.ascontiguousarray(samples).tobytes())
        return found.hexdigest()

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
        """
        chunks = self.truth.get(plant) or [(0, np.empty((0, 0)))]
        count, joined = self._joined.get(plant, (0, _NONE))
        if count != len(chunks):
            joined = np.concatenate([samples for _, samples in chunks])
            self._joined[plant] = len(chunks), joined
        return chunks[0][0], joined
