"""A foreign controller for the tests, in plain rclpy: it imports nothing of etac_ros, and misbehaves as it is told."""

from __future__ import annotations

import argparse
import os
import signal

import rclpy
from geometry_msgs.msg import Point32, Vector3, Vector3Stamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64MultiArray, String

parser = argparse.ArgumentParser()
parser.add_argument("--replies", type=int, default=1, help="to each message")
parser.add_argument("--twice-at", type=int, default=0, help="answer this message twice")
parser.add_argument("--mute-after", type=int, default=10**9, help="messages")
parser.add_argument("--die-after", type=int, default=10**9, help="messages")
parser.add_argument("--before", type=int, default=0, help="messages published before it is ready")
parser.add_argument("--best-effort", action="store_true")
parser.add_argument("--transient-local", action="store_true", help="how it listens")
parser.add_argument("--wrong-type", action="store_true")
parser.add_argument("--stamped", choices=["copied", "wall"], help="answer Vector3Stamped, with which stamp")
parser.add_argument("--only-listen", action="store_true", help="to everything, and answer nothing")
parser.add_argument("--fakes", action="store_true", help="publish garbage and well-formed fakes on the notes' topics")
parser.add_argument("--timer", type=float, default=0.0, help="answer by a timer of its own, so often [s], instead")
arguments = parser.parse_args()

rclpy.init()
node = rclpy.create_node("my_own_controller")
k = 26.113821209155528
heard = 0
latest = [Point32()]


def on_error(s: Point32) -> None:
    global heard
    heard += 1
    latest[:] = [s]
    if arguments.timer or heard > arguments.mute_after:
        return
    if heard > arguments.die_after:
        os.kill(os.getpid(), signal.SIGKILL)
    for _ in range(arguments.replies + (heard == arguments.twice_at)):
        publisher.publish(kind(x=-k * s.x, y=-k * s.y, z=-k * s.z))


def on_stamped_error(error: Vector3Stamped) -> None:
    s = error.vector
    answer = Vector3Stamped(vector=Vector3(x=-k * s.x, y=-k * s.y, z=-k * s.z))
    answer.header.stamp = error.header.stamp if arguments.stamped == "copied" else node.get_clock().now().to_msg()
    publisher.publish(answer)


def publish_fakes() -> None:
    names = ("join", "start", "stop", "end", "leave", "fault", "message_log", "recorded", "sensor/next", "sensor/go")
    latched = QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL)  # fits every reader
    publishers = [node.create_publisher(String, f"/emulation/{name}", latched) for name in names]
    texts = (
        "garbage",
        "[" * 3000,
        '{"node":"/sensor","fault":"not true","tick":0,"sent":{},"orders":{}}',
        '{"run":"another","is":{"node":"/sensor","fault":"not true","tick":0,"sent":{},"orders":{}}}',
        '{"run":"another","is":{"node":"/stranger","scenario":"x","digest":"x","pid":1}}',
    )

    def publish() -> None:
        for publisher in publishers:
            for text in texts:
                publisher.publish(String(data=text))

    publish()  # what is latched is there for whoever comes
    node.create_timer(0.2, publish)


if arguments.only_listen:
    kept = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
    node.create_subscription(Point32, "/filtered_error", lambda _: None, kept)
    node.create_subscription(Float64MultiArray, "/emulation/plant/window", lambda _: None, kept)
    node.create_subscription(String, "/emulation/sensor/next", lambda _: None, kept)
elif arguments.fakes:
    publish_fakes()
else:
    kind = Vector3Stamped if arguments.stamped else Vector3 if arguments.wrong_type else Point32
    offered = QoSProfile(
        depth=10,
        reliability=ReliabilityPolicy.BEST_EFFORT if arguments.best_effort else ReliabilityPolicy.RELIABLE,
    )
    asked = QoSProfile(depth=10)
    if arguments.transient_local:
        asked.durability = DurabilityPolicy.TRANSIENT_LOCAL
    publisher = node.create_publisher(kind, "/torque_command", offered)
    for _ in range(arguments.before):
        publisher.publish(kind())
    if arguments.stamped:
        node.create_subscription(Vector3Stamped, "/filtered_error", on_stamped_error, asked)
    else:
        node.create_subscription(Point32, "/filtered_error", on_error, asked)
    if arguments.timer:
        node.create_timer(arguments.timer, lambda: publisher.publish(kind(x=-k * latest[0].x)))
print("ready", flush=True)
rclpy.spin(node)
