"""A byte that was changed is noticed, wherever it stands, and never turns into a wrong value."""

import tempfile
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import encode
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription
from etac_ros.bag.write import BagWriter
from etac_ros.errors import BagError

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
METADATA = {"scenario": "toy", "ticks_per_second": "20"}


@cache
def example_bag():
    """The bytes of both files of a bag and what was written into it."""
    written = []
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder, "bag")
        with BagWriter(directory, [SIGNAL], {"s.yaml": b"seed: 1\n"}, METADATA) as writer:
            for number in range(1, 41):
                time = tick_time_ns(number, 20)
                cdr = encode(SIGNAL.type_name, np.array([number, 1.0, -number], dtype=np.float64), time)
                writer.write("/signal", cdr, time, time, number)
                written.append((SIGNAL, time, time, number, cdr))
                if number % 10 == 0:
                    writer.flush()
        return (directory / "bag_0.mcap").read_bytes(), (directory / "metadata.yaml").read_bytes(), written


def changed(data, place, difference):
    return data[:place] + bytes([data[place] ^ difference]) + data[place + 1 :]


def lay_down(folder, mcap, metadata):
    directory = Path(folder, "bag")
    directory.mkdir()
    (directory / "bag_0.mcap").write_bytes(mcap)
    (directory / "metadata.yaml").write_bytes(metadata)
    return directory


@settings(deadline=None, max_examples=200)
@given(st.data(), st.integers(1, 255))
def test_every_changed_byte_of_the_file_is_an_error(data, difference):
    mcap, metadata, _ = example_bag()
    place = data.draw(st.integers(0, len(mcap) - 1))
    with tempfile.TemporaryDirectory() as folder:
        directory = lay_down(folder, changed(mcap, place, difference), metadata)
        with pytest.raises(BagError) as caught:
            read_bag(directory)
        assert str(directory) in caught.value.where


@settings(deadline=None, max_examples=200)
@given(st.data(), st.integers(1, 255))
def test_recovery_after_a_changed_byte_gives_what_stands_before_and_nothing_else(data, difference):
    mcap, metadata, written = example_bag()
    place = data.draw(st.integers(0, len(mcap) - 1))
    with tempfile.TemporaryDirectory() as folder:
        directory = lay_down(folder, changed(mcap, place, difference), metadata)
        try:
            recover(directory)
        except BagError:
            return
        bag = read_bag(directory)
        found = list(bag.messages())
        assert found == written[: len(found)]
        assert {key: value for key, value in bag.metadata.items() if key != "recovered"} == METADATA
        assert bag.attachments in ({"s.yaml": b"seed: 1\n"}, {})


@settings(deadline=None, max_examples=200)
@given(st.data(), st.integers(1, 255))
def test_a_changed_byte_in_metadata_yaml_never_changes_what_is_read(data, difference):
    mcap, metadata, written = example_bag()
    place = data.draw(st.integers(0, len(metadata) - 1))
    with tempfile.TemporaryDirectory() as folder:
        directory = lay_down(folder, mcap, changed(metadata, place, difference))
        try:
            bag = read_bag(directory)
        except BagError:
            return
        assert list(bag.messages()) == written
        assert bag.metadata == METADATA


def test_a_damaged_chunk_is_named_with_its_place(tmp_path):
    mcap, metadata, _ = example_bag()
    place = mcap.index((20).to_bytes(4, "little") + tick_time_ns(20, 20).to_bytes(8, "little"))
    directory = lay_down(tmp_path, changed(mcap, place, 1), metadata)
    with pytest.raises(BagError, match=r"byte \d+: the checksum of this chunk is wrong") as caught:
        read_bag(directory)
    assert caught.value.where == str(directory / "bag_0.mcap")
    assert caught.value.remedy == f"etac recover {directory}"
    assert recover(directory).messages == {"/signal": 10}


@pytest.mark.parametrize("length", [0, 15, 19, 21, 2**63])
def test_a_footer_of_another_length_is_noticed(tmp_path, length):
    mcap, metadata, written = example_bag()
    footer = len(mcap) - 8 - 20 - 9
    assert mcap[footer : footer + 9] == b"\x02" + (20).to_bytes(8, "little")
    directory = lay_down(tmp_path, mcap[: footer + 1] + length.to_bytes(8, "little") + mcap[footer + 9 :], metadata)
    with pytest.raises(BagError, match=f"byte {footer}: "):
        read_bag(directory)
    recover(directory)
    assert list(read_bag(directory).messages()) == written


@pytest.mark.parametrize("opcode", [0x07, 0x0B, 0x86])
def test_a_chunk_that_no_longer_looks_like_one_leaves_no_gap(tmp_path, opcode):
    mcap, metadata, written = example_bag()
    time = tick_time_ns(11, 20).to_bytes(8, "little")
    place = next(
        i
        for i in range(len(mcap))
        if mcap[i] == 0x06 and mcap[i + 9 : i + 17] == time  # the second chunk
    )
    directory = lay_down(tmp_path, changed(mcap, place, mcap[place] ^ opcode), metadata)
    recover(directory)
    assert list(read_bag(directory).messages()) == written[:10]


def test_a_missing_message_in_metadata_yaml_is_named_with_its_topic(tmp_path):
    mcap, metadata, _ = example_bag()
    wrong = metadata.replace(b"message_count: 40", b"message_count: 41")
    directory = lay_down(tmp_path, mcap, wrong)
    with pytest.raises(BagError, match=r"40 messages in the \.mcap file, 41 in metadata\.yaml") as caught:
        read_bag(directory)
    assert "/signal" in caught.value.where
    recover(directory)
    assert len(list(read_bag(directory).messages())) == 40


def test_a_whole_bag_is_read_in_this_very_way(tmp_path):
    mcap, metadata, written = example_bag()
    directory = lay_down(tmp_path, mcap, metadata)
    assert list(read_bag(directory).messages()) == written
