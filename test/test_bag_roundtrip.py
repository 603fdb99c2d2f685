"""A recording that was written to a bag and read back is the same to the last bit."""

import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from toy import Ramp, RampParameters

from etac_ros.bag.clock import tick_time_ns
from etac_ros.bag.codec import decode_truth, encode, encode_truth
from etac_ros.bag.description import DESCRIPTION_ATTACHMENT
from etac_ros.bag.from_recording import write_recording
from etac_ros.bag.read import read_bag
from etac_ros.bag.topics import link_topic, recorded_topics, truth_topic
from etac_ros.bag.write import BagWriter
from etac_ros.engines.inprocess import InProcess
from etac_ros.graph.channel import Channel
from etac_ros.graph.graph import Graph, Link, LinkKind
from etac_ros.graph.module import Context
from etac_ros.graph.plant import PlantModule, PlantModuleParameters
from etac_ros.graph.recording import Message, Recording
from etac_ros.graph.truth import MOST_SAMPLES
from etac_ros.graph.wire import Wire, WireFormat
from etac_ros.scenario.load import load

WIRES = {
    "point": Wire(WireFormat.COMPACT, 3),
    "floats": Wire(WireFormat.COMPACT, 4),
    "one_float": Wire(WireFormat.COMPACT, 1),
    "vector": Wire(WireFormat.STAMPED, 3),
    "quaternion": Wire(WireFormat.STAMPED, 4),
    "wrench": Wire(WireFormat.STAMPED, 6),
    "doubles": Wire(WireFormat.DOUBLE, 3),
}
KINDS = list(LinkKind)
PLANTS = ("/plant", "/sm/plant")


def toy_graph(ticks_per_second):
    links = {
        name: Link(name, f"/sm/{name}", KINDS[i % 3], "/sender", "out", {}, wire, Channel(1, name))
        for i, (name, wire) in enumerate(WIRES.items())
    }
    modules = {
        name: PlantModule(
            Context(name, ticks_per_second, 1), PlantModuleParameters(), Ramp(RampParameters(), ticks_per_second)
        )
        for name in PLANTS
    }
    return Graph(modules, {}, links, ticks_per_second, 10**9)


@st.composite
def messages(draw, wire):
    moments = sorted(draw(st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 99)), max_size=6)))
    numbers = st.floats(allow_nan=False, width=32 if wire.format is WireFormat.COMPACT else 64)
    values = st.lists(numbers, min_size=wire.size, max_size=wire.size)
    return [
        Message(number, tick, step, wire.rounded(np.array(draw(values))))
        for number, (tick, step) in enumerate(moments, start=1)
    ]


@st.composite
def truths(draw):
    sizes = draw(st.lists(st.integers(1, 2 * MOST_SAMPLES + 3), max_size=3))
    states = draw(st.integers(1, 13))
    first = draw(st.integers(0, 1000))
    random = np.random.default_rng(draw(st.integers(0, 99)))
    chunks = []
    for size in sizes:
        # Any bits at all, NaN with payloads and subnormal numbers among them.
        bits = random.integers(0, 2**64, (size, states), dtype=np.uint64)
        chunks.append((first, bits.view(np.float64)))
        first += size
    return chunks


recordings = st.builds(
    Recording,
    st.fixed_dictionaries({name: messages(wire) for name, wire in WIRES.items()}),
    st.fixed_dictionaries({plant: truths() for plant in PLANTS}),
)


def assert_same(read, written):
    assert read.messages.keys() == written.messages.keys()
    for link, expected in written.messages.items():
        assert [m[:3] for m in read.messages[link]] == [m[:3] for m in expected]
        for message, original in zip(read.messages[link], expected, strict=True):
            assert message.value.dtype == np.float64
            assert message.value.flags.c_contiguous
            assert message.value.tobytes() == original.value.tobytes()
    assert read.truth.keys() == written.truth.keys()
    for plant in written.truth:
        (first, samples), (expected_first, expected_samples) = read.samples(plant), written.samples(plant)
        assert first == expected_first
        assert samples.shape == expected_samples.shape
        assert samples.tobytes() == expected_samples.tobytes()


@settings(deadline=None, max_examples=60)
@given(recordings, st.integers(1, 100_000))
def test_any_recording_comes_back_bit_for_bit(recording, rate):
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder, "bag")
        write_recording(directory, toy_graph(rate), recording, {"scenario": "toy"}, {"s.yaml": b"a: 1"})
        bag = read_bag(directory)
        assert bag.ticks_per_second == rate
        assert bag.metadata == {"scenario": "toy", "ticks_per_second": str(rate)}
        assert bag.attachments.keys() == {"s.yaml", DESCRIPTION_ATTACHMENT}
        assert bag.attachments["s.yaml"] == b"a: 1"
        assert tuple(bag.topics) == recorded_topics(toy_graph(rate))
        assert_same(bag.recording(), recording)


@pytest.mark.parametrize("wire", ["compact", "stamped"])
def test_a_real_run_comes_back_bit_for_bit(tmp_path, wire):
    scenario = load("wu2018", overrides=["duration_s=60.0", f"wire={wire}"])
    graph = scenario.build()
    recording = InProcess(graph).run()
    assert sum(map(len, recording.messages.values())) > 10
    write_recording(tmp_path / "bag", graph, recording, {}, {})
    read = read_bag(tmp_path / "bag").recording()
    assert list(read.messages) == list(recording.messages)  # the order of every sum
    assert_same(read, recording)


@settings(deadline=None, max_examples=30)
@given(recordings)
def test_messages_stand_in_the_order_in_which_things_happened(recording):
    with tempfile.TemporaryDirectory() as folder:
        write_recording(Path(folder, "bag"), toy_graph(1000), recording, {}, {})
        order = [topic.name for topic in recorded_topics(toy_graph(1000))]
        raw = list(read_bag(Path(folder, "bag")).messages())
        links = [m for m in raw if m.topic.link is not None]
        keys = [(m.log_time_ns, order.index(m.topic.name), m.sequence) for m in links]
        assert keys == sorted(keys)
        assert [m.log_time_ns for m in raw] == sorted(m.log_time_ns for m in raw)
        assert all(m.publish_time_ns <= m.log_time_ns for m in raw)


def test_no_truth_message_is_longer_than_dds_carries_quickly(tmp_path):
    recording = Recording({}, {"/plant": [(7, np.arange(3 * 5000.0).reshape(5000, 3))]})
    write_recording(tmp_path / "bag", toy_graph(10), recording, {}, {})
    chunks = read_bag(tmp_path / "bag").recording().truth["/plant"]
    assert [samples.shape[0] for _, samples in chunks] == [1024, 1024, 1024, 1024, 904]


@given(st.integers(0, 2**53), st.integers(1, 20), st.integers(1, 13))
def test_the_layout_of_truth_is_undone(first, ticks, states):
    samples = np.random.default_rng(0).standard_normal((ticks, states))
    back, unpacked = decode_truth(encode_truth(first, samples))
    assert back == first
    np.testing.assert_array_equal(unpacked, samples)


def test_a_recording_has_its_own_order_whatever_the_order_in_the_bag(tmp_path):
    link = link_topic(toy_graph(10).links["point"])
    truth = truth_topic("/plant")
    with BagWriter(tmp_path / "bag", [link, truth], {}, {"ticks_per_second": "10"}) as writer:
        for tick in (2, 0, 1):
            value = np.full(3, float(tick))
            time = tick_time_ns(tick, 10)
            writer.write(truth.name, encode_truth(tick, value[np.newaxis]), time, time, tick + 1)
            writer.write(link.name, encode(link.type_name, value, time), time, time, tick + 1)
    recording = read_bag(tmp_path / "bag").recording()
    assert [message[:2] for message in recording.messages["point"]] == [(1, 0), (2, 1), (3, 2)]
    assert recording.samples("/plant")[1][:, 0].tolist() == [0.0, 1.0, 2.0]
