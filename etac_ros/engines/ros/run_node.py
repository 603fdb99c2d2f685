"""What all nodes of a run have in common: they join, they begin together, they drain, they leave."""

from __future__ import annotations

import os
import resource
import sys
from collections.abc import Collection
from typing import Any, ClassVar

from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import String

from etac_ros.engines.ros.endpoints import Callback, Publisher, Reader, Spinner, Subscription
from etac_ros.engines.ros.messages import read_note, write_note
from etac_ros.engines.ros.own_code import own_code
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.engines.ros.public import show_parameters
from etac_ros.graph.graph import USUAL_QOS, Qos
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

    hear_leave: ClassVar[tuple[str, ...]] = (COORDINATOR, RECORDER)
    """Who wants to know the counts of all."""

    def __init__(self, plan: Plan, name: str, spinner: Spinner, context: Context) -> None:
        self.plan = plan
        self.name = name
        self.started = False
        self.has_left = False
        self.finished = False
        self.start: dict[str, Any] = {}
        self.stop: dict[str, Any] | None = None
        namespace, _, base = name.rpartition("/")
        self.ros_node = Node(
            base,
            namespace=namespace or "/",
            context=context,
            # In simulated time of a launched run both would cost, and nobody waits for it.
            enable_rosout=plan.parameters is not None or plan.wall is not None,
            start_parameter_services=plan.parameters is not None,
            parameter_overrides=[Parameter("start_type_description_service", value=False)],
        )
        self._spinner = spinner
        if plan.parameters is not None:
            show_parameters(self.ros_node, plan.parameters.get(name, {}))
            spinner.serve(self.ros_node.services)
        self._publishers: list[Publisher] = []
        self._subscriptions: list[Subscription] = []
        self._joining = self.publisher(String, JOIN, latched=True)
        self._fault = self.publisher(String, FAULT, latched=True)
        self._leaving = self.publisher(String, LEAVE, self.hear_leave)
        for topic, callback in ((START, self._on_start), (STOP, self._on_stop), (END, self._on_end)):
            self._hear_as_all_do(topic, callback)

    def say(self, text: str) -> None:
        """Tell the person who has started this node, and /rosout; standard output is for results."""
        print(f"{self.name}: {text}", file=sys.stderr, flush=True)
        self.log(text)

    def log(self, text: str, error: bool = False) -> None:
        """Tell /rosout, where this node is one that ROS tools are shown."""
        if self.plan.parameters is not None:
            logger = self.ros_node.get_logger()
            if error:
                logger.error(text)
            else:
                logger.info(text)

    def publisher(
        self,
        kind: type,
        topic: str,
        listeners: Collection[str] = (),
        foreign: int = 0,
        latched: bool = False,
        qos: Qos = USUAL_QOS,
    ) -> Publisher:
        """A counting publisher of this node."""
        there = [name for name in listeners if self.plan.surely_there(name)]
        publisher = Publisher(self.ros_node, kind, topic, there, foreign, latched, qos)
        publisher.on_sent = self._spinner.sent
        self._publishers.append(publisher)
        return publisher

    def subscription(
        self,
        kind: type,
        topic: str,
        callback: Callback,
        *,
        latched: bool = False,
        shared: bool = False,
        foreign: bool = False,
        qos: Qos = USUAL_QOS,
        read: Reader | None = None,
    ) -> Subscription:
        """A subscription of this node, served by the process's loop."""
        subscription = Subscription(
            self.ros_node,
            kind,
            topic,
            callback,
            latched=latched,
            shared=shared,
            foreign=foreign,
            qos=qos,
            read=read,
        )
        if not self.plan.surely_there(self.plan.sender_of(topic)):
            subscription.expect_nobody()
        self._subscriptions.append(subscription)
        self._spinner.add(subscription)
        return subscription

    def note_subscription(
        self, topic: str, callback: Callback, latched: bool = False, shared: bool = False
    ) -> Subscription:
        """A subscription to notes of this run; what else comes on the topic is counted and ignored."""
        return self.subscription(String, topic, callback, latched=latched, shared=shared, read=self._read)

    def note(self, content: Any) -> bytes:
        """A note of this run."""
        return write_note(content, self.plan.run_id)

    def _read(self, data: bytes) -> Any:
        return read_note(data, self.plan.run_id)

    def _hear_as_all_do(self, topic: str, callback: Callback) -> None:
        """Hear what the coordinator tells everybody; the nodes of a process share one subscription."""

        def make() -> Subscription:
            return Subscription(self.ros_node, String, topic, callback, latched=True, read=self._read)

        self._subscriptions.append(self._spinner.for_all(topic, make, callback))

    @property
    def matched(self) -> bool:
        """Whether all publishers have their listeners and all subscriptions have a publisher."""
        return all(publisher.matched for publisher in self._publishers) and all(
            subscription.matched for subscription in self._subscriptions
        )

    def missing(self) -> list[str]:
        """Topics whose other end is not there, in words, each with who should be."""
        unheard = {publisher.missing() for publisher in self._publishers if not publisher.matched}
        silent = {subscription.topic for subscription in self._subscriptions if not subscription.matched}
        return sorted(unheard | {f"{topic} (no publisher: {self._sender_of(topic)})" for topic in silent})

    def _sender_of(self, topic: str) -> str:
        sender = self.plan.sender_of(topic)
        return f"{sender}, a foreign node" if sender in self.plan.graph.external else sender

    def deserted(self) -> list[str]:
        """Nodes that should send something to this one, and are not there, though no fault kills them."""
        topics = {subscription.topic for subscription in self._subscriptions if subscription.deserted()}
        return sorted({self.plan.sender_of(topic) for topic in topics} - self.plan.mortals)

    def announce(self) -> None:
        """Tell the coordinator that this node is ready."""
        words = {
            "node": self.name,
            "scenario": self.plan.scenario,
            "digest": self.plan.digest,
            "clock": self.plan.clock,
            "pid": os.getpid(),
        }
        if not self.plan.token:
            words["code"] = own_code()
        if self.plan.wall is not None:
            words["rate"] = str(self.plan.wall.rate)
        if self.plan.birth is not None:
            words["incarnation"] = self.plan.birth.incarnation
        self._joining.publish(self.note(words))

    def say_fault(self, text: str) -> None:
        """Tell the coordinator that this node has failed."""
        self._fault.publish(self.note({"node": self.name, "fault": text}))
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
        self._leaving.publish(self.note(self.leave_note()))

    def leave_note(self) -> dict[str, Any]:
        """What the last note of this node says."""
        return {
            "node": self.name,
            "pid": os.getpid(),
            "memory_kib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss,
            "sent": {
                publisher.topic: publisher.count.noted() for publisher in self._publishers if publisher.count.messages
            },
            "strangers": {
                subscription.topic: subscription.strangers
                for subscription in self._subscriptions
                if subscription.strangers
            },
        }

    def abort(self) -> None:
        """Save what can be saved: the process is told to end before the run has."""

    def begin_to_count(self) -> None:
        """From here on what foreign nodes send belongs to the run."""
        for subscription in self._subscriptions:
            subscription.open()

    def on_start(self) -> None:
        """The run begins."""

    def _on_start(self, content: Any, sequence: int) -> None:
        if not self.started:
            self.started = True
            self.start = content
            self.begin_to_count()
            self.on_start()

    def _on_stop(self, content: Any, sequence: int) -> None:
        if self.stop is None:
            self.stop = content
            self.settle()

    def _on_end(self, content: Any, sequence: int) -> None:
        self.finished = True
