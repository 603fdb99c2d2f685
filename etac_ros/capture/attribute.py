"""Whose each captured byte is: the rule by which frames become an account.

A frame may hold submessages of several writers and readers. Every byte goes to one of them:

- A submessage of a writer or of a reader, to its topic and its cause. What it says of the message (INFO_TS, INFO_DST)
  stands before the submessage that it is about, and goes with it.
- The headers of RTPS, UDP, IP and Ethernet, and what stands behind the last submessage, to the first one: for its
  sake the frame was sent. The frame itself is counted there.
- A frame without any, or one that cannot be read, to "other", with the reason.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from typing import NamedTuple

from etac_ros.capture.account import Cause, Layers, TopicWire, WireAccount
from etac_ros.capture.datagram import Datagram, datagrams
from etac_ros.capture.discovery import LIVELINESS, ROS_DISCOVERY, Address, Directory, is_built_in
from etac_ros.capture.rtps import FROM_READER, Kind, Malformed, Prefix, RtpsMessage, Submessage
from etac_ros.capture.rtps import parse as parse_rtps
from etac_ros.graph.topics import is_truth

_CAUSES = {
    Kind.DATA: Cause.DATA,
    Kind.HEARTBEAT: Cause.HEARTBEAT,
    Kind.ACKNACK: Cause.ACKNACK,
    Kind.GAP: Cause.GAP,
    Kind.DATA_FRAG: Cause.FRAGMENTS,
    Kind.HEARTBEAT_FRAG: Cause.FRAGMENTS,
    Kind.NACK_FRAG: Cause.FRAGMENTS,
}
_DISCOVERY, _LIVELINESS = "discovery", "liveliness"
_MULTICAST = range(224, 240)
"""First byte of an IPv4 multicast address."""


class _Part(NamedTuple):
    """Where bytes are counted: a topic and a cause, or something else with its name."""

    topic: str | None
    cause: str
    recorder: bool = False


class _Parsed(NamedTuple):
    """What came in one frame, or in several that IP has made of one datagram."""

    found: Datagram | bytes
    message: RtpsMessage | None
    reason: str


def attribute(
    frames: Iterable[bytes], payloads: Mapping[str, int], missed: int = 0, before: Iterable[bytes] = ()
) -> WireAccount:
    """Account for captured frames.

    Parameters
    ----------
    frames
        Ethernet frames, each once.
    payloads
        Payload of one message, as the papers count it, of each topic that is a link [bytes].
    missed
        Frames that the system could not keep.
    before
        Frames from before, which are not counted: only what they announce is known.
    """
    parsed = [_parse(found) for found in datagrams(frames)]
    directory = Directory()
    for some in (map(_parse, datagrams(before)), parsed):
        directory.learn(one.message for one in some if one.message is not None)
    books = _Books(directory, payloads)
    for one in parsed:
        books.enter(one)
    return books.account(missed)


def _parse(found: Datagram | bytes) -> _Parsed:
    if isinstance(found, bytes):
        return _Parsed(found, None, "no whole UDP datagram")
    try:
        return _Parsed(found, parse_rtps(found.content), "")
    except Malformed as error:
        return _Parsed(found, None, str(error))


class _Books:
    """Sums while frames are entered one by one."""

    def __init__(self, directory: Directory, payloads: Mapping[str, int]) -> None:
        self._directory = directory
        self._payloads = payloads
        self._recorders = {
            prefix
            for (prefix, entity), topic in directory.topics.items()
            if is_truth(topic) and entity[3] & 0x3F in (0x04, 0x07)  # a reader of it: 9.3.1.2
        }
        self._parts: defaultdict[_Part, Counter[str]] = defaultdict(Counter)
        self._samples: defaultdict[str, set[tuple[Prefix, bytes, int]]] = defaultdict(set)
        self._sent_to: defaultdict[tuple[Prefix, bytes, int], set[Address]] = defaultdict(set)
        self._resent: Counter[str] = Counter()
        self._frames = self._bytes = self._statistics = 0

    def enter(self, one: _Parsed) -> None:
        """Enter one frame, or the frames of one datagram."""
        datagram = one.found
        if isinstance(datagram, bytes):
            self._frames += 1
            self._bytes += len(datagram)
            self._parts[_Part(None, one.reason)].update(frames=1, ethernet_bytes=len(datagram))
            return
        self._frames += datagram.frames
        self._bytes += datagram.size
        headers = {
            "frames": datagram.frames,
            "udp_ip_bytes": datagram.udp_ip_bytes,
            "ethernet_bytes": datagram.ethernet_bytes,
        }
        if one.message is None:
            self._parts[_Part(None, one.reason)].update(headers, rtps_bytes=len(datagram.content))
            return
        first: _Part | None = None
        pending = one.message.header_bytes  # bytes that wait for the submessage to which they go
        for submessage in one.message.submessages:
            self._statistics += submessage.size if submessage.kind == Kind.STATISTICS else 0
            if not submessage.of_entity:
                pending += submessage.size
                continue
            part, inside = self._place(one.message, submessage, datagram)
            first = first or part
            rtps = submessage.size - sum(inside.values())
            self._parts[part].update(inside, rtps_bytes=rtps + pending)
            pending = 0
        self._parts[first or _Part(None, "no submessage of a writer or a reader")].update(headers, rtps_bytes=pending)

    def account(self, missed: int) -> WireAccount:
        """What was entered."""
        causes: defaultdict[str, dict[Cause, Layers]] = defaultdict(dict)
        recorder: defaultdict[str, Layers] = defaultdict(Layers)
        apart = {_DISCOVERY: Layers(), _LIVELINESS: Layers()}
        other: dict[str, Layers] = {}
        for part, counts in sorted(self._parts.items(), key=lambda item: (item[0].topic or "", item[0].cause)):
            layers = Layers.of(counts)
            if part.topic is None:
                (apart if part.cause in apart else other)[part.cause] = layers
            elif part.recorder:
                recorder[part.topic] += layers
            else:
                causes[part.topic][Cause(part.cause)] = layers
        topics = {name: self._topic(name, causes[name], recorder[name]) for name in sorted({*causes, *recorder})}
        return WireAccount(
            frames=self._frames,
            total_bytes=self._bytes,
            missed_frames=missed,
            statistics_bytes=self._statistics,
            topics=topics,
            discovery=apart[_DISCOVERY],
            liveliness=apart[_LIVELINESS],
            other=other,
        )

    def _topic(self, name: str, causes: dict[Cause, Layers], recorder: Layers) -> TopicWire:
        messages, together = len(self._samples[name]), sum(causes.values(), Layers())
        return TopicWire(
            messages=messages,
            resent=self._resent[name],
            causes={cause: causes[cause] for cause in Cause if cause in causes},
            all_causes=together,
            bytes_a_message=together.total_bytes / messages if {Cause.DATA, Cause.FRAGMENTS} & causes.keys() else None,
            recorder=recorder,
        )

    def _place(self, message: RtpsMessage, submessage: Submessage, datagram: Datagram) -> tuple[_Part, dict[str, int]]:
        """Where a submessage belongs, and which of its bytes are payload and CDR."""
        try:
            inside = self._inside(submessage)
            if is_built_in(submessage.writer):
                return _Part(None, _LIVELINESS if submessage.writer == LIVELINESS[0] else _DISCOVERY), inside
            topic = self._directory.topic_of(message.prefix, submessage)
        except Malformed as error:
            return _Part(None, str(error)), {}
        if topic is None:
            return _Part(None, f"a {self._end(submessage)} that was not announced"), inside
        if topic == ROS_DISCOVERY:
            return _Part(None, _DISCOVERY), inside
        if submessage.kind in (Kind.DATA, Kind.DATA_FRAG):
            self._see(topic, (message.prefix, submessage.writer, submessage.sequence), datagram.target, submessage)
        if submessage.kind == Kind.DATA and inside.get("cdr_bytes"):
            payload = min(self._payloads.get(topic, 0), inside["cdr_bytes"])
            inside = {"payload_bytes": payload, "cdr_bytes": inside["cdr_bytes"] - payload}
        at = self._directory.participants.get(datagram.target, submessage.destination)
        recorder = bool(self._recorders & {message.prefix, at})
        return _Part(topic, _CAUSES[Kind(submessage.kind)], recorder), inside

    @staticmethod
    def _inside(submessage: Submessage) -> dict[str, int]:
        if submessage.kind not in (Kind.DATA, Kind.DATA_FRAG):
            return {}
        return {"cdr_bytes": len(submessage.serialized)}

    @staticmethod
    def _end(submessage: Submessage) -> str:
        return "reader" if submessage.kind in FROM_READER else "writer"

    def _see(self, topic: str, sample: tuple[Prefix, bytes, int], target: Address, submessage: Submessage) -> None:
        """Count a sample once, and each time that it goes where it went before.

        Parts of a sample are counted with the first of them; that a part is sent again is not told apart.
        """
        self._samples[topic].add(sample)
        before = self._sent_to[sample]
        again = target in before or any(address[0] in _MULTICAST for address, _ in before)
        self._resent[topic] += again and submessage.kind == Kind.DATA
        before.add(target)
