"""A sensor of wu2018 with a trigger rule of its own, which knows nothing of etac_ros. Plain rclpy.

The plant publishes its samples ahead, in windows, since the torque is held and they are known: a sensor takes that of a
tick at the instant of the tick. The rule here is another than the paper's: send when the signal has turned by 25 deg,
or its norm has changed by half, but never for a signal smaller than a bound.

  ./scripts/run wu2018 --set sensor.external=true --domain 7 --clock wall --rate 5
  ROS_DOMAIN_ID=7 python examples/foreign_sensor.py
"""

from __future__ import annotations

import math
from collections.abc import Callable

import rclpy
from geometry_msgs.msg import Point32
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from real_time import Ticks, serve_runs, spin_until
from std_msgs.msg import Float64MultiArray

BETA = 0.08  # 1/s, wu2018 eq. (39)
SMALLEST = 1.0e-5  # rad/s
_HEAD = 3  # epoch, first tick, and one more number before the samples of a window


class Sensor(Node):
    """s = omega + beta q_v, sent when it has changed enough."""

    def __init__(self) -> None:
        super().__init__("foreign_sensor")
        self._samples: dict[int, tuple[float, ...]] = {}
        self._sent: tuple[float, float, float] | None = None
        self._publisher = self.create_publisher(Point32, "/filtered_error", QoSProfile(depth=10))
        self.create_subscription(Float64MultiArray, "/emulation/plant/window", self._keep, QoSProfile(depth=100))

    def _keep(self, window: Float64MultiArray) -> None:
        """Samples of a later window replace those of the same ticks: a torque has changed them."""
        first, width = int(window.data[1]), window.layout.dim[1].size
        for row in range(window.layout.dim[0].size):
            place = _HEAD + row * width
            self._samples[first + row] = tuple(window.data[place : place + width])

    def play(self, ticks: Ticks, stopped: Callable[[], bool]) -> None:
        """Look at each sample at its instant."""
        self._sent = None
        for tick in range(ticks.end):
            spin_until(self, ticks, tick)
            if stopped():
                break
            sample = self._samples.pop(tick, None)
            if sample is not None:
                self._look(sample)
        self._samples.clear()

    def _look(self, sample: tuple[float, ...]) -> None:
        _, *vector = sample[:4]
        signal = tuple(omega + BETA * q for omega, q in zip(sample[4:7], vector, strict=True))
        if self._sent is None or _has_changed(self._sent, signal):
            self._sent = signal
            self._publisher.publish(Point32(x=signal[0], y=signal[1], z=signal[2]))


def _has_changed(before: tuple[float, ...], now: tuple[float, ...]) -> bool:
    old, new = math.hypot(*before), math.hypot(*now)
    if new < SMALLEST and old < SMALLEST:
        return False
    cosine = sum(a * b for a, b in zip(before, now, strict=True)) / max(old * new, 1e-300)
    return abs(new - old) > 0.5 * max(old, SMALLEST) or cosine < math.cos(math.radians(25.0))


def main() -> None:
    """Take part in one run after another until interrupted."""
    rclpy.init()
    try:
        sensor = Sensor()
        serve_runs(sensor, sensor.play)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
