"""What was sent, received and recorded in real time has to be the same everywhere, as in simulated time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from etac_ros.engines.ros.count_check import Outcome
from etac_ros.engines.ros.plan import RECORDER, Plan
from etac_ros.errors import CountMismatch

Notes = Mapping[str, Mapping[str, Any]]


def counts_of(plan: Plan, notes: Notes) -> dict[str, dict[str, int]]:
    """How many messages of each recorded topic there were, by who has counted them.

    Parameters
    ----------
    plan
        The run.
    notes
        What each node has last said.
    """
    sent: dict[str, int] = {}
    for note in notes.values():
        for topic, (messages, _) in note["sent"].items():
            sent[topic] = sent.get(topic, 0) + messages
    links = {link.topic: link for link in plan.graph.links.values()}
    found = {}
    for topic, (messages, _) in notes[RECORDER]["received"].items():
        counts = {"received by the recorder": messages}
        link = links.get(topic)
        if link is None or link.sender not in plan.graph.external:
            counts["sent by the publisher"] = sent.get(topic, 0)
        for receiver in link.receivers if link is not None else ():
            if link is not None and receiver in notes:
                counts[f"received by {receiver}"] = notes[receiver]["heard"][link.name]
        found[topic] = counts
    return found


def mismatch(plan: Plan, notes: Notes, in_bag: Mapping[str, int] | None = None) -> CountMismatch | None:
    """The first topic of which two counts differ, or None.

    Parameters
    ----------
    plan, notes
        The run, and what its nodes have last said.
    in_bag
        Messages a topic in the finished bag; None while there is none.
    """
    for topic, counts in counts_of(plan, notes).items():
        if in_bag is not None:
            counts["in the bag"] = in_bag.get(topic, 0)
        if len(set(counts.values())) > 1:
            found = ", ".join(f"{count} {who}" for who, count in counts.items())
            return CountMismatch(f"topic {topic}", found, "the same number everywhere")
    return None


def check_wall_outcome(plan: Plan, outcome: Outcome, in_bag: Mapping[str, int]) -> None:
    """Hold a finished run to its counts.

    Raises
    ------
    CountMismatch
        If two counts of a topic differ.
    """
    wrong = mismatch(plan, outcome.leave_notes, in_bag)
    if wrong is not None:
        raise wrong
