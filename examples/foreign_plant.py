"""A simulator of one's own in the place of wu2018's plant, which knows nothing of etac_ros. Plain rclpy.

It publishes the state of each tick at its instant, as a window of one sample, and holds the torque that has come last.
This is a rigid body without disturbance in thirty lines; yours may be anything, hardware included.

  ./scripts/run wu2018 --set plant.external=true --domain 7 --clock wall
  ROS_DOMAIN_ID=7 python examples/foreign_plant.py
"""

from __future__ import annotations

from collections.abc import Callable

import rclpy
from geometry_msgs.msg import Vector3
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile
from real_time import Ticks, serve_runs, spin_until
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout

INERTIA = (147.0, 158.0, 137.0)  # kg m^2, about principal axes
START = (0.99406, 0.0894, 0.0409, -0.0466, 0.0, 0.0, 0.0)  # q (scalar first), omega [rad/s]
State = tuple[float, ...]


def rate(state: State, torque: tuple[float, ...]) -> State:
    """Time derivative: q' = q * (0, omega) / 2, J omega' = -omega x J omega + torque."""
    q0, q1, q2, q3, x, y, z = state
    j1, j2, j3 = INERTIA
    return (
        -0.5 * (q1 * x + q2 * y + q3 * z),
        0.5 * (q0 * x + q2 * z - q3 * y),
        0.5 * (q0 * y + q3 * x - q1 * z),
        0.5 * (q0 * z + q1 * y - q2 * x),
        ((j2 - j3) * y * z + torque[0]) / j1,
        ((j3 - j1) * z * x + torque[1]) / j2,
        ((j1 - j2) * x * y + torque[2]) / j3,
    )


def step(state: State, torque: tuple[float, ...], h: float) -> State:
    """One step of the classical Runge-Kutta method, and a quaternion of length one."""

    def ahead(slope: State, part: float) -> State:
        return tuple(value + part * h * change for value, change in zip(state, slope, strict=True))

    a = rate(state, torque)
    b = rate(ahead(a, 0.5), torque)
    c = rate(ahead(b, 0.5), torque)
    d = rate(ahead(c, 1.0), torque)
    mean = tuple((p + 2 * q + 2 * r + s) / 6 for p, q, r, s in zip(a, b, c, d, strict=True))
    following = ahead(mean, 1.0)
    length = sum(value * value for value in following[:4]) ** 0.5
    return (*(value / length for value in following[:4]), *following[4:])


class Plant(Node):
    """A rigid body in real time."""

    def __init__(self) -> None:
        super().__init__("foreign_plant")
        self._torque = (0.0, 0.0, 0.0)
        self._publisher = self.create_publisher(Float64MultiArray, "/emulation/plant/window", QoSProfile(depth=100))
        self.create_subscription(Vector3, "/emulation/torque", self._hold, QoSProfile(depth=10))

    def _hold(self, torque: Vector3) -> None:
        self._torque = (torque.x, torque.y, torque.z)

    def play(self, ticks: Ticks, stopped: Callable[[], bool]) -> None:
        """Publish each state at its instant, without a gap; who is late catches up."""
        self._torque = (0.0, 0.0, 0.0)
        state: State = START
        for tick in range(ticks.end + 1):
            spin_until(self, ticks, tick)
            if stopped():
                return
            self._publish(tick, state)
            rclpy.spin_once(self, timeout_sec=0.0)
            state = step(state, self._torque, 1.0 / ticks.per_second)

    def _publish(self, tick: int, state: State) -> None:
        rows = MultiArrayDimension(label="tick", size=1, stride=len(state))
        columns = MultiArrayDimension(label="state", size=len(state), stride=len(state))
        layout = MultiArrayLayout(dim=[rows, columns], data_offset=3)
        # Before the samples: a running number, the tick of the first sample, and -1.
        head = (tick + 1.0, float(tick), -1.0)
        self._publisher.publish(Float64MultiArray(layout=layout, data=[*head, *state]))


def main() -> None:
    """Take part in one run after another until interrupted."""
    rclpy.init()
    try:
        plant = Plant()
        serve_runs(plant, plant.play)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
