"""Whatever stands in the way of a bag is told in words: where, what was found, what to do about it."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import decode, encode, encode_truth
from etac_ros.bag.describe import describe
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription, truth_topic
from etac_ros.bag.write import BagWriter, check_writable
from etac_ros.errors import BagError
from etac_ros.graph.truth import unpack_truth

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
TRUTH = truth_topic("/plant")
METADATA = {"ticks_per_second": "20"}


def message(value, tick=0):
    return encode(SIGNAL.type_name, np.array(value, dtype=np.float64), tick_time_ns(tick, 20))


def truth(tick, samples):
    time = tick_time_ns(tick, 20)
    return TRUTH, encode_truth(tick, samples), time, time, 1


@pytest.mark.parametrize("make", [os.mkdir, lambda path: open(path, "x").close(), lambda path: os.symlink("no", path)])
def test_what_stands_there_already_is_not_written_to(tmp_path, make):
    path = tmp_path / "bag"
    make(path)
    for attempt in (check_writable, lambda path: BagWriter(path, [SIGNAL], {}, METADATA)):
        with pytest.raises(BagError, match="exists already") as caught:
            attempt(path)
        assert caught.value.where == str(path)
        assert caught.value.remedy


@pytest.mark.parametrize("below", ["bag", "deeper/bag"])
def test_a_file_as_parent_is_named(tmp_path, below):
    (tmp_path / "file").touch()
    for attempt in (check_writable, lambda path: BagWriter(path, [SIGNAL], {}, METADATA)):
        with pytest.raises(BagError, match="file is no directory"):
            attempt(tmp_path / "file" / below)


def test_a_parent_without_permission_is_named(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "access", lambda path, mode: False)  # root, as in CI, may write anywhere
    with pytest.raises(BagError, match=f"{tmp_path} may not be written to"):
        check_writable(tmp_path / "bag")


@pytest.mark.parametrize("place", ["/proc/etac_ros", "/proc/etac_ros/bag"])
def test_a_place_where_nothing_can_be_made_is_named_before_a_run(place):
    with pytest.raises(BagError, match=f"{place}: (cannot be made: |/proc may not be written to)"):
        check_writable(Path(place))


def test_a_name_that_is_too_long_is_named_before_a_run(tmp_path):
    with pytest.raises(BagError, match="cannot be made: File name too long"):
        check_writable(tmp_path / ("x" * 300))
    assert not list(tmp_path.iterdir())


def test_checking_creates_nothing_and_writing_creates_all_parents(tmp_path):
    check_writable(tmp_path / "a" / "b" / "bag")
    assert os.listdir(tmp_path) == []
    BagWriter(tmp_path / "a" / "b" / "bag", [SIGNAL], {}, METADATA).close()
    assert sorted(os.listdir(tmp_path / "a" / "b" / "bag")) == ["bag_0.mcap", "metadata.yaml"]


def test_a_relative_directory_is_named_after_itself(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BagError, match="exists already"):
        check_writable(tmp_path.__class__("."))
    BagWriter(tmp_path.__class__("here"), [SIGNAL], {}, METADATA).close()
    assert (tmp_path / "here" / "here_0.mcap").is_file()


@pytest.mark.parametrize("metadata", [{}, {"ticks_per_second": "0"}, {"ticks_per_second": "1/32 s"}])
def test_a_bag_without_a_tick_grid_is_refused_before_anything_is_made(tmp_path, metadata):
    with pytest.raises(BagError, match="ticks_per_second"):
        BagWriter(tmp_path / "bag", [SIGNAL], {}, metadata)
    assert os.listdir(tmp_path) == []


def test_an_unknown_message_type_is_refused_before_anything_is_made(tmp_path):
    with pytest.raises(BagError, match="my_msgs/msg/Own"):
        BagWriter(tmp_path / "bag", [TopicDescription("/x", "my_msgs/msg/Own", "network", "x")], {}, METADATA)
    assert os.listdir(tmp_path) == []


def test_a_message_on_a_topic_that_was_not_announced_is_refused(tmp_path):
    with (
        BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA) as writer,
        pytest.raises(BagError, match="/other"),
    ):
        writer.write("/other", message([1, 2, 3]), 0, 0, 1)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs the device that is always full")
def test_a_full_disk_is_an_error_that_says_so(tmp_path):
    writer = BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA)
    with open("/dev/full", "wb") as full:
        os.dup2(full.fileno(), writer._file.fileno())
    writer.write("/signal", message([1, 2, 3]), 0, 0, 1)
    for attempt in (writer.flush, writer.close):
        with pytest.raises(BagError, match="No space left") as caught:
            attempt()
        assert caught.value.where == str(tmp_path / "bag")
    writer.close()  # a second time, as `with` does after an error


@pytest.mark.parametrize("open_bag", [read_bag, describe, recover])
def test_what_is_no_bag_is_named(tmp_path, open_bag):
    (tmp_path / "file.mcap").touch()
    (tmp_path / "empty").mkdir()
    (tmp_path / "two").mkdir()
    (tmp_path / "two" / "a.mcap").touch()
    (tmp_path / "two" / "b.mcap").touch()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "other_0.mcap").write_bytes(b"SQLite format 3 and so on")
    (tmp_path / "other" / "metadata.yaml").write_text("rosbag2_bagfile_information: {topics_with_message_count: []}")
    for name, found in {
        "nowhere": "is not there",
        "file.mcap": "is a file",
        "empty": "holds 0 .mcap files",
        "two": "holds 2 .mcap files",
        "other": "is no MCAP file",
    }.items():
        with pytest.raises(BagError, match=found) as caught:
            open_bag(tmp_path / name)
        assert str(tmp_path / name) in caught.value.where
        assert caught.value.expected


def foreign_bag(directory, compression=CompressionType.NONE, keys=()):
    directory.mkdir()
    writer = Writer(str(directory / "bag_0.mcap"), compression=compression)
    writer.start(profile="ros2")
    schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
    channel = writer.register_channel("/empty", "cdr", schema, dict(keys))
    writer.add_message(channel, 0, bytes(4), 0)
    writer.finish()
    (directory / "metadata.yaml").write_text("rosbag2_bagfile_information: {topics_with_message_count: []}")


@pytest.mark.parametrize("open_bag", [read_bag, recover])
def test_a_bag_of_somebody_else_is_not_called_damaged(tmp_path, open_bag):
    foreign_bag(tmp_path / "bag")
    with pytest.raises(BagError, match="/empty") as caught:
        open_bag(tmp_path / "bag")
    assert "etac_ros recorded" in caught.value.expected
    assert "recover" not in caught.value.remedy


@pytest.mark.parametrize("open_bag", [read_bag, recover])
def test_topics_of_ours_without_a_run_are_no_bag_of_ours(tmp_path, open_bag):
    foreign_bag(tmp_path / "bag", keys={"etac_ros.kind": "network"})
    with pytest.raises(BagError, match="ticks_per_second") as caught:
        open_bag(tmp_path / "bag")
    assert "etac_ros recorded" in caught.value.expected


def test_a_bag_without_one_whole_message_cannot_be_recovered(tmp_path):
    BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA)  # opened, and never heard of again
    with pytest.raises(BagError, match="no message in it is whole"):
        recover(tmp_path / "bag")
    assert os.listdir(tmp_path / "bag") == ["bag_0.mcap"]


def test_recovery_does_not_write_over_an_output(tmp_path):
    BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA)
    with pytest.raises(BagError, match="exists already"):
        recover(tmp_path / "bag", tmp_path)


def written(directory, messages, topics=(SIGNAL, TRUTH)):
    with BagWriter(directory, topics, {}, METADATA) as writer:
        for topic, cdr, logged, published, sequence in messages:
            writer.write(topic.name, cdr, logged, published, sequence)
    return read_bag(directory)


@pytest.mark.parametrize(
    ("messages", "found"),
    [
        ([(SIGNAL, message([1, 2, 3]), 7, 7, 1)], "message 1: no tick of a grid of 20 a second lies at 7 ns"),
        ([(SIGNAL, message([1, 2, 3]), 1000, 0, 1)], "message 1: log time 1000 ns"),
        ([(SIGNAL, message([1, 2, 3])[:-4], 0, 0, 1)], "message 1: "),
        ([(SIGNAL, message([1, 2, 3]), 0, 0, 4)] * 2, "message 4 stands there twice"),
        ([(TRUTH, bytes(8), 0, 0, 1)], "message 1: "),
        (
            [(TRUTH, encode_truth(3, np.ones((2, 3))), 0, 0, 1)],
            "message 1: it is logged at tick 0 and ends with tick 4",
        ),
        (
            [truth(k, np.ones((1, 3))) for k in (0, 1, 3)],
            "tick 3 stands where tick 2 should",
        ),
        (
            [truth(k, np.ones((1, 3))) for k in (0, 1, 1)],
            "tick 1 stands where tick 2 should",
        ),
        (
            [
                (TRUTH, encode_truth(k, np.ones((1, 3 + k))), tick_time_ns(k, 20), tick_time_ns(k, 20), 1)
                for k in (0, 1)
            ],
            "the number of states changes at tick 1",
        ),
    ],
)
def test_messages_that_are_those_of_no_run_are_named(tmp_path, messages, found):
    bag = written(tmp_path / "bag", messages)
    with pytest.raises(BagError) as caught:
        bag.recording()
    assert found in caught.value.found
    assert str(tmp_path / "bag") in caught.value.where


@pytest.mark.parametrize(
    ("data", "offset", "sizes"),
    [
        ([0.0, 1.0, 2.0], 0, (1, 2)),
        ([0.0, 1.0, 2.0], 1, (2,)),
        ([0.0, 1.0, 2.0], 1, (2, 2)),
        ([0.0], 1, (0, 2)),
        ([0.5, 1.0, 2.0], 1, (1, 2)),
        ([-1.0, 1.0, 2.0], 1, (1, 2)),
        ([np.nan, 1.0, 2.0], 1, (1, 2)),
        ([np.inf, 1.0, 2.0], 1, (1, 2)),
    ],
)
def test_an_array_that_is_no_truth_is_refused(data, offset, sizes):
    with pytest.raises(ValueError, match=r"instead of|is no tick"):
        unpack_truth(np.array(data), offset, sizes)


def test_a_type_that_no_link_carries_is_refused():
    with pytest.raises(ValueError, match="no link carries"):
        encode("std_msgs/msg/String", np.ones(3), 0)
    with pytest.raises(ValueError, match="no link carries"):
        decode("std_msgs/msg/Float64", bytes(12))


def test_an_error_crosses_a_process_border(tmp_path):
    BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA).close()
    path = tmp_path / "bag" / "bag_0.mcap"
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(BagError) as caught:
        read_bag(tmp_path / "bag")
    assert str(pickle.loads(pickle.dumps(caught.value))) == str(caught.value)
