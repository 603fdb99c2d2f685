"""What a foreign node that needs the time has to know of a run: when its ticks are. Plain rclpy.

The coordinator tells it once, on `/emulation/start` (std_msgs/String, reliable, transient local): a JSON text

  {"run": "...", "is": {"t0_ns": 1795623446936358805, "ticks_per_second": 32, "rate": "20", "end_tick": 32000, ...}}

Tick k is at t0 + k / (ticks_per_second rate) on the wall clock. The end comes on `/emulation/stop`, of the same kind.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from fractions import Fraction

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Ticks:
    """The instants of a run's ticks.

    Attributes
    ----------
    end
        The first tick at which nobody acts any more.
    """

    def __init__(self, start: dict[str, object]) -> None:
        self._t0_ns = int(str(start["t0_ns"]))
        self._per_second = int(str(start["ticks_per_second"])) * Fraction(str(start["rate"]))
        self.per_second = int(str(start["ticks_per_second"]))
        self.end = int(str(start["end_tick"]))

    def seconds_until(self, tick: int) -> float:
        """Wall time until a tick [s]; negative if it has been."""
        return float((self._t0_ns - time.time_ns()) / 1e9 + tick / self._per_second)


def serve_runs(node: Node, play: Callable[[Ticks, Callable[[], bool]], None]) -> None:
    """Take part in one run after another.

    Parameters
    ----------
    node
        Whose.
    play
        Called for each run with its ticks, and with a function that tells whether it has been ended early.
    """
    starts: list[dict[str, object]] = []
    stopped: list[bool] = []

    def on_start(message: String) -> None:
        stopped.clear()
        starts.append(json.loads(message.data)["is"])

    node.create_subscription(String, "/emulation/start", on_start, _LATCHED)
    node.create_subscription(String, "/emulation/stop", lambda _: stopped.append(True), _LATCHED)
    print("ready", flush=True)
    while rclpy.ok():
        rclpy.spin_once(node, timeout_sec=1.0)
        if starts:
            play(Ticks(starts.pop()), lambda: bool(stopped))


def spin_until(node: Node, ticks: Ticks, tick: int) -> None:
    """Take messages until the instant of a tick."""
    while (left := ticks.seconds_until(tick)) > 0.0:
        rclpy.spin_once(node, timeout_sec=left)
