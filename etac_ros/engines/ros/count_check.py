"""What was sent, received and recorded has to be the same everywhere, and what was done is what was laid down."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from etac_ros.engines.ros.plan import RECORDER, Plan
from etac_ros.errors import CountMismatch, OrderMismatch


@dataclass(frozen=True)
class Outcome:
    """What the coordinator knows when all nodes have left.

    Attributes
    ----------
    tick
        Where the run ended.
    halted
        Why a watch ended it; empty for a run to its end.
    fired, sent
        Triggers a module and messages a link, as the time master counted them.
    done
        Digest of what each module was told to do, and when.
    leave_notes
        Last notes of all nodes: their counts a topic (messages, CDR bytes), process and memory.
    began_s
        When the first window was opened, on the clock of ``time.perf_counter``.
    loop_s
        Wall time from the first window to the last report [s].
    """

    tick: int
    halted: str
    fired: Mapping[str, int]
    sent: Mapping[str, int]
    done: Mapping[str, int]
    leave_notes: Mapping[str, Mapping[str, Any]]
    began_s: float
    loop_s: float

    def sent_by_topic(self) -> dict[str, tuple[int, int]]:
        """Messages and CDR bytes that the publishers of each topic counted."""
        totals: dict[str, tuple[int, int]] = {}
        for leave_note in self.leave_notes.values():
            for topic, (messages, size) in leave_note["sent"].items():
                before = totals.get(topic, (0, 0))
                totals[topic] = (before[0] + messages, before[1] + size)
        return totals

    def strangers(self) -> dict[str, int]:
        """Messages on each topic that were not of this run, as the node counted them that saw the most."""
        found: dict[str, int] = {}
        for leave_note in self.leave_notes.values():
            for topic, messages in leave_note["strangers"].items():
                found[topic] = max(found.get(topic, 0), messages)
        return found

    def written(self, topic: str) -> int:
        """Messages of a topic that the recorder has handed to the bag."""
        return int(self.leave_notes[RECORDER]["written"].get(topic, (0, 0))[0])

    def memory_kib(self) -> dict[str, int]:
        """Peak memory of the process of each node."""
        return {name: int(leave_note["memory_kib"]) for name, leave_note in self.leave_notes.items()}


def check_outcome(plan: Plan, outcome: Outcome, in_bag: Mapping[str, int]) -> None:
    """Everything that a finished run can be held to.

    Parameters
    ----------
    plan, outcome
        The run and what its nodes said.
    in_bag
        Messages a topic in the finished bag, as the bag itself says.

    Raises
    ------
    OrderMismatch, CountMismatch
        If what was done is not what was laid down, or two counts of a topic differ.
    """
    check_order(plan, outcome)
    if not outcome.halted:  # who was just sending when the run was ended has not been heard by everybody
        check_counts(plan, outcome, in_bag)


def check_counts(plan: Plan, outcome: Outcome, in_bag: Mapping[str, int]) -> None:
    """Compare four independent counts of every recorded topic.

    Parameters
    ----------
    plan, outcome
        The run and what its nodes said.
    in_bag
        Messages a topic in the finished bag, as the bag itself says.

    Raises
    ------
    CountMismatch
        Naming the topic and all counts, if any two differ.
    """
    sent = {topic: messages for topic, (messages, _) in outcome.sent_by_topic().items()}
    received = outcome.leave_notes[RECORDER]["received"]
    mastered = {link.topic: outcome.sent[link.name] for link in plan.graph.links.values()}
    foreign = {link.topic for link in plan.graph.links.values() if link.sender in plan.graph.external}
    for topic, (messages, _) in received.items():
        counts = {"received by the recorder": messages, "in the bag": in_bag.get(topic, 0)}
        if topic not in foreign:
            counts["sent by the publisher"] = sent.get(topic, 0)
        if topic in mastered:
            counts["known to the coordinator"] = mastered[topic]
        if len(set(counts.values())) > 1:
            found = ", ".join(f"{count} {who}" for who, count in counts.items())
            raise CountMismatch(f"topic {topic}", found, "the same number everywhere")


def check_order(plan: Plan, outcome: Outcome) -> None:
    """Compare what each module did, and each value that it heard, with what the others know of it.

    Raises
    ------
    OrderMismatch
        If a module has not done exactly what the time master laid down, or a value has changed on its way.
    """
    for name in plan.modules:
        if outcome.leave_notes[name]["done"] != outcome.done[name]:
            raise OrderMismatch(
                f"node {name}",
                "what it did, and when, is not what the coordinator laid down: the run is no result",
                "the same acts on the same windows and messages in the same order",
                "this is a fault of etac_ros: please report it with the bag",
            )
    for link in plan.graph.links.values():
        if link.sender in plan.graph.external:
            continue
        sent = outcome.leave_notes[link.sender]["sent_values"][link.name]
        for receiver in link.receivers:
            if receiver not in plan.graph.external and outcome.leave_notes[receiver]["values"][link.name] != sent:
                raise OrderMismatch(
                    f"topic {link.topic}",
                    f"{receiver} has not received the values that {link.sender} sent",
                    "the same bits at both ends",
                    "is another program publishing on this topic in this ROS domain?",
                )
