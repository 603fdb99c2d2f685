"""What was sent, received and recorded in real time has to be the same everywhere, as in simulated time.

A process that a fault of the scenario has killed has not said how many messages it sent or took, and nobody can know
of its last ones whether all who hear it have got them. Everything else can be held to its counts: those of the
processes that follow it, what the others have received from these, and what the recorder has written of all.
"""

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
        if plan.mortals:
            counts = _known(plan, topic, counts, notes)
        if len(set(counts.values())) > 1:
            found = ", ".join(f"{count} {who}" for who, count in counts.items())
            return CountMismatch(f"topic {topic}", found, "the same number everywhere")
    return None


def _known(plan: Plan, topic: str, counts: Mapping[str, int], notes: Notes) -> dict[str, int]:
    """Of the counts of a topic, those that have to be the same although processes were killed.

    What the sender's newest process has sent is held against its last message at each receiver, by its own numbers
    1, 2, ...: messages come without gaps, but who has come later has missed the first ones.
    """
    written = {who: counts[who] for who in ("received by the recorder", "in the bag") if who in counts}
    sender = plan.sender_of(topic)
    if len(set(written.values())) > 1 or (sender in plan.mortals and sender not in notes):
        return written
    link = next((link for link in plan.graph.links.values() if link.topic == topic), None)
    receivers = [name for name in (link.receivers if link is not None else ()) if name in notes]
    if sender in plan.graph.external:  # it has no numbers of its own, and its messages count by when they were sent
        kept = {f"received by {name}" for name in receivers if name not in plan.mortals}
        return written | {who: count for who, count in counts.items() if who in kept}
    incarnation = notes[sender]["incarnation"]
    found = {"sent by the publisher": int(notes[sender]["sent"].get(topic, [0])[0])}
    for name in (RECORDER, *receivers):
        last = _last(notes[name]["spans"], topic, incarnation)
        if last or name not in plan.mortals:  # else it was let in after the last one
            found["received by the recorder" if name == RECORDER else f"received by {name}"] = last
    return found


def _last(spans: Mapping[str, list[list[int]]], topic: str, incarnation: int) -> int:
    """Number of the last message of an incarnation that came at one end; 0 for none."""
    return next((last for which, _, last in spans.get(topic, ()) if which == incarnation), 0)


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
