"""A running digest of what a module did and when: what the master laid down, and what the module says it did.

Both sides fold the same few numbers of every act, so that two histories with one difference anywhere have, but for
one chance in 2^32, different digests.
"""

from __future__ import annotations

from collections.abc import Iterable
from struct import Struct
from zlib import crc32

from etac_ros.graph.module import Module
from etac_ros.parameters import FloatArray
from etac_ros.timing.orders import MessageId, Settled

_ACT = Struct("<qqq")
_MESSAGE = Struct("<qq")
_UNTOLD = -1
"""The tick of a module that answers without knowing it."""


def knows_ticks(module: Module) -> bool:
    """Whether a module knows the tick of what it takes; those that merely answer do not."""
    return module.timed or not module.answers


def acted(digest: int, tick: int, epoch: int) -> int:
    """Fold in that the module acted by itself, on the window of an epoch (0: it sees none)."""
    return crc32(_ACT.pack(0, tick, epoch), digest)


def received(digest: int, tick: int | None, epoch: int, messages: Iterable[tuple[int, int]]) -> int:
    """Fold in that the module took messages, as (place of the link in the graph, sequence number)."""
    digest = crc32(_ACT.pack(1, _UNTOLD if tick is None else tick, epoch), digest)
    for place, sequence in messages:
        digest = crc32(_MESSAGE.pack(place, sequence), digest)
    return digest


def settled(digest: int, tick: int, epoch: int, messages: Iterable[tuple[int, int]]) -> int:
    """Fold in that the module was told what was acknowledged, each message as for :func:`received`."""
    digest = crc32(_ACT.pack(2, tick, epoch), digest)
    for place, number in messages:
        digest = crc32(_MESSAGE.pack(place, number), digest)
    return digest


def carried(digest: int, value: FloatArray) -> int:
    """Fold in a value that was sent or received on a link."""
    return crc32(value.tobytes(), digest)


class Places:
    """Numbers of links, by which a digest names them."""

    def __init__(self, links: Iterable[str]) -> None:
        self._places = {name: place for place, name in enumerate(links)}

    def of(self, messages: Iterable[MessageId]) -> list[tuple[int, int]]:
        """Messages as numbers."""
        return [(self._places[link], sequence) for link, sequence in messages]

    def of_settled(self, found: Iterable[Settled]) -> list[tuple[int, int]]:
        """What was settled as numbers: the sequence number, negative where a message was given up."""
        return [(self._places[one.link], one.sequence if one.acknowledged else -one.sequence) for one in found]
