"""`etac info`: what is in a bag, counted by topic and by plane."""

import numpy as np
import pytest

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.describe import Total, describe
from etac_ros.bag.topics import TopicDescription, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.errors import BagError

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
STATE = TopicDescription("/state", "std_msgs/msg/Float32MultiArray", "network", "state")
COMMAND = TopicDescription("/command", "geometry_msgs/msg/WrenchStamped", "internal", "command")
TORQUE = TopicDescription("/emulation/torque", "std_msgs/msg/Float64MultiArray", "physical", "torque")
WINDOW = TopicDescription("/emulation/window", "std_msgs/msg/Float64MultiArray", "emulation")
SILENT = TopicDescription("/silent", "geometry_msgs/msg/Point32", "network", "silent")
TRUTH = truth_topic("/plant")
TOPICS = [SIGNAL, STATE, COMMAND, TORQUE, WINDOW, SILENT, TRUTH]


@pytest.fixture
def bag(tmp_path):
    metadata = {"scenario": "toy", "ticks_per_second": "10"}
    with BagWriter(tmp_path / "bag", TOPICS, {"s.yaml": b"12345"}, metadata) as writer:
        for topic, size, ticks in [
            (SIGNAL, 3, (5, 9)),
            (STATE, 7, (0,)),
            (COMMAND, 6, (1, 2)),
            (TORQUE, 3, (20,)),
        ]:
            for sequence, tick in enumerate(ticks, start=1):
                time = tick_time_ns(tick, 10)
                writer.write(topic.name, encode(topic.type_name, np.ones(size), time), time, time, sequence)
        writer.write(WINDOW.name, encode(WINDOW.type_name, np.ones(100), 0), 0, 0, 1)
        writer.write(TRUTH.name, encode_truth(0, np.ones((31, 2))), tick_time_ns(30, 10), tick_time_ns(30, 10), 1)
    return tmp_path / "bag"


def test_topics_are_counted_one_by_one(bag):
    rows = {row.topic: row for row in describe(bag).topics}
    assert list(rows) == [topic.name for topic in TOPICS]
    signal = rows["/signal"]
    assert (signal.kind, signal.type_name) == ("network", "geometry_msgs/msg/Point32")
    assert (signal.messages, signal.payload_bytes, signal.cdr_bytes) == (2, 24, 32)
    assert (signal.first_s, signal.last_s) == (0.5, 0.9)
    assert (rows["/state"].payload_bytes, rows["/state"].cdr_bytes) == (28, 44)
    assert (rows["/command"].payload_bytes, rows["/command"].cdr_bytes) == (96, 136)  # float64
    silent = rows["/silent"]
    assert (silent.messages, silent.payload_bytes, silent.first_s, silent.last_s) == (0, 0, None, None)
    assert rows["/emulation/plant/truth"].payload_bytes == 0  # no link: the papers' figure is not defined


def test_planes_are_never_added_up(bag):
    description = describe(bag)
    assert description.network == Total(messages=3, payload_bytes=52, cdr_bytes=76)
    assert description.internal == Total(messages=2, payload_bytes=96, cdr_bytes=136)
    assert description.emulation.messages == 3
    assert description.emulation.payload_bytes == 24


def test_the_run_is_described(bag):
    description = describe(bag)
    assert description.duration_s == 3.0
    assert description.metadata == {"scenario": "toy", "ticks_per_second": "10"}
    assert description.attachments == {"s.yaml": 5}
    assert description.file_bytes == (bag / "bag_0.mcap").stat().st_size


def test_duration_begins_with_the_first_message(tmp_path):
    with BagWriter(tmp_path / "bag", [SIGNAL], {}, {"ticks_per_second": "10"}) as writer:
        for sequence, tick in enumerate((20, 50), start=1):
            time = tick_time_ns(tick, 10)
            writer.write("/signal", bytes(16), time, time, sequence)
    assert describe(tmp_path / "bag").duration_s == 3.0


def test_a_bag_without_messages_has_no_duration(tmp_path):
    BagWriter(tmp_path / "bag", [SIGNAL], {}, {"ticks_per_second": "10"}).close()
    assert describe(tmp_path / "bag").duration_s == 0.0


def test_a_message_that_does_not_fit_its_type_is_named(tmp_path):
    with BagWriter(tmp_path / "bag", [SIGNAL], {}, {"ticks_per_second": "10"}) as writer:
        writer.write("/signal", b"\0\1\0\0abc", 0, 0, 17)
    with pytest.raises(BagError, match="message 17") as caught:
        describe(tmp_path / "bag")
    assert "/signal" in caught.value.where
