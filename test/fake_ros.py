"""ROS without DDS: nodes, publishers and subscriptions of one process, joined by queues: a test takes milliseconds.

The nodes of the ros engine run on it unchanged, with their real messages, serialized as for the wire. It keeps what the
engine relies on: order within a topic, sequence numbers from each publisher, and late joiners of latched topics.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import count
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.serialization import deserialize_message, serialize_message

from etac_ros.engines.ros import convener, coordinator, endpoints, module_node, run_node
from etac_ros.engines.ros.coordinator import CoordinatorNode
from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.endpoints import Spinner
from etac_ros.engines.ros.module_node import ModuleNode, PlantNode
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.recorder import RecorderNode
from etac_ros.engines.ros.run_node import RunNode
from etac_ros.runs import windows_of
from etac_ros.scenario.load import Scenario


class Handle:
    """One reader's queue."""

    pointers = iter(range(1, 10**9))

    def __init__(self) -> None:
        self.pointer = next(Handle.pointers)
        self.waiting: deque[tuple[bytes, int, int]] = deque()

    def take_message(self, kind: type, raw: bool) -> tuple[Any, dict[str, int]] | None:
        if not self.waiting:
            return None
        data, number, published_ns = self.waiting.popleft()
        info = {"publication_sequence_number": number, "source_timestamp": published_ns, "received_timestamp": 0}
        return data if raw else deserialize_message(data, kind), info


@dataclass
class End:
    """One end of a topic, as discovery tells of it."""

    node_name: str
    node_namespace: str
    topic: str
    topic_type: str
    qos_profile: QoSProfile
    handle: Handle = field(default_factory=Handle)
    sent: list[bytes] = field(default_factory=list)


class Bus:
    """Everything that is in one ROS domain."""

    def __init__(self) -> None:
        self.writers: list[End] = []
        self.readers: list[End] = []
        self.acknowledges = True
        self.published = count(1)
        """Times of publication [ns]."""

    def node(self, name: str, namespace: str = "/", **_: Any) -> Node:
        return Node(self, name, namespace)

    def on(self, ends: list[End], topic: str) -> list[End]:
        return [end for end in ends if end.topic == topic]

    def said(self, topic: str) -> list[bytes]:
        """All that was published on a topic."""
        return [data for end in self.on(self.writers, topic) for data in end.sent]


class Node:
    """What the engine uses of :class:`rclpy.node.Node`."""

    def __init__(self, bus: Bus, name: str, namespace: str) -> None:
        self._bus = bus
        self._names = (name, namespace)

    def create_publisher(self, kind: type, topic: str, qos: QoSProfile) -> FakePublisher:
        end = End(*self._names, topic, type_name(kind), qos)
        self._bus.writers.append(end)
        return FakePublisher(self._bus, end)

    def create_subscription(
        self, kind: type, topic: str, callback: Callable[[Any], None], qos: QoSProfile, raw: bool = False
    ) -> End:
        end = End(*self._names, topic, type_name(kind), qos)
        self._bus.readers.append(end)
        if qos.durability is DurabilityPolicy.TRANSIENT_LOCAL:
            for writer in self._bus.on(self._bus.writers, topic):
                if writer.sent and writer.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL:
                    end.handle.waiting.append((writer.sent[-1], len(writer.sent), 0))
        return end

    def get_subscriptions_info_by_topic(self, topic: str) -> list[End]:
        return self._bus.on(self._bus.readers, topic)

    def get_publishers_info_by_topic(self, topic: str) -> list[End]:
        return self._bus.on(self._bus.writers, topic)

    def count_publishers(self, topic: str) -> int:
        return len(self._bus.on(self._bus.writers, topic))


class FakePublisher:
    """What the engine uses of a publisher of rclpy."""

    def __init__(self, bus: Bus, end: End) -> None:
        self._bus = bus
        self.end = end

    @property
    def handle(self) -> FakePublisher:
        return self

    def publish_raw(self, data: bytes) -> None:
        assert isinstance(data, bytes)
        self.publish(data)

    def publish(self, message: Any) -> None:
        data = message if isinstance(message, bytes) else serialize_message(message)
        self.end.sent.append(data)
        published_ns = next(self._bus.published)
        for reader in self._bus.on(self._bus.readers, self.end.topic):
            reader.handle.waiting.append((data, len(self.end.sent), published_ns))

    def get_subscription_count(self) -> int:
        return len(self._bus.on(self._bus.readers, self.end.topic))

    def wait_for_all_acked(self, timeout: Any) -> bool:
        return self._bus.acknowledges


class WaitSet:
    """What the engine uses of rclpy's wait set; it never waits."""

    def __init__(self, subscriptions: int, *others: Any) -> None:
        self.room = subscriptions
        assert others[:-1] == (0, 0, 0, 0, 0)  # no guards, timers, clients, services or events
        self._handles: list[Handle] = []

    def clear_entities(self) -> None:
        self._handles = []

    def add_subscription(self, handle: Handle) -> None:
        assert len(self._handles) < self.room
        self._handles.append(handle)

    def wait(self, nanoseconds: int) -> None:
        assert isinstance(nanoseconds, int)

    def get_ready_entities(self, kind: str) -> list[int]:
        assert kind == "subscription"
        return [handle.pointer for handle in self._handles if handle.waiting]


class Clock:
    """Wall time that stands still unless a test moves it."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now

    perf_counter = monotonic


def type_name(kind: type) -> str:
    return f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"


@dataclass
class Sink:
    """A bag that keeps what it was given."""

    bus: Bus
    written: list[tuple[str, bytes, int, int, int]] = field(default_factory=list)
    placed: list[int] = field(default_factory=list)
    safe: int = 0
    closed: int = 0

    def write(self, topic: str, cdr: bytes, log_time_ns: int, publish_time_ns: int, sequence: int) -> None:
        assert not self.closed
        self.written.append((topic, cdr, log_time_ns, publish_time_ns, sequence))

    def placed_until(self, tick_time_ns: int) -> None:
        assert not self.closed
        self.placed.append(tick_time_ns)

    def secure(self) -> None:
        self.safe = len(self.written)

    def close(self) -> None:
        self.closed += 1

    def counts(self) -> dict[str, int]:
        return {topic: sum(one[0] == topic for one in self.written) for topic in {one[0] for one in self.written}}


class World:
    """All nodes of a run in one process, on a bus of their own."""

    def __init__(
        self, scenario: Scenario, patch: pytest.MonkeyPatch, *, token: str = "t", windows: bool = False
    ) -> None:
        self.bus = Bus()
        self.clock = Clock()
        patch.setattr(run_node, "Node", self.bus.node)
        patch.setattr(endpoints, "_rclpy", SimpleNamespace(WaitSet=WaitSet))
        for module in (convener, coordinator, module_node):
            patch.setattr(module, "time", self.clock)
        self.plan = Plan(scenario.name, scenario.digest, scenario.build(), windows_of(scenario), windows, token)
        self.sinks: list[Sink] = []
        self.progress: list[int] = []
        context: Any = SimpleNamespace(handle=None)
        self.spinner = Spinner(context)
        self.nodes: dict[str, RunNode] = {}
        plants: dict[str, PlantNode] = {}
        for name in self.plan.modules:
            kind = PlantNode if name in self.plan.graph.plants else ModuleNode
            self.nodes[name] = kind(self.plan, name, self.spinner, context)
            if isinstance(self.nodes[name], PlantNode):
                plants[name] = self.nodes[name]  # type: ignore[assignment]
        self.recorder = RecorderNode(self.plan, self.spinner, context, self._open_sink)
        self.coordinator = CoordinatorNode(
            self.plan,
            self.spinner,
            context,
            plants if self.plan.timekeeper_with else {},
            lambda tick, fired: self.progress.append(tick),
        )
        self.nodes |= {RECORDER: self.recorder, COORDINATOR: self.coordinator}

    def _open_sink(self) -> Sink:
        self.sinks.append(Sink(self.bus))
        return self.sinks[-1]

    @property
    def sink(self) -> Sink:
        (sink,) = self.sinks
        return sink

    def join(self) -> None:
        for node in self.nodes.values():
            assert node.matched, node.missing()
            node.announce()

    def spin(self) -> None:
        """Until nothing is on its way any more."""
        while self.spinner.once(0.05):
            pass

    def run(self) -> Outcome:
        self.join()
        self.spin()
        return self.outcome()

    def outcome(self) -> Outcome:
        master = self.coordinator.master
        return Outcome(
            master.tick, self.coordinator.halted, master.fired, master.sent, master.done,
            self.coordinator.leave_notes, self.coordinator.began, self.coordinator.loop_s,
        )  # fmt: skip
