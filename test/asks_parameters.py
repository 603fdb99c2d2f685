"""A ROS tool for the tests, in plain rclpy: reads a node's parameters, tries to set one, and listens to /rosout."""

from __future__ import annotations

import json
import sys

import rclpy
from rcl_interfaces.msg import Log
from rclpy.parameter import Parameter
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, QoSProfile

rclpy.init()
node = rclpy.create_node("tool")
heard: list[str] = []
node.create_subscription(
    Log, "/rosout", lambda log: heard.append(f"{log.name}: {log.msg}"),
    QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL),
)  # fmt: skip
client = AsyncParameterClient(node, sys.argv[1])
assert client.wait_for_services(30.0)


def answer(future):  # type: ignore[no-untyped-def]
    rclpy.spin_until_future_complete(node, future, timeout_sec=30.0)
    return future.result()


names = answer(client.list_parameters()).result.names
values = answer(client.get_parameters(["trigger.alpha", "module", "ticks_per_second"])).values
(told,) = answer(client.set_parameters([Parameter("trigger.alpha", value=0.9)])).results
spoken = f"{sys.argv[1].lstrip('/')}: "
while not any(line.startswith(spoken) for line in heard):  # others of its process may be heard first
    rclpy.spin_once(node, timeout_sec=30.0)
print(
    json.dumps(
        {
            "names": list(names),
            "values": [values[0].double_value, values[1].string_value, values[2].integer_value],
            "set": told.successful,
            "why": told.reason,
            "heard": heard,
        }
    )
)
