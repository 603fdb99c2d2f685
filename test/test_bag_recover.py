"""A bag that was cut off loses its unwritten tail and nothing else."""

import os
import signal
import subprocess
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader

import etac_ros
import etac_ros.bag.write
from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.contents import Contents
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.errors import BagError

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
TORQUE = TopicDescription("/torque", "std_msgs/msg/Float64MultiArray", "physical", "torque")
TRUTH = truth_topic("/plant")
METADATA = {"scenario": "toy", "ticks_per_second": "20"}

RECORDER = """
import sys
from pathlib import Path
from etac_ros.bag.codec import encode
from etac_ros.bag.topics import TopicDescription
from etac_ros.bag.write import BagWriter

import numpy as np

topic = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
writer = BagWriter(Path(sys.argv[1]), [topic], {"s.yaml": b"x: 1"}, {"ticks_per_second": "20"})

def write(number):
    time = number * 50_000_000
    cdr = encode(topic.type_name, np.array([number, -number, 0.5]), time)
    writer.write(topic.name, cdr, time, time, number)

for number in range(1, 1001):
    write(number)
writer.flush()
for number in range(1001, 1011):
    write(number)
print("ready", flush=True)
sys.stdin.read()
"""


def cut_off(directory):
    """A recorder's directory after its process was killed; it had 10 more messages than it had flushed."""
    source = Path(etac_ros.__file__).parents[1]
    environment = {**os.environ, "PYTHONPATH": f"{source}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    command = [sys.executable, "-c", RECORDER, str(directory)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, env=environment
    ) as process:
        try:
            assert process.stdout.readline() == "ready\n"
        finally:
            process.send_signal(signal.SIGKILL)
    assert process.returncode == -signal.SIGKILL


def test_a_killed_recorder_loses_only_what_was_not_flushed(tmp_path):
    directory = tmp_path / "killed"
    cut_off(directory)
    with pytest.raises(BagError, match="cut off") as caught:
        read_bag(directory)
    assert caught.value.remedy == f"etac recover {directory}"

    report = recover(directory)

    saved = report.messages["/signal"]
    assert 1000 <= saved <= 1010
    assert not report.nothing_to_do
    assert report.found.startswith("byte ")
    assert "cut off" in report.found
    with AnyReader([directory]) as reader:
        read = [reader.deserialize(raw, connection.msgtype) for connection, _, raw in reader.messages()]
    assert [(m.x, m.y, m.z) for m in read] == [(n, -n, 0.5) for n in range(1, saved + 1)]
    bag = read_bag(directory)
    assert bag.metadata == {"recovered": report.found, "ticks_per_second": "20"}
    assert bag.attachments == {"s.yaml": b"x: 1"}
    assert [m.sequence for m in bag.recording().messages["signal"]] == list(range(1, saved + 1))


@cache
def example_bag():
    """A bag's bytes, what was written into it, and how far a flush had brought both each time."""
    written, flushed = [], [(0, 0)]
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder, "bag")
        writer = BagWriter(directory, [SIGNAL, TORQUE, TRUTH], {"s.yaml": b"seed: 1\n"}, METADATA)
        for tick in range(30):
            time = tick_time_ns(tick, 20)
            value = np.array([tick, tick / 2, -tick], dtype=np.float64)
            messages = [
                (SIGNAL, encode(SIGNAL.type_name, value, time), time, time, tick + 1),
                (TORQUE, encode(TORQUE.type_name, value, time), time, time + 1, tick + 1),
                (TRUTH, encode_truth(tick, value[np.newaxis]), time, time, tick + 1),
            ]
            for topic, cdr, logged, published, sequence in messages:
                writer.write(topic.name, cdr, logged, published, sequence)
                written.append((topic, logged, published, sequence, cdr))
            if tick % 6 == 5:
                writer.flush()
                flushed.append((os.path.getsize(directory / "bag_0.mcap"), len(written)))
        writer.close()
        return (directory / "bag_0.mcap").read_bytes(), written, flushed


def recovered(data):
    """What recover makes of a file with this content: the messages, or the error."""
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder, "bag")
        directory.mkdir()
        (directory / "bag_0.mcap").write_bytes(data)
        try:
            report = recover(directory)
        except BagError as error:
            assert (directory / "bag_0.mcap").read_bytes() == data
            assert os.listdir(directory) == ["bag_0.mcap"]
            return error
        bag = read_bag(directory)
        messages = list(bag.messages())
        bag.recording()
        assert (directory / "bag_0.mcap.cut").read_bytes() == data
        assert {topic.name: count.messages for topic, count in bag.topics.items()} == report.messages
        assert {k: v for k, v in bag.metadata.items() if k != "recovered"} == METADATA
        assert bag.attachments == {"s.yaml": b"seed: 1\n"}
        return messages


@settings(deadline=None, max_examples=200)
@given(st.data())
def test_wherever_a_file_ends_its_whole_chunks_are_saved_and_nothing_is_made_up(data):
    whole, written, flushed = example_bag()
    cut = data.draw(st.integers(0, len(whole) - 1))
    safe = max(count for size, count in flushed if size <= cut)
    result = recovered(whole[:cut])
    if isinstance(result, BagError):
        assert safe == 0
    else:
        assert result == written[: len(result)]
        assert len(result) >= safe
        assert len(result) in [count for _, count in flushed]


@settings(deadline=None, max_examples=30)
@given(st.binary(min_size=1, max_size=300))
@example(bytes(4096))
@example(b"\x07" + bytes(8))
@example(b"\x06" + (2**63).to_bytes(8, "little"))
def test_rubbish_behind_the_last_flush_is_left_out(rubbish):
    whole, written, flushed = example_bag()
    size, count = flushed[-2]
    result = recovered(whole[:size] + rubbish)
    assert result == written[:count]


def test_recovering_twice_finds_nothing_to_do(tmp_path):
    whole, written, _ = example_bag()
    directory = tmp_path / "bag"
    directory.mkdir()
    (directory / "bag_0.mcap").write_bytes(whole)  # whole, but without metadata.yaml
    first = recover(directory)
    assert not first.nothing_to_do
    assert first.original == directory / "bag_0.mcap.cut"
    before = {path.name: path.read_bytes() for path in directory.iterdir()}
    second = recover(directory)
    assert second.nothing_to_do
    assert second.messages == first.messages == {"/signal": 30, "/torque": 30, "/emulation/plant/truth": 30}
    assert {path.name: path.read_bytes() for path in directory.iterdir()} == before
    assert sorted(before) == ["bag_0.mcap", "bag_0.mcap.cut", "metadata.yaml"]
    assert list(read_bag(directory).messages()) == written


def test_a_second_repair_keeps_both_originals(tmp_path):
    whole, _, flushed = example_bag()
    directory = tmp_path / "bag"
    directory.mkdir()
    path = directory / "bag_0.mcap"
    path.write_bytes(whole[: flushed[3][0]])
    recover(directory)
    path.write_bytes(path.read_bytes()[:-1])
    report = recover(directory)
    assert report.original == directory / "bag_0.mcap.cut2"
    assert (directory / "bag_0.mcap.cut").read_bytes() == whole[: flushed[3][0]]


def test_with_an_output_the_bag_itself_is_left_alone(tmp_path):
    whole, written, flushed = example_bag()
    directory = tmp_path / "bag"
    directory.mkdir()
    (directory / "bag_0.mcap").write_bytes(whole[: flushed[2][0]])
    report = recover(directory, tmp_path / "saved")
    assert report.bag == tmp_path / "saved"
    assert report.original is None
    assert os.listdir(directory) == ["bag_0.mcap"]
    assert list(read_bag(tmp_path / "saved").messages()) == written[: flushed[2][1]]
    assert (tmp_path / "saved" / "saved_0.mcap").is_file()


def test_a_bag_whose_directory_was_renamed_is_repaired_under_its_old_file_name(tmp_path):
    whole, _, flushed = example_bag()
    directory = tmp_path / "renamed"
    directory.mkdir()
    (directory / "bag_0.mcap").write_bytes(whole[: flushed[2][0]])
    recover(directory)
    assert sorted(os.listdir(directory)) == ["bag_0.mcap", "bag_0.mcap.cut", "metadata.yaml"]
    with AnyReader([directory]) as reader:
        assert reader.message_count == flushed[2][1] > 0


def saved_so_far(path):
    """Messages that can be read from a file that is still being written."""
    found = []
    try:
        for message in Contents(path).messages():
            found.append(message.sequence)
    except BagError:
        pass
    return found


def test_writing_flushes_by_itself_every_half_second(tmp_path, monkeypatch):
    clock = SimpleNamespace(now=100.0)
    monkeypatch.setattr(etac_ros.bag.write, "time", SimpleNamespace(monotonic=lambda: clock.now))
    path = tmp_path / "bag" / "bag_0.mcap"
    with BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA) as writer:
        writer.write("/signal", bytes(16), 0, 0, 1)
        clock.now += 0.4
        writer.write("/signal", bytes(16), 0, 0, 2)
        assert saved_so_far(path) == []
        clock.now += 0.2
        writer.write("/signal", bytes(16), 0, 0, 3)
        assert saved_so_far(path) == [1, 2, 3]
        writer.write("/signal", bytes(16), 0, 0, 4)
        assert saved_so_far(path) == [1, 2, 3]
        writer.flush()
        assert saved_so_far(path) == [1, 2, 3, 4]


def test_an_exception_in_the_run_leaves_a_finished_bag(tmp_path):
    def broken_run():
        with BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA) as writer:
            writer.write("/signal", bytes(16), 0, 0, 1)
            raise RuntimeError("the run broke")

    with pytest.raises(RuntimeError, match="the run broke"):
        broken_run()
    assert [m.sequence for m in read_bag(tmp_path / "bag").messages()] == [1]
