"""The checks of a finished run: one message too few or too many anywhere, or one act that differs, is an error."""

from __future__ import annotations

from copy import deepcopy
from dataclasses import replace
from typing import Any

import pytest

from etac_ros.engines.ros.count_check import Outcome, check_counts, check_order, check_outcome
from etac_ros.engines.ros.plan import COORDINATOR, RECORDER, Plan
from etac_ros.errors import CountMismatch, OrderMismatch
from etac_ros.scenario.load import load
from etac_ros.timing.windows import USUAL_WINDOWS

TOPIC = "/filtered_error"
SENT = {"filtered_error": 5, "torque_command": 5, "torque": 5}


def made(*overrides: str) -> tuple[Plan, Any, dict[str, int]]:
    """A run in which all agree: the plan, the outcome, and the messages a topic in the bag."""
    scenario = load("wu2018", None, ["duration_s=10", *overrides])
    plan = Plan(scenario.name, scenario.digest, scenario.build(), USUAL_WINDOWS)
    graph = plan.graph
    notes: dict[str, Any] = {
        name: {"sent": {}, "memory_kib": 100 + place, "done": 7 + place, "values": {}, "sent_values": {}}
        for place, name in enumerate(plan.nodes)
    }
    in_bag = {link.topic: SENT[link.name] for link in graph.links.values()} | {"/emulation/plant/truth": 2}
    for place, link in enumerate(graph.links.values()):
        if link.sender in notes:
            notes[link.sender]["sent"][link.topic] = [5, 60]
            notes[link.sender]["sent_values"][link.name] = 40 + place
        for receiver in link.receivers:
            if receiver in notes:
                notes[receiver]["values"][link.name] = 40 + place
    notes["/plant"]["sent"]["/emulation/plant/truth"] = [2, 90]
    notes[RECORDER]["received"] = {topic: [count, 60] for topic, count in in_bag.items()}
    done = {name: notes[name]["done"] for name in plan.modules}
    return plan, Outcome(320, "", {}, dict(SENT), done, notes, 0.0, 1.0), in_bag


def test_all_agree() -> None:
    plan, outcome, in_bag = made()
    check_outcome(plan, outcome, in_bag)
    assert outcome.memory_kib() == {name: 100 + place for place, name in enumerate(plan.nodes)}


def test_counts_of_several_senders_of_a_topic_are_added() -> None:
    _, outcome, _ = made()
    outcome.leave_notes["/sensor"]["sent"]["/emulation/leave"] = [3, 11]  # type: ignore[index]
    outcome.leave_notes["/plant"]["sent"]["/emulation/leave"] = [1, 31]  # type: ignore[index]
    assert outcome.sent_by_topic()["/emulation/leave"] == (4, 42)
    assert outcome.sent_by_topic()[TOPIC] == (5, 60)


@pytest.mark.parametrize("by", [-2, -1, 1, 2])
@pytest.mark.parametrize("who", ["publisher", "recorder", "coordinator", "bag"])
def test_one_count_that_is_off(who: str, by: int) -> None:
    plan, outcome, in_bag = made()
    if who == "publisher":
        outcome.leave_notes["/sensor"]["sent"][TOPIC] = [5 + by, 60]
    elif who == "recorder":
        outcome.leave_notes[RECORDER]["received"][TOPIC] = [5 + by, 60]
    elif who == "coordinator":
        outcome.sent["filtered_error"] = 5 + by
    else:
        in_bag[TOPIC] = 5 + by
    with pytest.raises(CountMismatch) as caught:
        check_counts(plan, outcome, in_bag)
    counts = {"recorder": 5, "bag": 5, "publisher": 5, "coordinator": 5} | {who: 5 + by}
    assert str(caught.value).splitlines()[0] == (
        f"topic {TOPIC}: {counts['recorder']} received by the recorder, {counts['bag']} in the bag, "
        f"{counts['publisher']} sent by the publisher, {counts['coordinator']} known to the coordinator"
    )
    with pytest.raises(CountMismatch):
        check_outcome(plan, outcome, in_bag)


def test_truth_that_is_not_all_in_the_bag() -> None:
    plan, outcome, in_bag = made()
    del in_bag["/emulation/plant/truth"]
    with pytest.raises(CountMismatch, match="truth: 2 received by the recorder, 0 in the bag, 2 sent by"):
        check_counts(plan, outcome, {**in_bag})


def test_nobody_sent_what_came() -> None:
    plan, outcome, in_bag = made()
    outcome.leave_notes["/sensor"]["sent"].clear()
    with pytest.raises(CountMismatch, match="0 sent by the publisher"):
        check_counts(plan, outcome, in_bag)


def test_what_a_foreign_node_sent_is_told_by_the_others() -> None:
    plan, outcome, in_bag = made("controller.external=true")
    assert "/controller" not in outcome.leave_notes
    check_outcome(plan, outcome, in_bag)
    outcome.sent["torque_command"] = 4
    with pytest.raises(CountMismatch, match="5 received by the recorder, 5 in the bag, 4 known to the coordinator"):
        check_outcome(plan, outcome, in_bag)


def test_a_run_that_a_watch_has_ended_is_only_held_to_its_order() -> None:
    plan, outcome, in_bag = made()
    halted = replace(outcome, halted="/plant: too fast", sent={**SENT, "torque": 4})
    check_outcome(plan, halted, in_bag)
    halted.leave_notes["/sensor"]["done"] = 0  # type: ignore[index]
    with pytest.raises(OrderMismatch):
        check_outcome(plan, halted, in_bag)


@pytest.mark.parametrize("name", ["/plant", "/sensor", "/controller", "/actuator"])
def test_an_act_that_was_not_laid_down_names_the_node(name: str) -> None:
    plan, outcome, _ = made()
    check_order(plan, outcome)
    other = deepcopy(outcome)
    other.leave_notes[name]["done"] += 1
    with pytest.raises(OrderMismatch, match=f"^node {name}: "):
        check_order(plan, other)
    assert COORDINATOR not in plan.modules


def test_a_value_that_has_changed_on_its_way_names_topic_and_both_ends() -> None:
    plan, outcome, _ = made()
    outcome.leave_notes["/actuator"]["values"]["torque_command"] += 1
    with pytest.raises(OrderMismatch, match=r"^topic /torque_command: /actuator has not received .* /controller sent"):
        check_order(plan, outcome)
