"""Readers that share no code with etac_ros open its bags and see the same values, types and counts."""

import json
import os
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg
from rosbags.typesys.store import Typestore

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import decode, decode_truth, encode, encode_truth
from etac_ros.bag.definitions import schema_text, type_hash
from etac_ros.bag.topics import TopicDescription, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.graph.wire import Wire, WireFormat

WIRES = {
    "point": Wire(WireFormat.COMPACT, 3),
    "floats": Wire(WireFormat.COMPACT, 4),
    "vector": Wire(WireFormat.STAMPED, 3),
    "quaternion": Wire(WireFormat.STAMPED, 4),
    "wrench": Wire(WireFormat.STAMPED, 6),
    "doubles": Wire(WireFormat.DOUBLE, 3),
}
TYPES = sorted({wire.type_name for wire in WIRES.values()})
LINKS = [TopicDescription(f"/{name}", wire.type_name, "network", name) for name, wire in WIRES.items()]
TRUTH = truth_topic("/sm/plant")
SAMPLES = np.random.default_rng(5).standard_normal((40, 7))


def values(wire):
    random = np.random.default_rng(wire.size)
    return [wire.rounded(random.standard_normal(wire.size)) for _ in range(200)]


def flat(message):
    """The numbers of a message of any of the three libraries, without its header."""
    if hasattr(message, "data"):
        return list(message.data)
    for part in ("vector", "quaternion", "wrench"):
        if hasattr(message, part):
            return flat(getattr(message, part))
    if hasattr(message, "force"):
        return flat(message.force) + flat(message.torque)
    return [getattr(message, name) for name in "xyzw" if hasattr(message, name)]


def decoded(bag, topic):
    """Messages and values as mcap_ros2 understands them from the schemas in the file."""
    with (bag / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [(message, value) for _, _, message, value in reader.iter_decoded_messages([topic])]


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    directory = tmp_path_factory.mktemp("foreign") / "bag"
    metadata = {"scenario": "toy", "seed": "7", "ticks_per_second": "32"}
    with BagWriter(directory, [*LINKS, TRUTH], {"resolved.yaml": b"seed: 7\n"}, metadata) as writer:
        for link in LINKS:
            for i, value in enumerate(values(WIRES[link.link]), start=1):
                time = tick_time_ns(i, 32)
                writer.write(link.name, encode(link.type_name, value, time), time + 2, time, i)
            writer.flush()
        writer.write(TRUTH.name, encode_truth(0, SAMPLES), tick_time_ns(39, 32), tick_time_ns(39, 32), 1)
    return directory


def test_rosbags_reads_the_same_values(bag):
    with AnyReader([bag]) as reader:
        for link in LINKS:
            connections = [c for c in reader.connections if c.topic == link.name]
            read = [
                (time, flat(reader.deserialize(raw, connection.msgtype)))
                for connection, time, raw in reader.messages(connections)
            ]
            expected = [
                (tick_time_ns(i, 32) + 2, value.tolist()) for i, value in enumerate(values(WIRES[link.link]), start=1)
            ]
            assert read == expected


def test_mcap_ros2_reads_the_same_values_from_the_schemas_in_the_file(bag):
    for link in LINKS:
        read = decoded(bag, link.name)
        assert [flat(value) for _, value in read] == [value.tolist() for value in values(WIRES[link.link])]
        assert [message.sequence for message, _ in read] == list(range(1, 201))
        assert [message.publish_time for message, _ in read] == [tick_time_ns(i, 32) for i in range(1, 201)]
        assert [message.log_time - message.publish_time for message, _ in read] == [2] * 200


def test_truth_is_an_ordinary_array_with_padding_in_front(bag):
    ((_, message),) = decoded(bag, TRUTH.name)
    layout, data = message.layout, message.data
    assert [(d.label, d.size, d.stride) for d in layout.dim] == [("tick", 40, 280), ("state", 7, 7)]
    rows, columns = layout.dim[0].size, layout.dim[1].size
    read = [[data[layout.data_offset + layout.dim[1].stride * i + j] for j in range(columns)] for i in range(rows)]
    np.testing.assert_array_equal(read, SAMPLES)


def test_metadata_yaml_says_what_the_file_holds(bag):
    with Reader(bag) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == {
            **{link.name: 200 for link in LINKS},
            TRUTH.name: 1,
        }
        assert {c.topic: c.digest for c in reader.connections} == {
            topic.name: type_hash(topic.type_name) for topic in [*LINKS, TRUTH]
        }
        assert reader.message_count == 200 * len(LINKS) + 1 == len(list(reader.messages()))
        assert reader.start_time == tick_time_ns(1, 32) + 2
        assert reader.duration == tick_time_ns(200, 32) - tick_time_ns(1, 32) + 1  # rosbags ends behind the last
        qos = reader.connections[0].ext.offered_qos_profiles[0]
        assert (qos.history.name, qos.reliability.name, qos.durability.name) == (
            "KEEP_ALL",
            "RELIABLE",
            "VOLATILE",
        )


def test_metadata_yaml_has_the_keys_of_jazzy_in_its_order(bag):
    text = (bag / "metadata.yaml").read_text()
    assert "*id" not in text  # legible: no YAML references
    information = yaml.safe_load(text)["rosbag2_bagfile_information"]
    assert list(information) == [
        "version",
        "storage_identifier",
        "duration",
        "starting_time",
        "message_count",
        "topics_with_message_count",
        "compression_format",
        "compression_mode",
        "relative_file_paths",
        "files",
        "custom_data",
        "ros_distro",
    ]
    assert information["version"] == 9
    assert information["storage_identifier"] == "mcap"
    assert information["ros_distro"] == "jazzy"
    assert information["relative_file_paths"] == ["bag_0.mcap"]
    assert information["files"][0]["message_count"] == information["message_count"]


def test_the_file_alone_carries_index_statistics_metadata_and_attachments(bag):
    with (bag / "bag_0.mcap").open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert reader.get_header().profile == "ros2"
        summary = reader.get_summary()
        assert summary.statistics.message_count == 200 * len(LINKS) + 1
        assert len(summary.chunk_indexes) >= len(LINKS)
        channels = {channel.topic: channel.metadata for channel in summary.channels.values()}
        assert channels["/point"]["etac_ros.kind"] == "network"
        assert channels["/point"]["etac_ros.link"] == "point"
        assert channels[TRUTH.name]["etac_ros.plant"] == "/sm/plant"
        assert channels["/point"]["topic_type_hash"] == type_hash("geometry_msgs/msg/Point32")
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
        assert metadata["etac_ros"].items() >= {"scenario": "toy", "seed": "7", "ticks_per_second": "32"}.items()
        assert yaml.safe_load(metadata["rosbag2"]["serialized_metadata"])["version"] == 9
        assert [(a.name, a.data) for a in reader.iter_attachments()] == [("resolved.yaml", b"seed: 7\n")]
        assert len(list(reader.iter_messages())) == 200 * len(LINKS) + 1


def test_a_bag_without_messages_opens(tmp_path):
    BagWriter(tmp_path / "empty", LINKS, {}, {"ticks_per_second": "1"}).close()
    with AnyReader([tmp_path / "empty"]) as reader:
        assert reader.message_count == 0
        assert [c.topic for c in reader.connections] == [link.name for link in LINKS]


def installed(type_name, suffix):
    package, _, name = type_name.split("/")
    prefixes = [sys.prefix, *os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)]
    for prefix in prefixes:
        path = Path(prefix, "share", package, "msg", name + suffix)
        if path.is_file():
            return path
    return pytest.skip(f"no ROS installation with {type_name} here")


@pytest.mark.parametrize("type_name", TYPES)
def test_type_hash_is_that_of_the_installed_ros(type_name):
    description = json.loads(installed(type_name, ".json").read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    assert type_hash(type_name) == hashes[type_name]


@pytest.mark.parametrize("type_name", TYPES)
def test_schema_text_alone_describes_the_type_of_the_installed_ros(type_name):
    description = json.loads(installed(type_name, ".json").read_text())
    hashes = {entry["type_name"]: entry["hash_string"] for entry in description["type_hashes"]}
    from_schema = Typestore()
    from_schema.register(get_types_from_msg(schema_text(type_name), type_name))
    assert set(from_schema.fielddefs) == set(hashes)
    assert {name: from_schema.hash_rihs01(name) for name in hashes} == hashes


@pytest.mark.parametrize("type_name", TYPES)
def test_schema_text_is_delimited_as_rosbag2_does(type_name):
    lines = schema_text(type_name).splitlines()
    delimiters = [i for i, line in enumerate(lines) if line.startswith("=")]
    assert all(lines[i] == "=" * 80 and lines[i + 1].startswith("MSG: ") for i in delimiters)
    named = [lines[i + 1].removeprefix("MSG: ") for i in delimiters]
    assert len(set(named)) == len(named)


@pytest.mark.parametrize("name", WIRES)
def test_serialized_messages_are_those_of_real_ros(name):
    serialization = pytest.importorskip("rclpy.serialization")
    wire = WIRES[name]
    package, _, kind = wire.type_name.split("/")
    message_class = getattr(pytest.importorskip(f"{package}.msg"), kind)
    for value in values(wire)[:20]:
        cdr = encode(wire.type_name, value, 1_500_000_000)
        assert len(cdr) == wire.cdr_bytes
        message = serialization.deserialize_message(cdr, message_class)
        assert flat(message) == value.tolist()
        if wire.format is WireFormat.STAMPED:
            header = message.header
            assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (1, 500_000_000, "")
        again = serialization.serialize_message(message)
        assert len(again) == len(cdr)
        assert decode(wire.type_name, again).tobytes() == value.tobytes()


def test_truth_is_laid_out_as_ros_reads_it():
    serialization = pytest.importorskip("rclpy.serialization")
    std_msgs = pytest.importorskip("std_msgs.msg")
    message = serialization.deserialize_message(encode_truth(17, SAMPLES), std_msgs.Float64MultiArray)
    assert message.layout.data_offset == 1
    assert [(axis.label, axis.size, axis.stride) for axis in message.layout.dim] == [
        ("tick", SAMPLES.shape[0], SAMPLES.size),
        ("state", SAMPLES.shape[1], SAMPLES.shape[1]),
    ]
    assert list(message.data) == [17.0, *SAMPLES.ravel()]
    first, samples = decode_truth(serialization.serialize_message(message))
    assert first == 17
    assert samples.tobytes() == SAMPLES.tobytes()
