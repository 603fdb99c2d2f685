"""A foreign node that only listens, in plain rclpy: it prints what it gets until it has heard so many messages."""

from __future__ import annotations

import sys

import rclpy
from geometry_msgs.msg import Point32, PoseStamped
from rclpy.qos import QoSProfile
from rosgraph_msgs.msg import Clock

count = int(sys.argv[1])
rclpy.init()
node = rclpy.create_node("listener")
heard, newest = 0, 0


def on_point(s: Point32) -> None:
    global heard
    heard += 1
    print(s.x, s.y, s.z, flush=True)


def on_pose(pose: PoseStamped) -> None:
    stamps.add(pose.header.stamp.sec)


def on_clock(clock: Clock) -> None:
    times.append(clock.clock.sec * 10**9 + clock.clock.nanosec)


stamps: set[int] = set()
times: list[int] = []
node.create_subscription(Clock, "/clock", on_clock, 1000)
node.create_subscription(PoseStamped, "/state/plant/attitude", on_pose, QoSProfile(depth=1000))
print("ready", flush=True)
node.create_subscription(Point32, "/filtered_error", on_point, QoSProfile(depth=1000))
while heard < count:
    rclpy.spin_once(node, timeout_sec=1.0)
print("clock", times == sorted(times), len(times) > 0, flush=True)
