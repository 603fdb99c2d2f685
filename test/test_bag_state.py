"""What a bag shows of the bodies: the numbers are those of the truth, in the conventions of ROS, counted apart."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

from etac_ros.bag.definitions import typestore
from etac_ros.bag.describe import describe
from etac_ros.bag.markers import arrow_tips
from etac_ros.bag.read import read_bag
from etac_ros.bag.run_metadata import wall_clock
from etac_ros.bag.state import StateStreams, quaternions_of
from etac_ros.errors import ScenarioError
from etac_ros.graph.ledger import Entry, Event
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.quaternion import dcm
from etac_ros.maths.wall_clock import WallClock
from etac_ros.metrics import curves
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Body, bodies_of
from etac_ros.report.source import read_run
from etac_ros.runs import RosOptions, Run, run_in_process, run_over_ros
from etac_ros.scenario.load import load

SHORT = {
    "wu2018": ["duration_s=40"],
    "qi2022": ["duration_s=4"],
    "shi2022": ["duration_s=5"],
    "flexible": ["duration_s=10"],
    "xie2021": ["duration_s=5"],
}


def shown(bag: Path) -> dict[str, list[tuple[int, Any]]]:
    """Simulated time [ns] and message by topic, as a reader that knows nothing of etac_ros has them."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([bag]) as reader:
        for connection, time_ns, data in reader.messages():
            if connection.topic.startswith(("/state/", "/tf")):
                message = reader.deserialize(data, connection.msgtype)
                found.setdefault(connection.topic, []).append((time_ns - time_ns % 1000, message))
    return found


def xyzw(q: Any) -> list[float]:
    return [q.x, q.y, q.z, q.w]


def xyz(v: Any) -> list[float]:
    return [v.x, v.y, v.z]


def ticks_of(messages: list[tuple[int, Any]], ticks_per_second: int) -> list[int]:
    return [round(time_ns * ticks_per_second / 1e9) for time_ns, _ in messages]


@pytest.fixture(scope="module", params=SHORT)
def run(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A short run of each system, in process."""
    bag = tmp_path_factory.mktemp(request.param) / "bag"
    return run_in_process(load(request.param, None, SHORT[request.param]), bag)


def test_attitude_rate_torque_and_errors_are_those_of_the_truth(run: Run) -> None:
    assert run.bag is not None
    graph, messages, rate = run.scenario.graph, shown(run.bag), run.scenario.run.ticks_per_second
    for plant in graph.plants:
        _, states = run.recording.samples(plant)
        held = curves.held_inputs(graph, run.recording, plant)
        module = graph.modules[plant]
        assert isinstance(module, PlantModule)
        for body in bodies_of(module.plant):
            prefix = f"/state{plant}/{body.frame}" if body.frame else f"/state{plant}"
            at = ticks_of(messages[f"{prefix}/attitude"], rate)
            assert len(at) > 50
            assert body.quaternions is not None
            q = body.quaternions(states)[at]
            poses = [message.pose for _, message in messages[f"{prefix}/attitude"]]
            written = np.array([xyzw(pose.orientation) for pose in poses])
            signs = np.sign(np.einsum("ij,ij->i", written, np.roll(q, -1, axis=1)))
            assert (written == signs[:, np.newaxis] * np.roll(q, -1, axis=1)).all()
            assert (np.einsum("ij,ij->i", written[1:], written[:-1]) >= 0.0).all()  # no jumps of the sign
            rates = [xyz(message.vector) for _, message in messages[f"{prefix}/rate"]]
            assert (np.array(rates) == body.rates(states)[at]).all()
            port = body.port or next(iter(held))
            times = np.array(at) / rate
            expected = held[port].values[np.searchsorted(held[port].times_s, times, side="right") - 1]
            torques = np.array([xyz(message.vector) for _, message in messages[f"{prefix}/torque"]])
            assert (torques == expected).all()
            assert np.abs(torques).max() > 0.0
        errors = curves.attitude_angle(graph, run.recording, plant).values[:, 0]
        numbers = messages[f"/state{plant}/attitude_error_deg"]
        assert [message.data for _, message in numbers] == errors[ticks_of(numbers, rate)].tolist()


def test_transforms_are_the_attitudes_and_make_one_tree(run: Run) -> None:
    assert run.bag is not None
    messages = shown(run.bag)
    parents = {}
    turned: dict[tuple[int, str], list[float]] = {}
    for time_ns, message in messages["/tf_static"] + messages["/tf"]:
        for transform in message.transforms:
            parents[transform.child_frame_id] = transform.header.frame_id
            turned[time_ns, transform.child_frame_id] = xyzw(transform.transform.rotation)
    frames = {parent for parent in parents.values() if parent not in parents}
    assert frames == {"world"}
    for topic, some in messages.items():
        if topic.endswith("/rate"):
            frame = some[0][1].header.frame_id
            poses = messages[topic.replace("/rate", "/attitude")]
            assert poses[0][1].header.frame_id == parents[frame]
            assert [turned[time_ns, frame] for time_ns, _ in poses] == [xyzw(m.pose.orientation) for _, m in poses]


def test_orientations_take_the_body_to_its_reference() -> None:
    """As ROS has it: v_N = q v_B q*, written out with the quaternion of a message, against our own matrix."""
    q = np.array([0.5, 0.1, -0.7, 0.2])
    q /= np.linalg.norm(q)
    body = Body("", lambda s: s, lambda s: s, lambda s: s)
    w, x, y, z = quaternions_of(body, q[np.newaxis])[0]
    turn = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    matrix = np.empty((3, 3))
    dcm(q, matrix)
    np.testing.assert_allclose(turn, matrix.T, atol=1e-15)


def test_stamps_are_simulated_time(run: Run) -> None:
    assert run.bag is not None
    for topic, some in shown(run.bag).items():
        for time_ns, message in some:
            if hasattr(message, "header"):
                stamp = message.header.stamp
                assert abs(stamp.sec * 10**9 + stamp.nanosec - time_ns) < 1000, topic


def test_a_bag_counts_the_state_apart(run: Run) -> None:
    assert run.bag is not None
    described = describe(run.bag)
    kinds = {row.topic: row.kind for row in described.topics}
    assert {topic for topic, kind in kinds.items() if kind == "state"} == set(shown(run.bag))
    assert described.network.messages == run.summary.network.messages
    emulated = [row for row in described.topics if row.kind in ("physical", "emulation")]
    assert described.emulation.messages == sum(row.messages for row in emulated)
    assert not any(row.topic.startswith(("/state", "/tf")) for row in emulated)
    reported = read_run(run.bag)
    assert not any(topic.startswith(("/state", "/tf")) for topic in reported.summary.topics)
    assert reported.recording.digest() == run.recording.digest()


@pytest.mark.parametrize(
    ("override", "samples"), [("state_rate_hz=1", 41), ("state_rate_hz=3", 117), ("state_rate_hz=1e6", 1281)]
)
def test_the_rate_is_never_more_than_asked_for_nor_than_the_truth(override: str, samples: int, tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, ["duration_s=40", override]), tmp_path / "bag")
    assert len(shown(tmp_path / "bag")["/state/plant/attitude"]) == samples


def test_none_if_none_is_asked_for_and_the_paper_stands_beside_it_all_the_same(tmp_path: Path) -> None:
    run = run_in_process(load("wu2018", None, ["state_rate_hz=0"]), tmp_path / "bag")
    assert shown(tmp_path / "bag") == {}
    assert run.summary.paper
    assert run.scenario.digest == load("wu2018").digest


def test_both_engines_show_the_same_to_the_bit_also_behind_a_slow_actuator(tmp_path: Path) -> None:
    overrides = ["duration_s=20", "links.torque.delay_ticks=3", "links.torque.loss=0.2"]
    run_in_process(load("wu2018", None, overrides), tmp_path / "calls")
    run_over_ros(load("wu2018", None, overrides), tmp_path / "dds", RosOptions(processes="one"))
    by_calls, over_dds = shown(tmp_path / "calls"), shown(tmp_path / "dds")
    assert {name: repr(some) for name, some in by_calls.items()} == {
        name: repr(some) for name, some in over_dds.items()
    }
    run = read_run(tmp_path / "dds")
    held = run.held["/plant"]["torque"]
    torques = over_dds["/state/plant/torque"]
    ticks = np.array(ticks_of(torques, 32))
    expected = held.values[np.searchsorted(held.times_s, ticks / 32, side="right") - 1]
    assert [xyz(message.vector) for _, message in torques] == expected.tolist()


@pytest.mark.parametrize("topic", ["/tf", "/state/plant/attitude"])
def test_no_link_takes_a_topic_of_the_state(topic: str) -> None:
    with pytest.raises(ScenarioError, match="where a bag shows the state"):
        load("wu2018", None, [f"links.filtered_error.topic={topic}"])


def test_arrows_shrink_by_a_quarter_a_decade() -> None:
    torques = np.array([[1.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.0, 0.0, 1e-9], [0.0, 0.0, 0.0], [0.0, 1e9, 0.0]])
    tips: FloatArray = arrow_tips(torques)
    assert np.linalg.norm(tips, axis=1).tolist() == [1.0, 0.5, 0.0, 0.0, 2.0]


def test_in_real_time_the_state_stands_at_the_instants_of_its_ticks(tmp_path: Path) -> None:
    scenario = load("wu2018", None, ["duration_s=20"])
    run_over_ros(scenario, tmp_path / "bag", RosOptions(rate=200.0))
    (metadata,) = [read_bag(tmp_path / "bag").metadata]
    wall = wall_clock(metadata)
    assert wall is not None
    with AnyReader([tmp_path / "bag"]) as reader:
        chosen = [c for c in reader.connections if c.topic in ("/state/plant/attitude", "/state/plant/torque")]
        messages = [(c.topic, time_ns, reader.deserialize(data, c.msgtype))
                    for c, time_ns, data in reader.messages(connections=chosen)]  # fmt: skip
    times = [time_ns for topic, time_ns, _ in messages if topic == "/state/plant/attitude"]
    assert times == [wall.instant_ns(tick) for tick in range(0, 2 * len(times), 2)]
    assert len(times) > 200
    torques = [(time_ns, xyz(message.vector)) for topic, time_ns, message in messages if topic == "/state/plant/torque"]
    assert [time_ns for time_ns, _ in torques] == times
    held = read_run(tmp_path / "bag").held["/plant"]["torque"]
    ticks = np.arange(0, 2 * len(times), 2)
    expected = held.values[np.searchsorted(held.times_s, ticks / 32, side="right") - 1]
    assert [torque for _, torque in torques] == expected.tolist()
    assert len({tuple(torque) for _, torque in torques}) > 2


def test_torques_of_real_time_wait_for_the_ledger_and_for_nothing_else() -> None:
    graph = load("wu2018", None, ["duration_s=1", "state_rate_hz=32"]).graph
    place = list(graph.links).index("torque")
    state = StateStreams(graph, 32.0, WallClock(0, 32, Fraction(1)), waits_s=-1.0)

    def shown(everything: bool = False) -> dict[str, list[int]]:
        found: dict[str, list[int]] = {"attitude": [], "torque": []}
        for message in state.ready(sys.maxsize, everything):
            found.get(message.topic.rpartition("/")[2], []).append(message.tick)
        return found

    state.take_message("torque", 1, 3, 0, np.array([1.0, 0.0, 0.0]))
    state.take_truth("/plant", 0, np.tile([1.0, 0, 0, 0, 0, 0, 0], (20, 1)))
    assert shown() == {"attitude": list(range(20)), "torque": []}
    state.take_ledger("/plant", [Entry(Event.TAKEN, place, 1, 4, 0), Entry(Event.TAKEN, place, 2, 9, 0)])
    assert shown() == {"attitude": [], "torque": [0, 1, 2, 3]}  # of the second the value has not come yet
    state.take_message("torque", 2, 8, 0, np.array([2.0, 0.0, 0.0]))
    assert shown() == {"attitude": [], "torque": [4, 5, 6, 7, 8]}
    state.take_message("torque", 3, 15, 0, np.array([3.0, 0.0, 0.0]))  # which no ledger tells any more
    last = [message for message in state.ready(sys.maxsize, everything=True) if message.topic.endswith("/torque")]
    assert [message.tick for message in last] == list(range(9, 20))
    kind = "geometry_msgs/msg/Vector3Stamped"
    values = [typestore().deserialize_cdr(message.cdr, kind).vector.x for message in last]
    assert values == [2.0] * 7 + [3.0] * 4


def test_what_modules_watch_is_shown_whatever_the_chunks_were(tmp_path: Path) -> None:
    """The law's memory of shi2022 is folded over every sample, of which few are shown."""
    name, overrides = "/state/controller/watched/performance_variable_chi", ["duration_s=5", "state_rate_hz=4"]
    for variant in (None, "events"):
        folder = tmp_path / str(variant)
        run_in_process(load("shi2022", variant, overrides), folder / "calls")
        run_over_ros(load("shi2022", variant, overrides), folder / "dds", RosOptions(processes="one"))
        first, watches = read_run(folder / "calls").watches["/controller"]
        for bag in ("calls", "dds"):
            found = shown(folder / bag)[name]
            ticks = ticks_of(found, load("shi2022").run.ticks_per_second)
            assert len(ticks) == 21
            assert [xyz(m.vector) for _, m in found] == watches[0].values[np.array(ticks) - first].tolist()
