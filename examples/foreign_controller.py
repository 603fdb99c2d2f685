"""A controller that knows nothing of etac_ros: it answers each signal with a torque. Plain rclpy.

It works in simulated and in real time alike, since it needs no clock:

  ./scripts/run wu2018 --set controller.external=true --domain 7 --clock wall --rate 20
  ROS_DOMAIN_ID=7 python examples/foreign_controller.py --ros-args \
      -r signal:=/filtered_error -r command:=/torque_command -p gain:=-26.113821209155528

  ./scripts/run qi2022 --set sm/controller.external=true --domain 7 --clock wall
  ROS_DOMAIN_ID=7 python examples/foreign_controller.py --ros-args -r signal:=/pm/relative -r command:=/sm/torque_s

What a node has to subscribe to and publish is what `etac contract SCENARIO NODE` prints.
"""

from __future__ import annotations

import rclpy
from geometry_msgs.msg import Point32
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.qos import QoSProfile


class Controller(Node):
    """command = gain * signal, for each message."""

    def __init__(self) -> None:
        super().__init__("foreign_controller")
        self._gain = self.declare_parameter("gain", 1.0).value
        profile = QoSProfile(depth=10)  # reliable and volatile: the defaults of rclpy
        self._publisher = self.create_publisher(Point32, "command", profile)
        self.create_subscription(Point32, "signal", self._answer, profile)

    def _answer(self, signal: Point32) -> None:
        gain = self._gain
        self._publisher.publish(Point32(x=gain * signal.x, y=gain * signal.y, z=gain * signal.z))


def main() -> None:
    """Answer until interrupted."""
    rclpy.init()
    try:
        node = Controller()
        print("ready", flush=True)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
