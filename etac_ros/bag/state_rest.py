"""The state that a bag lacks which was cut off: it waits for a second to be written, and follows from what is there."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from etac_ros.bag.clock import AFTER_ALL_STEPS, log_time_ns, published_ns, step_of, tick_of, tick_time_ns
from etac_ros.bag.codec import decode, decode_truth
from etac_ros.bag.contents import RawMessage
from etac_ros.bag.state import StateStreams
from etac_ros.bag.topics import TopicDescription
from etac_ros.graph.graph import Graph
from etac_ros.graph.ledger import from_rows
from etac_ros.graph.topics import node_of_ledger
from etac_ros.maths.wall_clock import WallClock


class StateRest:
    """Makes the state of a run anew, of what its bag holds, and gives what is not there.

    Parameters
    ----------
    state, graph
        Of the run: what shows it, and what ran.
    wall
        The instants of ticks in a run in real time; None of one in simulated time.
    """

    def __init__(self, state: StateStreams, graph: Graph, wall: WallClock | None = None) -> None:
        self._state = state
        self._graph = graph
        self._wall = wall
        self._there: dict[str, set[tuple[int, bytes]]] = {topic.name: set() for topic in state.topics}
        """What is there: by the time it tells of, since plants take turns on ``/tf`` as it comes."""

    def fits(self, topics: list[TopicDescription]) -> bool:
        """Whether a bag has the very topics of state that this makes."""
        return {topic for topic in topics if topic.kind == "state"} == set(self._state.topics)

    def take(self, message: RawMessage) -> None:
        """Take note of a message of the bag, in the order of the file."""
        topic = message.topic
        if topic.kind == "state":
            self._there[topic.name].add((message.publish_time_ns, message.cdr))
        elif topic.plant is not None:
            self._state.take_truth(topic.plant, *decode_truth(message.cdr))
        elif topic.link is not None and self._state.hears(topic.link):
            if self._wall is not None:
                tick, step = self._wall.tick_at(message.publish_time_ns), 0
            else:
                tick_ns = published_ns(message.log_time_ns, message.publish_time_ns)
                tick = tick_of(tick_ns, self._graph.ticks_per_second)
                step = step_of(message.log_time_ns, message.publish_time_ns)
            value = decode(topic.type_name, message.cdr)
            self._state.take_message(topic.link, message.sequence, tick, step, value)
        elif self._wall is not None and (node := node_of_ledger(topic.name)) in self._graph.plants:
            self._state.take_ledger(str(node), from_rows(decode_truth(message.cdr)[1]))

    def rest(self) -> Iterator[tuple[str, bytes, int, int, int]]:
        """What is not there: topic, bytes, log time, publish time and number."""
        numbers = {topic: len(there) for topic, there in self._there.items()}
        for topic, cdr, tick, _ in self._state.ready(sys.maxsize, everything=True):
            if self._wall is not None:
                published = logged = self._wall.instant_ns(tick)
            else:
                published = tick_time_ns(tick, self._graph.ticks_per_second)
                logged = log_time_ns(published, AFTER_ALL_STEPS)
            if (published, cdr) not in self._there[topic]:
                numbers[topic] += 1
                yield topic, cdr, logged, published, numbers[topic]
