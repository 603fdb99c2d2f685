"""MCAP files as other tools rewrite ours: without chunks, index or checksums, compressed; and lies about sizes."""

import itertools
import os
import struct
import tempfile
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import yaml
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.compression import MOST_CHUNK_BYTES, expanded
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription, recorded_topics, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.errors import BagError
from etac_ros.scenario.load import load

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
TRUTH = truth_topic("/plant")
METADATA = {"ticks_per_second": "20"}

FORMS = {
    "no chunks": {"use_chunking": False},
    "no chunks, no checksums": {"use_chunking": False, "enable_crcs": False, "enable_data_crcs": False},
    "no chunks, no summary": {
        "use_chunking": False,
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
        "index_types": IndexType.NONE,
    },
    "no checksums": {"enable_crcs": False, "enable_data_crcs": False},
    "no summary": {
        "use_statistics": False,
        "use_summary_offsets": False,
        "repeat_channels": False,
        "repeat_schemas": False,
        "index_types": IndexType.NONE,
    },
    "lz4": {"compression": CompressionType.LZ4},
    "zstd": {"compression": CompressionType.ZSTD},
    "zstd, no checksums": {"compression": CompressionType.ZSTD, "enable_crcs": False},
}


@pytest.fixture(scope="module")
def ours(tmp_path_factory):
    directory = tmp_path_factory.mktemp("ours") / "bag"
    with BagWriter(directory, [SIGNAL, TRUTH], {"s.yaml": b"seed: 1\n"}, METADATA) as writer:
        for tick in range(300):
            value, time = np.array([tick, -tick, 0.5], dtype=np.float64), tick_time_ns(tick, 20)
            writer.write("/signal", encode(SIGNAL.type_name, value, time), time + 1, time, tick + 1)
            writer.write(TRUTH.name, encode_truth(tick, value[np.newaxis]), time, time, tick + 1)
    return directory


def rewritten(ours, directory, **form):
    """The same records through the writer of the mcap package, as its users convert files."""
    directory.mkdir()
    with (ours / "bag_0.mcap").open("rb") as source, (directory / "bag_0.mcap").open("wb") as target:
        reader = make_reader(source)
        writer = Writer(target, chunk_size=2000, **{"compression": CompressionType.NONE, **form})
        writer.start(profile="ros2")
        for record in reader.iter_metadata():
            writer.add_metadata(record.name, record.metadata)
        for attachment in reader.iter_attachments():
            writer.add_attachment(0, 0, attachment.name, attachment.media_type, attachment.data)
        channels = {}
        for schema, channel, message in reader.iter_messages(log_time_order=False):
            if channel.id not in channels:
                registered = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.id] = writer.register_channel(
                    channel.topic, channel.message_encoding, registered, channel.metadata
                )
            writer.add_message(
                channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence
            )
        writer.finish()
    (directory / "metadata.yaml").write_bytes((ours / "metadata.yaml").read_bytes())
    return directory


@pytest.mark.parametrize("form", FORMS)
def test_a_bag_in_any_form_reads_the_same(ours, tmp_path, form):
    directory = rewritten(ours, tmp_path / "bag", **FORMS[form])
    bag, original = read_bag(directory), read_bag(ours)
    assert list(bag.messages()) == list(original.messages())
    assert bag.metadata == original.metadata
    assert bag.attachments == original.attachments
    assert {topic.name: count for topic, count in bag.topics.items()} == {
        topic.name: count for topic, count in original.topics.items()
    }
    assert recover(directory).nothing_to_do


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("part", [0.5, 0.97])
def test_what_is_whole_of_a_bag_in_any_form_is_saved(ours, tmp_path, form, part):
    directory = rewritten(ours, tmp_path / "bag", **FORMS[form])
    path = directory / "bag_0.mcap"
    os.truncate(path, int(part * path.stat().st_size))
    with pytest.raises(BagError, match="cut off"):
        read_bag(directory)
    report = recover(directory)
    saved, original = list(read_bag(directory).messages()), list(read_bag(ours).messages())
    assert saved == original[: len(saved)]
    assert len(saved) == sum(report.messages.values()) > 0.35 * len(original) * part


def test_messages_partly_in_chunks_are_no_recording(ours, tmp_path):
    plain = (rewritten(ours, tmp_path / "plain", use_chunking=False) / "bag_0.mcap").read_bytes()
    head, length = struct.Struct("<BQ"), 0
    place = 8
    while plain[place] != Opcode.MESSAGE:
        place += head.size + head.unpack_from(plain, place)[1]
    length = head.unpack_from(plain, place)[1]
    message = plain[place : place + head.size + length]
    directory = rewritten(ours, tmp_path / "bag")
    chunked = (directory / "bag_0.mcap").read_bytes()
    place, chunks = 8, 0
    while chunks < 2:
        chunks += chunked[place] == Opcode.CHUNK
        place += head.size + head.unpack_from(chunked, place)[1]
    (directory / "bag_0.mcap").write_bytes(chunked[:place] + message + chunked[place:])
    with pytest.raises(BagError, match="some messages stand in chunks and some do not"):
        read_bag(directory)


def test_statistics_that_do_not_fit_are_named_with_their_topic(ours, tmp_path):
    directory = rewritten(ours, tmp_path / "bag", enable_crcs=False, enable_data_crcs=False)
    data = bytearray((directory / "bag_0.mcap").read_bytes())
    head, place = struct.Struct("<BQ"), 8
    while data[place] != Opcode.STATISTICS:
        place += head.size + head.unpack_from(data, place)[1]
    counts = place + head.size + 8 + 2 + 4 + 4 + 4 + 4 + 8 + 8
    assert struct.unpack_from("<I", data, counts) == (2 * 10,)
    channel, messages = struct.unpack_from("<HQ", data, counts + 4)
    assert messages == 300
    struct.pack_into("<Q", data, counts + 6, 299)
    (directory / "bag_0.mcap").write_bytes(data)
    with pytest.raises(BagError, match=r"300 messages in the \.mcap file, 299 in its statistics") as caught:
        read_bag(directory)
    assert caught.value.where == f"{directory}: /signal"
    assert channel == 1


@pytest.mark.parametrize(("compression", "squeeze"), [(b"lz4", lz4.frame.compress), (b"zstd", zstandard.compress)])
def test_a_chunk_expands_to_what_it_claims_and_not_a_byte_further(compression, squeeze):
    data = bytes(range(256)) * 40
    assert expanded(compression, squeeze(data), len(data)) == data
    assert expanded(compression, squeeze(b""), 0) == b""
    for wrong in (0, len(data) - 1, len(data) + 1):
        with pytest.raises(ValueError, match=f"does not expand to the {wrong} bytes"):
            expanded(compression, squeeze(data), wrong)
    with pytest.raises(ValueError, match="cannot be expanded"):
        expanded(compression, b"neither of the two", 100)
    with pytest.raises(ValueError, match=r"cannot be expanded|does not expand"):
        expanded(compression, squeeze(data)[:-20], len(data))
    with pytest.raises(ValueError, match=f"more than {MOST_CHUNK_BYTES}"):
        expanded(compression, squeeze(data), MOST_CHUNK_BYTES + 1)


def test_a_bomb_of_a_gigabyte_costs_no_memory_to_speak_of():
    bomb = zstandard.compress(bytes(1024) * 1024 * 64)
    assert len(bomb) < 10_000
    with pytest.raises(ValueError, match="does not expand to the 1000 bytes"):
        expanded(b"zstd", bomb, 1000)


def test_another_compression_is_named():
    with pytest.raises(ValueError, match=r"compressed with 'br\\x1b', known are lz4 and zstd"):
        expanded(b"br\x1b".replace(b"\x1b", b"\\x1b"), b"", 0)


def record(opcode, content):
    return struct.pack("<BQ", opcode, len(content)) + content


def test_chunks_that_expand_without_end_are_refused(tmp_path):
    """Each within its limit, all together a thousand times the file and more."""
    size = MOST_CHUNK_BYTES
    squeezed = zstandard.compress(record(0x80, bytes(size - 9)))
    chunk = record(Opcode.CHUNK, struct.pack("<QQQII4sQ", 0, 0, size, 0, 4, b"zstd", len(squeezed)) + squeezed)
    directory = tmp_path / "bag"
    directory.mkdir()
    (directory / "bag_0.mcap").write_bytes(b"\x89MCAP0\r\n" + chunk * 3)
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: {topics_with_message_count: []}")
    with pytest.raises(BagError, match="expand to more than 1000 times its size"):
        read_bag(directory)


def test_a_sparse_file_of_nothing_is_over_at_once(tmp_path):
    (tmp_path / "bag_0.mcap").write_bytes(b"\x89MCAP0\r\n")
    os.truncate(tmp_path / "bag_0.mcap", 2**40)
    (tmp_path / "metadata.yaml").write_text("rosbag2_bagfile_information: {topics_with_message_count: []}")
    with pytest.raises(BagError, match="byte 8: no record begins here"):
        read_bag(tmp_path)
    with (tmp_path / "bag_0.mcap").open("r+b") as file:
        file.seek(8)
        file.write(struct.pack("<BQ", Opcode.ATTACHMENT, 2**39))
    with pytest.raises(BagError, match=f"this record has {2**39} bytes"):
        read_bag(tmp_path)


def test_pipes_in_the_place_of_files_keep_nobody_waiting(ours, tmp_path):
    os.mkfifo(tmp_path / "bag_0.mcap")
    with pytest.raises(BagError, match=r"holds 0 \.mcap files"):
        read_bag(tmp_path)
    os.unlink(tmp_path / "bag_0.mcap")
    (tmp_path / "bag_0.mcap").write_bytes((ours / "bag_0.mcap").read_bytes())
    os.mkfifo(tmp_path / "metadata.yaml")
    with pytest.raises(BagError, match=r"metadata\.yaml: is damaged"):
        read_bag(tmp_path)


DEEP = "rosbag2_bagfile_information: " + "[" * 100_000
LAUGHS = "\n".join(
    ["a0: &a0 [x, x, x, x, x, x, x, x, x]"]
    + [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 9)}]" for i in range(1, 30)]
    + ["rosbag2_bagfile_information: {topics_with_message_count: *a29}"]
)
COUNT = "rosbag2_bagfile_information: {topics_with_message_count: [{topic_metadata: {name: /x}, message_count: %s}]}"


@pytest.mark.parametrize(
    "text",
    [
        DEEP,
        LAUGHS,
        COUNT % ".inf",
        COUNT % ".nan",
        COUNT % "[]",
        COUNT % ("9" * 6000),
        "[]",
        "x",
        "",
        "\0",
        "# " * 2**22,
    ],
    ids=itertools.count(),
)
def test_a_mangled_metadata_yaml_is_called_damaged(ours, tmp_path, text):
    (tmp_path / "bag_0.mcap").write_bytes((ours / "bag_0.mcap").read_bytes())
    (tmp_path / "metadata.yaml").write_text(text)
    with pytest.raises(BagError, match=r"metadata\.yaml: is damaged"):
        read_bag(tmp_path)
    assert recover(tmp_path).messages == {"/signal": 300, TRUTH.name: 300}


def test_a_directory_in_the_place_of_metadata_yaml_is_called_damaged(ours):
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "bag_0.mcap").write_bytes((ours / "bag_0.mcap").read_bytes())
        Path(folder, "metadata.yaml").mkdir()
        with pytest.raises(BagError, match="is damaged"):
            read_bag(Path(folder))


def test_a_bag_without_messages_has_no_duration(tmp_path: Path) -> None:
    with BagWriter(tmp_path / "bag", recorded_topics(load("wu2018").graph), {}, {"ticks_per_second": "32"}):
        pass
    information = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert information["duration"]["nanoseconds"] == 0
    assert information["message_count"] == 0
