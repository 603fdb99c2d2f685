"""The bag of a run over DDS, opened with readers that know nothing of etac_ros."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader

from etac_ros.runs import RosOptions, Run, run_over_ros
from etac_ros.scenario.load import load


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A recorded run, windows included."""
    folder = tmp_path_factory.mktemp("run")
    return run_over_ros(load("wu2018"), folder / "bag", RosOptions(record_windows=True))


def test_triggering_instants_from_rosbags(run: Run) -> None:
    assert run.bag is not None
    with AnyReader([run.bag]) as reader:
        chosen = [c for c in reader.connections if c.topic == "/filtered_error"]
        times = [log_time / 1e9 for _, log_time, _ in reader.messages(connections=chosen)]
    assert times == run.summary.triggers["/sensor"].times_s


def test_values_from_mcap_ros2(run: Run) -> None:
    assert run.bag is not None
    (file,) = run.bag.glob("*.mcap")
    with file.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        torques = [decoded for *_, decoded in reader.iter_decoded_messages(topics=["/torque_command"])]
    expected = [message.value.tolist() for message in run.recording.messages["torque_command"]]
    assert [[torque.x, torque.y, torque.z] for torque in torques] == expected


def test_counts_are_those_of_the_summary(run: Run) -> None:
    assert run.bag is not None
    with AnyReader([run.bag]) as reader:
        counts = {topic: info.msgcount for topic, info in reader.topics.items()}
        sizes: dict[str, int] = {}
        for connection, _, data in reader.messages():
            sizes[connection.topic] = sizes.get(connection.topic, 0) + len(data)
    for topic in ("/filtered_error", "/torque_command", "/emulation/torque", "/emulation/plant/truth"):
        assert counts[topic] == run.summary.topics[topic].messages
        assert sizes[topic] == run.summary.topics[topic].cdr_bytes
    assert counts["/emulation/plant/window"] == run.summary.topics["/emulation/plant/window"].messages


def test_only_committed_samples(run: Run) -> None:
    """Every tick once: windows overlap, committed samples do not."""
    first, samples = run.recording.samples("/plant")
    assert (first, samples.shape) == (0, (32_001, 7))


def test_windows_are_recorded_only_when_asked_for(tmp_path: Path) -> None:
    plain = run_over_ros(load("wu2018", None, ["duration_s=20"]), tmp_path / "bag")
    assert plain.bag is not None
    with AnyReader([plain.bag]) as reader:
        assert {topic for topic in reader.topics if not topic.startswith(("/state/", "/tf"))} == {
            "/filtered_error", "/torque_command", "/emulation/torque", "/emulation/plant/truth",
        }  # fmt: skip
