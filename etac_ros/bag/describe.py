"""What `etac info` shows of a bag."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

from etac_ros.bag.clock import NANOSECONDS
from etac_ros.bag.codec import decode
from etac_ros.bag.description import DESCRIPTION_ATTACHMENT, from_json
from etac_ros.bag.read import Bag, read_bag
from etac_ros.bag.topics import TopicDescription, TopicKind
from etac_ros.errors import BagError
from etac_ros.graph.topics import node_of_ledger
from etac_ros.graph.wire import bytes_a_component


@dataclass(frozen=True)
class TopicRow:
    """One topic.

    Attributes
    ----------
    payload_bytes
        4 a component, as the papers count; 0 for a topic that is no link.
    cdr_bytes
        Serialized messages.
    first_s, last_s
        Simulated time of the first and of the last message [s]; None without messages.
    receivers
        Of a link; None for any other topic, and where the bag does not say it.
    """

    topic: str
    kind: TopicKind
    type_name: str
    messages: int
    payload_bytes: int
    cdr_bytes: int
    first_s: float | None
    last_s: float | None
    receivers: int | None = None


@dataclass(frozen=True)
class Total:
    """A sum over topics."""

    messages: int
    payload_bytes: int
    cdr_bytes: int


@dataclass(frozen=True)
class BagDescription:
    """A bag at a glance.

    Attributes
    ----------
    duration_s
        Simulated time from the first message to the last [s].
    network, internal, emulation
        Totals of each kind. Physical links travel on the emulation plane and are counted there.
    attachments
        Sizes by name [bytes].
    file_bytes
        Size of the MCAP file.
    """

    directory: Path
    topics: tuple[TopicRow, ...]
    duration_s: float
    metadata: dict[str, str]
    network: Total
    internal: Total
    emulation: Total
    attachments: dict[str, int]
    file_bytes: int


def describe(directory: Path) -> BagDescription:
    """Count what is in a bag.

    Raises
    ------
    BagError
        If it cannot be read.
    """
    bag = read_bag(directory)
    payload: Counter[TopicDescription] = Counter()
    for message in bag.messages():
        if message.topic.link is not None:
            try:
                size = decode(message.topic.type_name, message.cdr).size
            except ValueError as error:
                where = f"{bag.path}: {message.topic.name}"
                raise BagError(where, f"message {message.sequence}: {error}") from None
            payload[message.topic] += bytes_a_component(message.topic.type_name) * size
    receivers = _receivers(bag)
    # Ledgers have no simulated time: a node hands over its last one when the run is over, however much later that is.
    times = {
        topic: (None, None) if node_of_ledger(topic.name) is not None else (count.first_ns, count.last_ns)
        for topic, count in bag.topics.items()
    }
    rows = tuple(
        TopicRow(
            topic.name,
            topic.kind,
            topic.type_name,
            count.messages,
            payload[topic],
            count.cdr_bytes,
            _seconds(times[topic][0]),
            _seconds(times[topic][1]),
            receivers.get(topic.link or ""),
        )
        for topic, count in bag.topics.items()
    )
    starts = [first for first, _ in times.values() if first is not None]
    ends = [last for _, last in times.values() if last is not None]
    return BagDescription(
        directory,
        rows,
        (max(ends) - min(starts)) / NANOSECONDS if starts else 0.0,
        bag.metadata,
        _total(rows, "network"),
        _total(rows, "internal"),
        _total(rows, "physical", "emulation"),
        {name: len(data) for name, data in bag.attachments.items()},
        bag.path.stat().st_size,
    )


def _seconds(time_ns: int | None) -> float | None:
    return None if time_ns is None else time_ns / NANOSECONDS


def _receivers(bag: Bag) -> dict[str, int]:
    """How many receivers each link has, as far as the bag says so."""
    try:
        description = from_json(bag.attachments[DESCRIPTION_ATTACHMENT])
    except (KeyError, ValueError):
        return {}
    return {name: len(link.receivers) for name, link in description.links.items()}


def _total(rows: tuple[TopicRow, ...], *kinds: TopicKind) -> Total:
    counted = [row for row in rows if row.kind in kinds]
    return Total(
        sum(row.messages for row in counted),
        sum(row.payload_bytes for row in counted),
        sum(row.cdr_bytes for row in counted),
    )
