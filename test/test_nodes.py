"""The nodes of the ros engine, whole runs of them without DDS: what they say, what they keep, and when they leave."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fake_ros import World
from rclpy.serialization import deserialize_message
from std_msgs.msg import String
from toy import toy

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns
from etac_ros.bag.codec import decode, decode_truth
from etac_ros.engines.inprocess import InProcess
from etac_ros.engines.ros.count_check import check_outcome
from etac_ros.engines.ros.messages import decode_window, encode
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.errors import RunError
from etac_ros.graph.graph import Link
from etac_ros.graph.recording import Recording
from etac_ros.graph.topics import go_topic, next_topic, truth_topic, window_topic
from etac_ros.maths.ticks import nanoseconds
from etac_ros.runs import windows_of
from etac_ros.scenario.load import Scenario, load

SYSTEMS: Mapping[str, tuple[str, str | None, list[str]]] = {
    "wu2018": ("wu2018", None, ["duration_s=20"]),
    "wu2018, stamped": ("wu2018", None, ["duration_s=20", "wire=stamped"]),
    "wu2018, periodic": ("wu2018", "periodic", ["duration_s=5"]),
    "wu2018, late and lossy": ("wu2018", None, ["duration_s=20", "links.filtered_error={delay_ticks: 3, loss: 0.3}"]),
    "qi2022": ("qi2022", None, ["duration_s=0.5"]),
    "shi2022": ("shi2022", None, ["duration_s=0.5"]),
    "xie2021": ("xie2021", None, ["duration_s=0.1"]),
}


def scenario_of(case: str) -> Scenario:
    name, variant, overrides = SYSTEMS[case]
    return load(name, variant, overrides)


def note(data: bytes) -> Any:
    return json.loads(deserialize_message(data, String).data)


def assert_recorded(world: World, by_calls: Recording) -> None:
    """The sink holds each message of the run by calls, with its place in time, and all committed samples."""
    graph = world.plan.graph
    for link in graph.links.values():
        found = [one for one in world.sink.written if one[0] == link.topic]
        assert sorted(one[4] for one in found) == [message.sequence for message in by_calls.messages[link.name]]
        for (_, data, logged, published, _), message in zip(
            sorted(found, key=lambda one: one[4]), by_calls.messages[link.name], strict=True
        ):
            np.testing.assert_array_equal(decode(link.wire.type_name, data), message.value)
            at = nanoseconds(message.tick, graph.ticks_per_second)
            assert (logged, published) == (log_time_ns(at, message.step), at)
    for plant in graph.plants:
        first, samples = by_calls.samples(plant)
        following = first
        for _, data, logged, published, _ in [one for one in world.sink.written if one[0] == truth_topic(plant)]:
            start, some = decode_truth(data)
            assert start == following
            np.testing.assert_array_equal(some, samples[start - first : start - first + len(some)])
            following += len(some)
            at = nanoseconds(following - 1, graph.ticks_per_second)
            assert (logged, published) == (log_time_ns(at, AFTER_ALL_STEPS), at)
        assert following == first + len(samples)


@pytest.mark.parametrize("case", list(SYSTEMS))
def test_a_whole_run(case: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = scenario_of(case)
    by_calls = InProcess(scenario.build(), windows_of(scenario)).run()
    world = World(scenario, monkeypatch)
    outcome = world.run()
    assert all(node.finished and node.has_left for name, node in world.nodes.items() if name != COORDINATOR)
    assert world.coordinator.finished
    assert world.sink.closed == 1
    assert_recorded(world, by_calls)
    check_outcome(world.plan, outcome, world.sink.counts())
    assert outcome.tick == world.plan.graph.end_tick
    assert outcome.halted == ""
    assert set(outcome.leave_notes) == set(world.plan.nodes)
    for topic, (messages, size) in outcome.sent_by_topic().items():
        said = world.bus.said(topic)
        assert (messages, size) == (len(said), sum(map(len, said))), topic
    kept = outcome.leave_notes[RECORDER]
    assert kept["written"] == {topic: kept["received"][topic] for topic in kept["written"]}
    assert all(note["memory_kib"] > 0 and note["pid"] for note in outcome.leave_notes.values())
    assert not any(note["strangers"] for note in outcome.leave_notes.values())
    # All but what came with the last ticks was known to be complete, and never more than was.
    assert world.sink.placed == sorted(world.sink.placed)


def test_only_who_waits_for_orders_gets_them(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    world.run()
    for name in world.plan.modules:
        ordered = world.plan.duties.needs_orders(name)
        assert bool(world.bus.on(world.bus.readers, go_topic(name))) == ordered
        assert bool(world.bus.on(world.bus.writers, next_topic(name))) == world.plan.duties.reports(name)


def test_windows_are_recorded_where_that_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch, windows=True)
    outcome = world.run()
    topic = window_topic("/plant")
    said = world.bus.said(topic)
    written = [one for one in world.sink.written if one[0] == topic]
    assert [one[1] for one in written] == said
    assert [one[4] for one in written] == list(range(1, len(said) + 1))
    for _, data, logged, published, _ in written:
        window, _ = decode_window(data, "/plant")
        at = nanoseconds(window.start, 32)
        assert (logged, published) == (log_time_ns(at, 0), at)
    check_outcome(world.plan, outcome, world.sink.counts())


def test_a_watch_ends_the_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scenario = toy(tmp_path, {"a": {"at": [3]}})
    text = scenario.path.read_text().replace("slope: 1.0", "slope: 1.0\n      bound: 6.5", 1)
    scenario.path.write_text(text)
    scenario = load(str(scenario.path))
    engine = InProcess(scenario.build(), windows_of(scenario))
    engine.run()
    world = World(scenario, monkeypatch)
    outcome = world.run()
    assert outcome.halted == engine.master.halted != ""
    assert outcome.tick == engine.master.tick


def test_the_recorder_waits_for_messages_without_a_place(monkeypatch: pytest.MonkeyPatch) -> None:
    """It has all that was sent, and must not leave before the message log has told where it belongs."""
    world = World(scenario_of("wu2018"), monkeypatch)
    recorder = world.recorder
    link = next(iter(world.plan.graph.links.values()))
    recorder.on_start()
    recorder._leave_notes = {name: {"sent": {}} for name in world.plan.modules}
    sent = {name: int(name == link.name) for name in world.plan.graph.links}
    recorder.stop = {"fault": "", "sent": sent, "logs": 0}
    assert not recorder.drained()  # it has not come
    end = recorder._received[link.topic]
    end.count.messages = 1
    assert recorder.drained()
    recorder._waiting[link.name, 1] = b""
    assert not recorder.drained()
    recorder._places[link.name, 1] = (0, 0)
    recorder._sort_in(link.name, 1)
    assert recorder.drained()
    recorder.stop = {"fault": "broken", "sent": sent, "logs": 0}
    assert not recorder.drained()
    recorder.stop = {"fault": "", "sent": sent, "logs": 0}
    recorder.stop = {"fault": "", "sent": sent, "logs": 1}
    assert not recorder.drained()  # a message log is still under way
    recorder.stop = {"fault": "", "sent": sent, "logs": 0}
    del recorder._leave_notes[world.plan.modules[0]]
    assert not recorder.drained()
    recorder._leave_notes = {name: {"sent": {truth_topic("/plant"): [1, 9]}} for name in world.plan.modules}
    assert not recorder.drained()


def test_what_has_no_place_when_it_is_cut_off_goes_to_the_last_tick_known(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    recorder = world.recorder
    recorder.abort()  # before it has begun: there is nothing to close
    assert world.sinks == []
    recorder.on_start()
    link = next(iter(world.plan.graph.links.values()))
    recorder._on_message_log({"log": 1, "transits": [[link.name, 1, 7, 2], [link.name, 2, 3, 0]]}, 1)
    recorder._waiting |= {(link.name, 4): b"late", (link.name, 3): b"also"}
    recorder.abort()
    at = nanoseconds(7, 32)
    assert world.sink.written == [
        (link.topic, b"also", log_time_ns(at, 0), at, 3),
        (link.topic, b"late", log_time_ns(at, 0), at, 4),
    ]
    assert world.sink.closed == 1
    recorder.abort()
    assert world.sink.closed == 1


def hear(world: World, link: Link, number: int) -> None:
    """A message of a link comes to the recorder."""
    end = world.recorder._received[link.topic]
    end.handle.waiting.append((encode(link.wire, np.zeros(link.wire.size), 0), number, 0))
    end.take()


def test_truth_may_follow_up_to_before_what_is_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    recorder = world.recorder
    link = next(iter(world.plan.graph.links.values()))
    recorder._on_message_log({"log": 1, "transits": [[link.name, 1, 5, 0], [link.name, 2, 9, 0]]}, 1)
    assert world.sinks == []
    hear(world, link, 1)
    assert world.sink.placed == []
    hear(world, link, 2)
    assert world.sink.placed == [nanoseconds(8, 32)]
    hear(world, link, 3)  # its place is not known yet
    assert world.sink.placed == [nanoseconds(8, 32)]
    recorder._on_message_log({"log": 2, "transits": [[link.name, 3, 11, 0]]}, 2)
    assert world.sink.placed == [nanoseconds(8, 32), nanoseconds(10, 32)]


def test_a_message_log_is_acknowledged_once_all_of_it_is_written(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    recorder = world.recorder
    link = next(iter(world.plan.graph.links.values()))
    recorder._on_message_log({"log": 1, "transits": [[link.name, 1, 5, 0]]}, 1)
    assert world.bus.said("/emulation/recorded") == []
    hear(world, link, 1)
    hear(world, link, 2)  # of which no log has told: it is no reason to say it again
    recorder._on_message_log({"log": 2, "transits": []}, 2)
    assert [note(data)["is"] for data in world.bus.said("/emulation/recorded")] == [{"log": 1}, {"log": 2}]


def test_nothing_is_acknowledged_that_a_kill_could_still_take_back(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    recorder = world.recorder
    safe_when_said: list[int] = []

    class Told:
        def publish(self, message: object) -> None:
            safe_when_said.append(len(world.sink.written) - world.sink.safe)

    monkeypatch.setattr(recorder, "_recorded", Told())
    link = next(iter(world.plan.graph.links.values()))
    recorder._waiting[link.name, 1] = b"x"
    recorder._on_message_log({"log": 1, "transits": [[link.name, 1, 5, 0]]}, 1)
    assert world.sink.written
    assert safe_when_said == [0]


def test_a_run_waits_for_a_recorder_that_is_left_behind(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told of its messages' places a log at a time, and the run is never more than four logs ahead."""
    scenario = load("wu2018", "periodic", ["duration_s=30", "sensor.trigger.period_s=0.03125"])
    world = World(scenario, monkeypatch)
    monkeypatch.setattr(world.recorder, "_all_placed", lambda: None)
    monkeypatch.setattr("etac_ros.engines.ros.coordinator._LOG_MESSAGES", 50)
    world.join()
    world.spin()
    coordinator = world.coordinator
    assert coordinator.stop is None
    assert len(world.bus.said("/emulation/message_log")) == 4
    assert coordinator._owing() == [RECORDER]
    stood = coordinator.master.tick
    assert 0 < stood < world.plan.graph.end_tick
    coordinator._on_recorded({"log": 0}, 1)
    assert coordinator.master.tick == stood
    coordinator._on_recorded({"log": 1}, 1)
    world.spin()
    assert len(world.bus.said("/emulation/message_log")) == 5
    assert stood < coordinator.master.tick < world.plan.graph.end_tick
    assert coordinator._owing() == [RECORDER]
    coordinator._recorded = 2  # three logs are no reason to blame it
    assert coordinator._owing() == list(world.plan.modules)


def test_a_node_leaves_only_when_all_has_come(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("xie2021"), monkeypatch)
    world.run()
    for name in world.plan.modules:
        node: Any = world.nodes[name]
        stop = node.stop
        assert node.drained(), name
        for link in (*node._incoming, *node._outgoing):
            node.stop = {**stop, "sent": {**stop["sent"], link: stop["sent"][link] + 1}}
            assert not node.drained(), (name, link)
        if node._go is not None:
            node.stop = {**stop, "orders": {**stop["orders"], name: stop["orders"][name] + 1}}
            assert not node.drained(), name
        node.stop = {**stop, "sent": {}, "fault": "broken"}
        assert node.drained()


def test_a_plant_leaves_only_when_its_last_order_is_obeyed(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    world.run()
    plant: Any = world.nodes["/plant"]
    assert plant.drained()
    plant.worker.closed = False
    assert not plant.drained()


def test_truth_is_published_when_there_is_enough_of_it_or_time_has_passed(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(load("wu2018", None, ["duration_s=100"]), monkeypatch)
    world.join()
    published = world.bus.said
    counts = []
    before = world.clock.now
    while world.spinner.once(0.05):
        counts.append(len(published(truth_topic("/plant"))))
        world.clock.now += 0.3
    sizes = [len(decode_truth(data)[1]) for data in published(truth_topic("/plant"))]
    assert len(sizes) > 3  # time passes, so that each window brings what was committed before
    assert sum(sizes) == 3201
    assert world.clock.now > before
    quiet = World(load("wu2018", None, ["duration_s=100"]), monkeypatch)
    quiet.run()
    sizes = [len(decode_truth(data)[1]) for data in quiet.bus.said(truth_topic("/plant"))]
    assert all(size >= 1024 for size in sizes[:-1])
    assert 1 < len(sizes) <= 4
    assert sum(sizes) == 3201


def test_a_stamp_that_is_no_tick_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018, stamped"), monkeypatch)
    node: Any = world.nodes["/controller"]
    link = world.plan.graph.hears["/controller"][0]
    assert node._tick_of(nanoseconds(5, 32), link) == 5
    with pytest.raises(RunError, match=r"topic /filtered_error: /sensor has stamped a message with 0\.010000000 s"):
        node._tick_of(10_000_000, link)


def test_strangers_are_counted_and_ignored(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    publisher = world.bus.node("intruder").create_publisher(
        String, "/emulation/start", world.bus.writers[0].qos_profile
    )
    for text in ("", "{", "null", '{"run": "x", "is": {}}', '{"is": {}}'):
        publisher.publish(String(data=text))
    world.spin()
    outcome = world.run()
    assert outcome.tick == world.plan.graph.end_tick
    assert {name: said["strangers"] for name, said in outcome.leave_notes.items()} == {
        name: {"/emulation/start": 5} for name in world.plan.nodes
    }


def test_a_fault_of_a_node_ends_the_run_with_its_words(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    world.join()
    world.nodes["/sensor"].say_fault("it burns")
    with pytest.raises(RunError, match="node /sensor: it burns"):
        world.spin()


@pytest.mark.parametrize("namespace", ["pm", "/pm", "pm/", "/pm/"])
def test_a_part_of_a_run_is_a_namespace(namespace: str, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = World(scenario_of("qi2022"), monkeypatch).plan
    part = plan.part(namespace)
    assert part
    assert part == tuple(name for name in plan.nodes if name.startswith("/pm/"))
    assert set(plan.part("/sim")) >= {COORDINATOR, RECORDER}
    assert not Plan("x", "y", plan.graph, plan.windows).record_windows


def test_what_is_missing_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    world = World(scenario_of("wu2018"), monkeypatch)
    gone = [end for end in world.bus.readers if (end.node_name, end.topic) == ("recorder", "/filtered_error")]
    assert len(gone) == 1
    world.bus.readers.remove(gone[0])
    sensor = world.nodes["/sensor"]
    assert not sensor.matched
    assert sensor.missing() == ["/filtered_error (no subscription of /recorder)"]
    world.bus.readers.append(gone[0])
    assert sensor.matched
    assert sensor.missing() == []
    assert sensor.deserted() == []
    world.bus.writers[:] = [end for end in world.bus.writers if end.topic != window_topic("/plant")]
    assert sensor.deserted() == ["/plant"]
