"""What all nodes of a run have in common: they join, they begin together, they drain, they leave."""

from __future__ import annotations

import os
import resource
from typing import Any

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from etac_ros.engines.ros.endpoints import Callback, Publisher, Spinner, Subscription
from etac_ros.engines.ros.messages import note, read_note
from etac_ros.engines.ros.plan import Plan
from etac_ros.graph.topics import END, FAULT, JOIN, LEAVE, START, STOP


class RunNode:
    """One ROS node of a run.

    Parameters
    ----------
    plan
        The run.
    name
        Full node name.
    spinner
        The loop of the process.
    context
        The initialised rclpy context.
    """

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        self.plan = plan
        self.name = name
        self.started = False
        self.has_left = False
        self.finished = False
        self.stop: dict[str, Any] | None = None
        namespace, _, base = name.rpartition("/")
        self.ros_node = Node(
            base,
            namespace=namespace or "/",
            context=context,
            enable_rosout=False,
            start_parameter_services=False,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._spinner = spinner
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._joining = self.publisher(String, JOIN, 0, latched=True)
        self._fault = self.publisher(String, FAULT, 0, latched=True)
        self._leaving = self.publisher(String, LEAVE, 2)
        for topic, callback in ((START, self._on_start), (STOP, self._on_stop), (END, self._on_end)):
            self._hear_as_all_do(topic, callback)

    def publisher(self, kind: type, topic: str, listeners: int, latched: bool = False) -> Publisher:
        """A counting publisher of this node."""
        publisher = Publisher(self.ros_node, kind, topic, listeners, latched)
        self._publishers.append(publisher)
        return publisher

    def subscription(
        self,
        kind: type,
        topic: str,
        callback: Callback,
        raw: bool = False,
        latched: bool = False,
        shared: bool = False,
    ) -> Subscription:
        """A subscription of this node, served by the process's loop."""
        subscription = Subscription(self.ros_node, kind, topic, callback, raw, latched, shared)
        self._subscriptions.append(subscription)
        self._spinner.add(subscription)
        return subscription

    def _hear_as_all_do(self, topic: str, callback: Callback) -> None:
        """Hear what the coordinator tells everybody; the nodes of a process share one subscription."""

        def make() -> Subscription:
            return Subscription(self.ros_node, String, topic, callback, latched=True)

        self._subscriptions.append(self._spinner.for_all(topic, make, callback))

    @property
    def matched(self) -> bool:
        """Whether all publishers have their listeners and all subscriptions have a publisher."""
        return all(publisher.matched for publisher in self._publishers) and all(
            subscription.matched for subscription in self._subscriptions
        )

    def missing(self) -> list[str]:
        """Topics whose other end is not there."""
        ends: list[Publisher | Subscription] = [*self._publishers, *self._subscriptions]
        return sorted({end.topic for end in ends if not end.matched})

    def deserted(self) -> list[str]:
        """Nodes that should send something to this one, and are not there."""
        topics = {subscription.topic for subscription in self._subscriptions if not subscription.matched}
        return sorted({self.plan.sender_of(topic) for topic in topics})

    def announce(self) -> None:
        """Tell the coordinator that this node is ready."""
        self._joining.publish(
            note(
                {
                    "node": self.name,
                    "scenario": self.plan.scenario,
                    "digest": self.plan.digest,
                    "pid": os.getpid(),
                }
            )
        )

    def say_fault(self, text: str) -> None:
        """Tell the coordinator that this node has failed."""
        self._fault.publish(note({"node": self.name, "fault": text}))
        self._fault.drain(1.0)

    def settle(self) -> None:
        """Leave if the run has ended and everything has arrived. Called whenever something may have changed."""
        if self.stop is not None and not self.has_left and self.drained():
            self.has_left = True
            self.leave()

    def drained(self) -> bool:
        """Whether nothing more will come, after a stop."""
        return True

    def leave(self) -> None:
        """Leave with the counts of all topics.

        The node stays until all have said so: then whatever it sent has arrived, and it can go at once. Waiting for
        acknowledgements instead would take as long as a lease, where the other end has gone without sending one.
        """
        self._leaving.publish(note(self.leave_note()))

    def leave_note(self) -> dict[str, Any]:
        """What the last note of this node says."""
        return {
            "node": self.name,
            "pid": os.getpid(),
            "memory_kib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            "sent": {
                publisher.topic: [publisher.count.messages, publisher.count.cdr_bytes]
                for publisher in self._publishers
                if publisher.count.messages
            },
        }

    def abort(self) -> None:
        """Save what can be saved: the process is told to end before the run has."""

    def on_start(self) -> None:
        """The run begins."""

    def _on_start(self, message: Any, sequence: int) -> None:
        if not self.started:
            self.started = True
            self.on_start()

    def _on_stop(self, message: Any, sequence: int) -> None:
        if self.stop is None:
            self.stop = read_note(message)
            self.settle()

    def _on_end(self, message: Any, sequence: int) -> None:
        self.finished = True
