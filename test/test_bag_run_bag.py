"""Wherever the bag of a run ends, the messages that led to its samples are in it."""

import tempfile
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import etac_ros.bag.run_bag
from etac_ros.bag.clock import log_time_ns, tick_time_ns
from etac_ros.bag.codec import encode, encode_truth
from etac_ros.bag.contents import Contents
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.bag.run_bag import RunBag
from etac_ros.bag.topics import link_topic, truth_topic
from etac_ros.errors import BagError
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

RATE = 32


@pytest.fixture
def clock(monkeypatch):
    found = SimpleNamespace(now=100.0)
    monkeypatch.setattr(etac_ros.bag.run_bag, "time", SimpleNamespace(monotonic=lambda: found.now))
    return found


@pytest.fixture(scope="module")
def graph():
    return load("wu2018").build()


def truth(bag, first, count=4):
    time = tick_time_ns(first + count - 1, RATE)
    bag.write(truth_topic("/plant").name, encode_truth(first, np.ones((count, 7))), time, time, first // count + 1)


def said(bag, graph, tick, number):
    topic = link_topic(next(iter(graph.links.values())))
    time = tick_time_ns(tick, RATE)
    bag.write(topic.name, encode(topic.type_name, np.ones(3), time), log_time_ns(time, 1), time, number)


def order(directory):
    """Ticks of what stands in the bag, in its order: messages as they are, truth as minus its last tick."""
    found = []
    try:
        for raw in Contents(next(directory.glob("*.mcap"))).messages():
            tick = raw.tick_time_ns * RATE // 10**9
            found.append(-tick if raw.topic.plant else tick)
    except BagError:
        pass  # it is open
    return found


def test_truth_waits_for_the_messages_before_it(tmp_path, graph, clock):
    with RunBag(tmp_path / "bag", graph, {}, {}) as bag:
        truth(bag, 0)
        truth(bag, 4)
        said(bag, graph, 1, 1)
        said(bag, graph, 5, 2)
        bag.placed_until(tick_time_ns(4, RATE))
        said(bag, graph, 6, 3)
        bag.placed_until(tick_time_ns(6, RATE))
        truth(bag, 8)
        said(bag, graph, 9, 4)
    assert order(tmp_path / "bag") == [1, 5, -3, 6, 9, -7, -11]


def test_truth_waits_no_longer_than_half_a_second(tmp_path, graph, clock):
    with RunBag(tmp_path / "bag", graph, {}, {}) as bag:
        truth(bag, 0)
        clock.now += 0.4
        truth(bag, 4)
        bag._writer.flush()
        assert order(tmp_path / "bag") == []
        clock.now += 0.2
        said(bag, graph, 1, 1)
        bag._writer.flush()
        assert order(tmp_path / "bag") == [1, -3]
        bag.flush()
        assert order(tmp_path / "bag") == [1, -3, -7]


def test_what_is_secured_is_in_the_file_and_truth_that_waits_still_waits(tmp_path, graph, clock):
    with RunBag(tmp_path / "bag", graph, {}, {}) as bag:
        truth(bag, 0)
        truth(bag, 4)
        said(bag, graph, 1, 1)
        bag.placed_until(tick_time_ns(4, RATE))
        assert order(tmp_path / "bag") == []
        bag.secure()
        assert order(tmp_path / "bag") == [1, -3]


def test_truth_that_waits_has_a_limit_of_size(tmp_path, graph, clock):
    with RunBag(tmp_path / "bag", graph, {}, {}) as bag:
        for first in range(0, 1024 * 40, 1024):
            truth(bag, first, 1024)
            assert bag._held_bytes <= 1024 * 1024
        assert bag._held_bytes > 900 * 1024
        bag._writer.flush()
        assert order(tmp_path / "bag")[:2] == [-1023, -2047]


def test_a_writer_that_is_placed_ahead_holds_nothing(tmp_path, graph, clock):
    with RunBag(tmp_path / "bag", graph, {}, {}) as bag:
        bag.placed_until(tick_time_ns(100, RATE))
        bag.placed_until(tick_time_ns(50, RATE))
        truth(bag, 0)
        bag._writer.flush()
        assert order(tmp_path / "bag") == [-3]


@given(st.integers(1, 99))
def test_a_short_run_cut_anywhere_holds_the_messages_before_its_samples(part):
    whole, sent = short_run()
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder, "bag")
        directory.mkdir()
        (directory / "bag_0.mcap").write_bytes(whole[: len(whole) * part // 100])
        try:
            recover(directory)
        except BagError:
            assert part < 20
            return
        recording = read_bag(directory).recording()
        assert all(recording.messages.values())
        last = max((first + len(samples) - 1 for first, samples in recording.truth["/plant"]), default=-1)
        for link, ticks in sent.items():
            kept = [message.tick for message in recording.messages[link]]
            assert kept == ticks[: len(kept)]
            assert len(kept) >= sum(tick <= last for tick in ticks)


@cache
def short_run():
    """The bytes of a bag, and the ticks of what was sent on each link."""
    with tempfile.TemporaryDirectory() as folder:
        run = run_in_process(load("wu2018", None, ["duration_s=60"]), Path(folder, "bag"))
        data = Path(folder, "bag", "bag_0.mcap").read_bytes()
    return data, {link: [message.tick for message in sent] for link, sent in run.recording.messages.items()}
