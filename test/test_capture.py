"""Captured frames: every byte is found, once, where the rule says; nothing that is captured breaks the account."""

from __future__ import annotations

import struct
from pathlib import Path

import pytest
from frames import (
    HERE,
    OTHER,
    PORTS,
    PREFIX,
    PUBLICATIONS,
    READER,
    RECORDER,
    SUBSCRIPTIONS,
    WRITER,
    acknack,
    announcement,
    cdr,
    data,
    frame,
    gap,
    heartbeat,
    info_dst,
    info_ts,
    participant,
    rtps,
    statistics,
    submessage,
)
from hypothesis import given, settings
from hypothesis import strategies as st

from etac_ros.capture import pcapng
from etac_ros.capture.account import Cause, Layers, WireAccount
from etac_ros.capture.attribute import attribute
from etac_ros.capture.datagram import parse as parse_datagram
from etac_ros.capture.model import data_frames
from etac_ros.capture.rtps import Malformed
from etac_ros.capture.rtps import parse as parse_rtps
from etac_ros.errors import RunError
from etac_ros.media.overhead import OVERHEADS, Profile

TOPIC = "/torque"
TRUTH = "rt/emulation/plant/truth"
ANNOUNCED = [
    *(frame(rtps(prefix, participant(prefix))) for prefix in PORTS),
    frame(rtps(PREFIX, announcement(PUBLICATIONS, PREFIX, WRITER, "rt/torque"))),
    frame(rtps(OTHER, announcement(SUBSCRIPTIONS, OTHER, READER, "rt/torque"))),
    frame(rtps(PREFIX, announcement(PUBLICATIONS, PREFIX, b"\0\0\5\3", TRUTH))),
    frame(rtps(RECORDER, announcement(SUBSCRIPTIONS, RECORDER, READER, TRUTH))),
]


def account(*frames: bytes, payload: int = 12) -> WireAccount:
    """Of frames behind those that announce everybody."""
    return attribute([*ANNOUNCED, *frames], {TOPIC: payload})


def test_sample_by_layer() -> None:
    """A Point32 of 16 bytes: 12 payload, 4 CDR, headers of 20 + 12 + 24, statistics of 60, 28 of UDP and IP, 14."""
    sent = frame(rtps(PREFIX, info_ts(), data(WRITER, 1, cdr(16)), statistics()), PORTS[OTHER])
    found = account(sent).topics[TOPIC]
    expected = Layers(
        frames=1, payload_bytes=12, cdr_bytes=4, rtps_bytes=20 + 12 + 24 + 60, udp_ip_bytes=28, ethernet_bytes=14,
        total_bytes=174,
    )  # fmt: skip
    assert found.causes == {Cause.DATA: expected}
    assert (found.messages, found.resent, found.bytes_a_message) == (1, 0, 174.0)
    assert account(sent).statistics_bytes == 60


def test_model_is_what_a_sample_takes() -> None:
    to_one = frame(rtps(PREFIX, info_dst(OTHER), info_ts(), data(WRITER, 1, cdr(44)), statistics()), PORTS[OTHER])
    assert account(to_one, payload=24).topics[TOPIC].all_causes == data_frames(44, 24, receivers=1)
    to_two = frame(rtps(PREFIX, info_ts(), data(WRITER, 1, cdr(44))), PORTS[OTHER])
    found = account(to_two, to_two, payload=24).topics[TOPIC]
    assert found.all_causes == data_frames(44, 24, receivers=2, statistics=False)


def test_model_is_that_of_media() -> None:
    """Both models of Ethernet, but for preamble and SFD 8, check sequence 4 and gap 12, which no capture sees."""
    bare = data_frames(0, 0, receivers=2, statistics=False).total_bytes // 2
    assert bare + 8 + 4 + 12 == OVERHEADS[Profile.RTPS].frame_bytes


def test_frame_shared_by_submessages() -> None:
    """Headers, and what is behind the last, go to the first; what stands before a submessage goes with it."""
    content = rtps(
        PREFIX, info_ts(), data(WRITER, 1, cdr(16)), info_dst(OTHER), heartbeat(WRITER), gap(WRITER), statistics()
    )
    causes = account(frame(content, PORTS[OTHER])).topics[TOPIC].causes
    assert {cause: (layers.frames, layers.rtps_bytes) for cause, layers in causes.items()} == {
        Cause.DATA: (1, 20 + 12 + 24 + 60),
        Cause.HEARTBEAT: (0, 16 + 32),
        Cause.GAP: (0, 36),
    }
    assert sum(layers.total_bytes for layers in causes.values()) == len(frame(content))


def test_acknowledgement_belongs_to_the_topic_of_its_reader() -> None:
    sent = frame(rtps(OTHER, info_dst(PREFIX), acknack(READER, WRITER)), PORTS[PREFIX])
    assert account(sent).topics[TOPIC].causes[Cause.ACKNACK].total_bytes == len(sent)


def test_recorder_is_counted_apart() -> None:
    to_recorder = frame(rtps(PREFIX, data(WRITER, 1, cdr(16))), PORTS[RECORDER])
    by_destination = frame(rtps(PREFIX, info_dst(RECORDER), heartbeat(WRITER)), port=9999)
    found = account(to_recorder, by_destination).topics[TOPIC]
    assert found.causes == {}
    assert found.recorder.total_bytes == len(to_recorder) + len(by_destination)
    assert found.bytes_a_message is None


def test_sample_sent_again_is_told_apart() -> None:
    first = [frame(rtps(PREFIX, data(WRITER, 1, cdr(16))), PORTS[to]) for to in (OTHER, RECORDER)]
    found = account(*first, first[0], frame(rtps(PREFIX, data(WRITER, 2, cdr(16))), PORTS[OTHER])).topics[TOPIC]
    assert (found.messages, found.resent, found.causes[Cause.DATA].frames) == (2, 1, 3)


def test_fragments_are_a_cause_of_their_own() -> None:
    body = bytes(8) + WRITER + bytes(4) + b"\x01\0\0\0" + bytes(12) + bytes(100)
    sent = frame(rtps(PREFIX, submessage(0x16, bytes(2) + b"\x1c\0" + body[4:])), PORTS[OTHER])
    found = account(sent).topics[TOPIC]
    assert found.causes[Cause.FRAGMENTS].cdr_bytes == 100
    assert found.messages == 1


def test_inline_qos_is_rtps() -> None:
    inline = b"\x70\0\x04\0" + bytes(4) + b"\x01\0\0\0"
    found = account(frame(rtps(PREFIX, data(WRITER, 1, cdr(16), inline)), PORTS[OTHER])).topics[TOPIC].all_causes
    assert (found.payload_bytes, found.cdr_bytes, found.rtps_bytes) == (12, 4, 20 + 24 + len(inline))


def test_discovery_and_liveliness_are_apart() -> None:
    liveliness = frame(rtps(PREFIX, heartbeat(bytes.fromhex("000200c2"))))
    nodes = bytes.fromhex("00000503")
    told = frame(rtps(PREFIX, announcement(PUBLICATIONS, PREFIX, nodes, "ros_discovery_info")))
    graph = frame(rtps(PREFIX, data(nodes, 1, cdr(64))), PORTS[OTHER])
    found = account(liveliness, told, graph)
    assert found.liveliness.total_bytes == len(liveliness)
    assert found.discovery.total_bytes == sum(map(len, ANNOUNCED)) + len(told) + len(graph)
    assert found.topics == {}


def test_what_belongs_to_nobody_is_named() -> None:
    found = account(
        frame(rtps(PREFIX, data(b"\0\0\x99\x03", 1, cdr(16)))),
        frame(rtps(PREFIX, info_ts())),
        frame(b"no RTPS at all, but long enough"),
        b"short",
    )
    assert {reason: layers.frames for reason, layers in found.other.items()} == {
        "a writer that was not announced": 1,
        "no submessage of a writer or a reader": 1,
        "no RTPS header": 1,
        "no whole UDP datagram": 1,
    }


def fragments(whole: bytes, size: int) -> list[bytes]:
    """The frames that IP makes of one, with so many bytes in each but the last."""
    packet = whole[34:]
    found = []
    for start in range(0, len(packet), size):
        content = packet[start : start + size]
        more = 0x2000 if start + size < len(packet) else 0
        length = struct.pack("!H", 20 + len(content))
        place = struct.pack("!H", more | start // 8)
        found.append(whole[:16] + length + whole[18:20] + place + whole[22:34] + content)
    return found


def test_datagrams_in_fragments_of_ip_are_put_together() -> None:
    """As on a link that takes 1,500 bytes: each frame has its Ethernet and IP headers, the first that of UDP, too."""
    whole = frame(rtps(PREFIX, data(WRITER, 1, cdr(400))), PORTS[OTHER])
    parts = fragments(whole, 160)
    assert len(parts) == 3
    for order in (parts, parts[::-1]):
        found = account(*order[:2], frame(rtps(PREFIX, heartbeat(WRITER)), PORTS[OTHER]), order[2]).topics[TOPIC]
        sent = found.causes[Cause.DATA]
        assert (sent.frames, sent.ethernet_bytes, sent.udp_ip_bytes) == (3, 3 * 14, 3 * 20 + 8)
        assert sent.total_bytes == sum(map(len, parts))
    announced = fragments(frame(rtps(PREFIX, announcement(PUBLICATIONS, PREFIX, b"\0\0\7\3", "rt/late"))), 40)
    late = frame(rtps(PREFIX, data(b"\0\0\7\3", 1, cdr(16))))
    assert account(*announced, late).topics["/late"].messages == 1
    torn = account(*parts[:2])
    assert torn.other["no whole UDP datagram"].total_bytes == sum(map(len, parts[:2]))
    assert parse_datagram(whole[:-1]) is None  # shorter than it says


def test_what_happened_before_is_known_and_not_counted() -> None:
    sent = frame(rtps(PREFIX, data(WRITER, 1, cdr(16))), PORTS[OTHER])
    found = attribute([sent], {TOPIC: 12}, before=ANNOUNCED)
    assert found.topics[TOPIC].messages == 1
    assert (found.frames, found.total_bytes, found.other) == (1, len(sent), {})


def test_filling_of_short_frames_is_ethernet() -> None:
    short = parse_datagram(frame(b"x", smallest=60))
    assert short is not None
    assert (short.content, short.ethernet_bytes, short.udp_ip_bytes) == (b"x", 60 - 28 - 1, 28)
    assert short.target == (HERE, 7661)


@pytest.mark.parametrize(
    "content",
    [
        rtps(PREFIX, submessage(0x15, bytes(4)))[:-2],  # ends within its body
        rtps(PREFIX)[:-1],
        rtps(PREFIX, b"\x15\x01"),
        rtps(PREFIX, submessage(0x0E, b"short")),
    ],
)
def test_messages_that_are_cut_off(content: bytes) -> None:
    with pytest.raises(Malformed):
        parse_rtps(content)


def test_big_endian_and_a_length_of_zero() -> None:
    """Flag E is off: numbers are big-endian. A length of 0 stands for the rest of the message (9.4.5.1.3)."""
    big = b"\x15\x04\x00\x18" + b"\0\0\0\x10" + bytes(4) + WRITER + bytes(4) + b"\0\0\1\0" + b"last"
    rest = b"\x07\x01\x00\x00" + READER + WRITER + bytes(20)
    first, second = parse_rtps(rtps(PREFIX, big, rest)).submessages
    assert (first.sequence, first.serialized, first.size) == (256, b"last", 28)
    assert (second.size, second.writer) == (32, WRITER)


PIECES = st.one_of(
    st.sampled_from([info_ts(), statistics(), heartbeat(WRITER), gap(WRITER), acknack(READER, WRITER)]),
    st.builds(info_dst, st.sampled_from([*PORTS, bytes(12)])),
    st.builds(
        data, st.sampled_from([WRITER, READER, PUBLICATIONS]), st.integers(0, 2**40), st.builds(cdr, st.integers(4, 99))
    ),
    st.builds(submessage, st.integers(0, 255), st.binary(max_size=40), st.integers(0, 255)),
)
FRAMES = st.builds(
    lambda prefix, pieces, port, smallest: frame(rtps(prefix, *pieces), port, smallest),
    st.sampled_from(list(PORTS)),
    st.lists(PIECES, max_size=5),
    st.sampled_from([*PORTS.values(), 9999]),
    st.sampled_from([0, 60, 200]),
)
FRAGMENTS = st.builds(lambda whole, size: fragments(whole, size)[0], FRAMES, st.sampled_from([8, 40, 80]))


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """A frame with one byte changed, or cut off."""
    whole = bytearray(draw(FRAMES))
    place = draw(st.integers(0, len(whole) - 1))
    if draw(st.booleans()):
        return bytes(whole[:place])
    whole[place] = draw(st.integers(0, 255))
    return bytes(whole)


@settings(max_examples=150, deadline=None)
@given(st.lists(st.one_of(FRAMES, damaged(), FRAGMENTS, st.binary(max_size=80)), max_size=8), st.booleans())
def test_every_byte_is_counted_once(frames: list[bytes], announced: bool) -> None:
    captured = [*(ANNOUNCED if announced else ()), *frames]
    found = attribute(captured, {TOPIC: 12})
    assert found.frames == found.attributed.frames == len(captured)
    assert found.total_bytes == found.attributed.total_bytes == sum(map(len, captured))
    parts = found.attributed
    assert parts.total_bytes == (
        parts.payload_bytes + parts.cdr_bytes + parts.rtps_bytes + parts.udp_ip_bytes + parts.ethernet_bytes
    )
    for topic in found.topics.values():
        for layers in [*topic.causes.values(), topic.recorder]:
            assert min(layers.model_dump().values()) >= 0


def test_file_is_read_back_and_a_damaged_one_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.pcapng"
    with path.open("wb") as file:
        pcapng.write(file, iter([(1.5, ANNOUNCED[0]), (2.25, b"x")]))
    assert list(pcapng.read(path)) == [(1.5, ANNOUNCED[0]), (2.25, b"x")]
    path.write_bytes(path.read_bytes()[:-3])
    with pytest.raises(RunError, match=r"a\.pcapng: is damaged"):
        list(pcapng.read(path))
    with pytest.raises(RunError, match="cannot be read"):
        list(pcapng.read(tmp_path / "none.pcapng"))
