"""A controller for wu2018 in plain rclpy: it knows nothing of etac_ros, and answers each message with one.

$ ROS_DOMAIN_ID=7 python foreign_proportional.py
$ etac run wu2018 --set controller.external=true --domain 7
"""

import contextlib

import rclpy
from geometry_msgs.msg import Point32
from rclpy.executors import ExternalShutdownException
from rclpy.qos import QoSProfile

GAIN = 26.113821209155528  # [N m s/rad], the paper's: see config/wu2018.yaml
RELIABLE = QoSProfile(depth=10)  # reliable and volatile, as QoSProfile is unless told otherwise


def main() -> None:
    """Answer until the process is ended."""
    rclpy.init()
    node = rclpy.create_node("my_controller")
    commands = node.create_publisher(Point32, "/torque_command", RELIABLE)

    def on_error(s: Point32) -> None:
        commands.publish(Point32(x=-GAIN * s.x, y=-GAIN * s.y, z=-GAIN * s.z))

    node.create_subscription(Point32, "/filtered_error", on_error, RELIABLE)
    with contextlib.suppress(KeyboardInterrupt, ExternalShutdownException):
        rclpy.spin(node)


if __name__ == "__main__":
    main()
