"""Nobody touches a bag that somebody else has open, and two writers never share one."""

import fcntl
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from etac_ros.bag.codec import encode
from etac_ros.bag.lock import is_being_written
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.topics import TopicDescription
from etac_ros.bag.write import BagWriter
from etac_ros.errors import BagError

SIGNAL = TopicDescription("/signal", "geometry_msgs/msg/Point32", "network", "signal")
METADATA = {"ticks_per_second": "20"}


def write_one(writer, number):
    writer.write("/signal", encode(SIGNAL.type_name, np.ones(3), 0), 0, 0, number)


@pytest.mark.parametrize("output", [None, "saved"])
def test_a_bag_that_is_being_written_is_not_repaired(tmp_path, output):
    with BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA) as writer:
        write_one(writer, 1)
        writer.flush()
        before = (tmp_path / "bag" / "bag_0.mcap").read_bytes()
        with pytest.raises(BagError, match="another process still writes it") as caught:
            recover(tmp_path / "bag", None if output is None else tmp_path / output)
        assert caught.value.expected
        assert caught.value.remedy
        assert os.listdir(tmp_path) == ["bag"]
        assert os.listdir(tmp_path / "bag") == ["bag_0.mcap"]
        assert (tmp_path / "bag" / "bag_0.mcap").read_bytes() == before
        with pytest.raises(BagError, match="is still being written"):
            read_bag(tmp_path / "bag")
        write_one(writer, 2)
    assert [message.sequence for message in read_bag(tmp_path / "bag").messages()] == [1, 2]


def test_a_bag_whose_writer_is_gone_is_free(tmp_path):
    writer = BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA)
    write_one(writer, 1)
    writer.flush()
    writer._file.close()  # what the end of its process does
    with pytest.raises(BagError, match="its recorder was cut off"):
        read_bag(tmp_path / "bag")
    assert recover(tmp_path / "bag").messages == {"/signal": 1}


def test_of_many_writers_one_gets_the_directory(tmp_path):
    def attempt(number):
        try:
            with BagWriter(tmp_path / "deep" / "bag", [SIGNAL], {}, METADATA) as writer:
                write_one(writer, number)
        except BagError as error:
            return str(error)
        return number

    with ThreadPoolExecutor(16) as pool:
        results = list(pool.map(attempt, range(1, 41)))
    (winner,) = [result for result in results if isinstance(result, int)]
    assert all("exists already" in result for result in results if result != winner)
    assert [message.sequence for message in read_bag(tmp_path / "deep" / "bag").messages()] == [winner]


def test_a_child_that_has_inherited_the_file_keeps_nobody_out(tmp_path):
    writer = BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA)
    inherited = os.dup(writer._file.fileno())
    try:
        write_one(writer, 1)
        writer.close()
        assert [message.sequence for message in read_bag(tmp_path / "bag").messages()] == [1]
        assert recover(tmp_path / "bag").nothing_to_do
    finally:
        os.close(inherited)


def test_any_number_may_look_at_the_same_time(tmp_path):
    with BagWriter(tmp_path / "bag", [SIGNAL], {}, METADATA) as writer:
        write_one(writer, 1)
    path = tmp_path / "bag" / "bag_0.mcap"
    with path.open("rb") as other:
        fcntl.flock(other, fcntl.LOCK_SH)  # in the midst of its look
        assert not is_being_written(path)
