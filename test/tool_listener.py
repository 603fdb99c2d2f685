"""Listens to diagnostics and to the clock of a run, as any ROS tool does, and tells at its end what it heard."""

from __future__ import annotations

import json
import signal
import sys
from types import FrameType

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from rosgraph_msgs.msg import Clock

rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
node = rclpy.create_node("listener")
clock: list[float] = []
nodes: dict[str, dict[str, str]] = {}
ended: list[int] = []


def on_diagnostics(message: DiagnosticArray) -> None:
    for status in message.status:
        nodes[status.name] = {value.key: value.value for value in status.values}


def end(number: int, frame: FrameType | None) -> None:
    ended.append(number)


signal.signal(signal.SIGTERM, end)
node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
best_effort = QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)
node.create_subscription(Clock, "/clock", lambda m: clock.append(m.clock.sec + m.clock.nanosec * 1e-9), best_effort)
print("ready", flush=True)
while not ended:
    rclpy.spin_once(node, timeout_sec=0.1)
print(json.dumps({"clock": clock, "nodes": nodes}))
sys.stdout.flush()
