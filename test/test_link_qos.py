"""How DDS carries a link is a choice of the scenario: it changes what is sent beside the data, and no result."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from fake_ros import Bus
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import String
from test_capture_run import captures
from test_engines_equal import assert_same

from etac_ros.bag.definitions import OFFERED_QOS, offered_qos
from etac_ros.bag.read import read_bag
from etac_ros.bag.recover import recover
from etac_ros.capture.account import Cause
from etac_ros.engines.ros.endpoints import DATA, Publisher, Subscription, profile
from etac_ros.errors import RunError, ScenarioError
from etac_ros.graph.graph import Qos, Reliability
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import load

BEST_EFFORT = Qos(Reliability.BEST_EFFORT)
TOPICS = ("/filtered_error", "/torque_command")
CHOSEN = ["duration_s=100", "links.filtered_error.reliability=best_effort", "links.torque_command.history=2048"]


def test_profiles() -> None:
    assert profile(Qos()) == DATA  # nothing changes for who chooses nothing
    assert profile(BEST_EFFORT).reliability is ReliabilityPolicy.BEST_EFFORT
    assert profile(Qos(history=7)).depth == 7


@captures
def test_best_effort_changes_traffic_and_no_bit(tmp_path: Path) -> None:
    """Best effort: data alone. Reliable: acknowledgements, too. The data take the same bytes, those of the model."""
    scenario = load("wu2018", None, CHOSEN)
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions(capture=True))
    assert_same(run.recording, run_in_process(scenario).recording)
    wire = run.summary.wire
    assert wire is not None
    best_effort, reliable = (wire.topics[name] for name in TOPICS)
    assert best_effort.causes.keys() == {Cause.DATA}
    assert reliable.causes.keys() >= {Cause.DATA, Cause.HEARTBEAT, Cause.ACKNACK}
    for name in TOPICS:
        assert wire.topics[name].causes[Cause.DATA].total_bytes == run.summary.topics[name].model_wire_bytes


def test_bag_says_what_was_offered(tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, CHOSEN), tmp_path / "bag")
    for _ in range(2):
        metadata = yaml.safe_load((tmp_path / "bag" / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
        offered = {
            topic["topic_metadata"]["name"]: topic["topic_metadata"]["offered_qos_profiles"][0]["reliability"]
            for topic in metadata["topics_with_message_count"]
        }
        assert offered["/filtered_error"] == "best_effort"
        assert set(offered.values()) == {"best_effort", "reliable"}
        topics = {topic.name: topic for topic in read_bag(tmp_path / "bag").topics}
        assert topics["/filtered_error"].reliability is Reliability.BEST_EFFORT
        (tmp_path / "bag" / "metadata.yaml").unlink()
        recover(tmp_path / "bag")  # and it still does when it was repaired
    assert offered_qos("reliable", latched=False) == OFFERED_QOS


@pytest.mark.parametrize(
    ("qos", "words"),
    [
        (BEST_EFFORT, "its link is best effort, and DDS has lost messages"),
        (Qos(history=3), "its link keeps the last 3 only"),
        (Qos(), "is another program publishing"),
    ],
)
def test_lost_message_is_an_error_that_names_its_topic_and_why(qos: Qos, words: str) -> None:
    bus = Bus()
    end = Subscription(bus.node("ear"), String, "/talk", lambda *_: None, qos=qos)  # type: ignore[arg-type]
    mouth = Publisher(bus.node("mouth"), String, "/talk", qos=qos)  # type: ignore[arg-type]
    for text in ("one", "two"):
        mouth.publish(String(data=text))
    offered: QoSProfile = bus.writers[0].qos_profile
    assert offered.reliability.name.lower() == qos.reliability.value
    end.handle.waiting.popleft()
    with pytest.raises(RunError, match="topic /talk: message 2 of its publisher came as number 1") as caught:
        end.take()
    assert words in str(caught.value)


@pytest.mark.parametrize("key", ["reliability=best_effort", "history=8"])
def test_wires_have_no_choice(key: str) -> None:
    with pytest.raises(ScenarioError, match="of network links; a physical one is a wire"):
        load("wu2018", None, [f"links.torque.{key}"])
