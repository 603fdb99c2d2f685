"""Acknowledged links: execution traces computed by hand, and what holds whatever the luck."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_engines_equal import assert_same
from toy import toy

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import RunHalted, ScenarioError
from etac_ros.graph.acknowledged import End, Ended, Event
from etac_ros.graph.channel import Channel
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Context, Module
from etac_ros.graph.recording import Recording
from etac_ros.graph.replay import conversation, deliveries
from etac_ros.graph.wire import WireFormat
from etac_ros.metrics.accounts import LinkAccount, link_accounts, medium_accounts
from etac_ros.metrics.decisions import decisions, margins
from etac_ros.modules.hold import Hold
from etac_ros.modules.sensing_controller import SensingController
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.timing.windows import WindowPolicy

BRAKE, LISTENER = "/b/brake", "/a/sensor"


def run_of(folder: Path, at: list[int], media: Any = None, ticks: int = 30, **says: Any) -> tuple[Graph, Recording]:
    """A run of ticks of 0.1 s in which /b/sensor says something at given ticks, to /a/sensor and /b/brake."""
    graph = toy(folder, {"b": {"at": at}}, duration_ticks=ticks, media=media, b_says=says).build()
    return graph, InProcess(graph).run()


def told(graph: Graph, recording: Recording, link: str = "b_says") -> list[str]:
    """What happened on a link, as ``time [s] #message what``."""
    return [words(event) for event in conversation(graph, recording, graph.links[link])]


def words(event: Event) -> str:
    what = event.end.value if isinstance(event, Ended) else f"at {event.receiver}"
    return f"{event.at_ns / 1e9:g} #{event.sequence} {what}"


def account(graph: Graph, recording: Recording) -> LinkAccount:
    return link_accounts(graph, recording)["b_says"]


def lose(monkeypatch: pytest.MonkeyPatch, lost: set[tuple[str, int, int, bool]]) -> None:
    """Lose these and no others: receiver, message, attempt, and whether it is the acknowledgement."""

    def takes(self: Channel, receiver: str, sequence: int, tick: int, attempt: int = 1, *, back: bool = False) -> bool:
        return (receiver, sequence, attempt, back) in lost

    monkeypatch.setattr(Channel, "takes", takes)


def test_a_trace_by_hand_over_a_link_with_a_delay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # A tick there and a tick back. /b/brake alone acknowledges; a try is repeated 0.3 s after it, two times at most.
    lost = {
        (BRAKE, 1, 1, False), (BRAKE, 1, 2, True),  # the first try, and the acknowledgement of the second
        *((BRAKE, 2, attempt, False) for attempt in (1, 2, 3)),
        (BRAKE, 3, 1, False), (LISTENER, 3, 1, False),
    }  # fmt: skip
    lose(monkeypatch, lost)
    answers = {"timeout_s": 0.3, "retries": 2, "by": ["b/brake"], "bytes": 5}
    graph, recording = run_of(tmp_path, [2, 12, 22, 23], delay_ticks=1, loss=0.5, acknowledged=answers)
    assert told(graph, recording) == [
        "0.3 #1 at /a/sensor",  # of the first try at 0.2 s
        "0.6 #1 at /b/brake",  # of the second at 0.5 s, whose acknowledgement is lost
        "1 #1 acknowledged",  # of the third at 0.8 s: it is known already, and acknowledged again
        "1.3 #2 at /a/sensor",
        "2.1 #2 given up",  # 0.3 s after the third try at 1.8 s
        "2.3 #3 superseded",  # by the fourth, before it is tried again
        "2.4 #4 at /a/sensor",
        "2.4 #4 at /b/brake",
        "2.5 #4 acknowledged",
    ]
    tries = [(fate.sequence, fate.attempt, fate.start_ns // 10**8) for fate in recording.air if fate.link == "b_says"]
    assert tries == [(1, 1, 2), (1, 2, 5), (1, 3, 8), (2, 1, 12), (2, 2, 15), (2, 3, 18), (3, 1, 22), (4, 1, 23)]
    found = account(graph, recording)
    assert (found.sent, found.delivered, found.lost, found.dropped) == (8, 5, 0, 0)
    assert (found.given_up, found.superseded, found.under_way, found.duplicated, found.overtaken) == (1, 2, 0, 0, 0)
    assert found.acknowledgement is not None
    assert found.acknowledgement.model_dump() == {
        "acknowledged": 2, "retransmitted": 4, "acknowledgements": 3, "acknowledgement_bytes": 15,
    }  # fmt: skip
    assert [(one.tick, one.message.sequence) for one in deliveries(graph, recording, graph.links["b_says"], BRAKE)] == [
        (6, 1), (24, 4),
    ]  # fmt: skip


def test_a_trace_by_hand_over_a_medium(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # 200 bit/s: a frame of 4 bytes takes 0.16 s, an acknowledgement of 2 takes 0.08 s. Both receivers acknowledge.
    lose(monkeypatch, {(BRAKE, 1, 1, False)})
    answers = {"timeout_s": 0.2, "retries": 1, "by": "all", "bytes": 2}
    media = {"air": {"rate_bit_s": 200.0}}
    graph, recording = run_of(tmp_path, [0, 10], media, medium="air", loss=0.5, acknowledged=answers)
    on_air = [
        (fate.link, fate.sequence, fate.attempt, fate.start_ns / 1e9, fate.end_ns / 1e9) for fate in recording.air
    ]
    assert on_air == [
        ("b_says", 1, 1, 0.0, 0.16), ("b_says<-1", 1, 1, 0.16, 0.24),
        # Time is up at 0.36 s: both get it, one of them again.
        ("b_says", 1, 2, 0.36, 0.52), ("b_says<-1", 1, 2, 0.52, 0.6), ("b_says<-2", 1, 2, 0.6, 0.68),
        ("b_says", 2, 1, 1.0, 1.16), ("b_says<-1", 2, 1, 1.16, 1.24), ("b_says<-2", 2, 1, 1.24, 1.32),
    ]  # fmt: skip
    assert told(graph, recording) == [
        "0.16 #1 at /a/sensor",
        "0.52 #1 at /b/brake",
        "0.68 #1 acknowledged",
        "1.16 #2 at /a/sensor",
        "1.16 #2 at /b/brake",
        "1.32 #2 acknowledged",
    ]
    # What lands between two ticks is there at the later one.
    assert [one.tick for one in deliveries(graph, recording, graph.links["b_says"], BRAKE)] == [6, 12]
    medium = medium_accounts(graph, recording)["air"]
    assert (medium.frames, medium.payload_bytes, medium.overhead_bytes, medium.acknowledgement_bytes) == (8, 12, 0, 10)
    assert medium.air_time_s == pytest.approx(3 * 0.16 + 5 * 0.08)


def test_any_of_several_is_enough_where_the_scenario_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lose(monkeypatch, {(BRAKE, 1, attempt, False) for attempt in (1, 2)})
    answers = {"timeout_s": 0.3, "by": "any"}
    graph, recording = run_of(tmp_path, [2], delay_ticks=1, loss=0.5, acknowledged=answers)
    assert told(graph, recording) == ["0.3 #1 at /a/sensor", "0.4 #1 acknowledged"]
    found = account(graph, recording)
    assert (found.sent, found.delivered, found.lost) == (2, 1, 1)


def test_what_is_still_tried_at_the_end_is_under_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    lose(monkeypatch, {(BRAKE, 1, attempt, False) for attempt in range(9)})
    answers = {"timeout_s": 0.3, "by": "all"}
    graph, recording = run_of(tmp_path, [27], delay_ticks=1, loss=0.5, acknowledged=answers)
    found = account(graph, recording)
    assert (found.sent, found.delivered, found.under_way) == (2, 1, 1)


def test_a_run_can_end_with_the_last_try(tmp_path: Path) -> None:
    answers = {"timeout_s": 0.3, "retries": 1, "after_last": "halt"}
    link = {"outages": {"/controller": [0.0, 9.0]}, "acknowledged": answers}
    scenario = load("wu2018", None, ["duration_s=20", f"links.filtered_error={link}"])
    with pytest.raises(RunHalted, match=r"0\.625 s: /sensor: message 1 on filtered_error is not acknowledged after 2"):
        run_in_process(scenario)


LOSSES = st.floats(0.05, 0.8)


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    loss=LOSSES,
    at=st.lists(st.integers(0, 25), max_size=12, unique=True),
    delay=st.integers(0, 2),
    medium=st.booleans(),
    timeout=st.sampled_from([0.4, 0.45, 0.8]),
    by=st.sampled_from(["all", "any", ["b/brake"]]),
    full=st.sampled_from(["newest", "oldest", "replace"]),
)
def test_whatever_the_luck(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int, loss: float, at: list[int], delay: int, medium: bool, timeout: float, by: Any, full: str,
) -> None:  # fmt: skip
    """Conservation, each message at most once and never an older one, and the same whatever the windows are."""
    answers = {"timeout_s": timeout, "retries": 2, "by": by, "bytes": 1}
    says = {"loss": loss, "delay_ticks": delay, "acknowledged": answers, **({"medium": "air"} if medium else {})}
    others = {**says, "delay_ticks": 1, "acknowledged": {**answers, "by": "all"}}
    media = {"air": {"rate_bit_s": 400.0, "queue": {"length": 1, "full": full}}} if medium else None
    folder = tmp_path_factory.mktemp("toy")
    sensors = {"a": {"at": [3, 4, 9]}, "b": {"at": sorted(at)}}
    scenario = toy(folder, sensors, duration_ticks=30, media=media, b_says=says, a_says=others)
    scenario = replace(scenario, run=scenario.run.model_copy(update={"seed": seed}))
    graph = scenario.build()
    recording = InProcess(graph).run()
    link_accounts(graph, recording)  # raises where a message is nowhere
    for link in graph.acknowledged:
        ends: dict[int, End] = {}
        for event in conversation(graph, recording, link):
            if isinstance(event, Ended):
                assert event.sequence not in ends
                ends[event.sequence] = event.end
        for receiver in link.receivers:
            taken = [one.message.sequence for one in deliveries(graph, recording, link, receiver)]
            assert taken == sorted(set(taken))
        # What a sensor has heard stands in what it says: the replay has counted the same.
        for message in recording.messages[f"{link.name[0]}_says"]:
            other = graph.links["b_says" if link.name == "a_says" else "a_says"]
            heard = [one for one in deliveries(graph, recording, other, link.sender) if one.tick < message.tick]
            assert message.value[0] // 1000 == len(heard)
    assert_same(InProcess(scenario.build(), WindowPolicy(1, 2)).run(), recording)


class Above:
    """Fires where the signal has moved by one from what is held."""

    def first(self, signals: np.ndarray, tick: int, held: np.ndarray, held_tick: int) -> int:
        self.asked = float(held[0]), held_tick
        fires = np.abs(signals[:, 0] - held[0]) >= 1.0
        return int(np.argmax(fires)) if fires.any() else -1


def hold(*acknowledged: str) -> tuple[Hold, Above]:
    module = Module(Context("/m", 10, 0, formats={"": WireFormat.DOUBLE}, acknowledged=frozenset(acknowledged)))
    module.outputs = {"signal": 1}
    rule = Above()
    return Hold(module, "signal", rule), rule


def test_a_rule_compares_with_what_was_acknowledged() -> None:
    rows = np.array([[0.0], [1.0], [2.0], [3.0]])
    found, rule = hold("signal")
    assert found.first(rows, 0) == 0
    found.send(rows[0], 0)
    assert found.first(rows[1:], 1) is None, "it waits"
    found.settle(1, acknowledged=False)
    assert found.first(rows[2:], 2) == 2, "the other side holds nothing yet: the first sample is always sent"
    found.send(rows[2], 2)
    found.settle(2, acknowledged=True)
    assert found.first(rows[3:], 3) == 3
    assert rule.asked == (2.0, 2)
    found.send(rows[3], 3)
    found.settle(5, acknowledged=False)
    assert found.first(np.array([[2.5]]), 6) is None, "it fits what was acknowledged, not what was sent"
    assert rule.asked == (2.0, 2)


def test_where_nothing_is_told_a_rule_compares_with_what_was_sent() -> None:
    found, rule = hold()
    found.send(np.array([5.0]), 0)
    assert found.first(np.array([[5.5]]), 1) is None
    assert rule.asked == (5.0, 0)


def test_a_sensor_does_not_repeat_itself_while_it_waits_and_does_when_nobody_has_heard() -> None:
    # Nothing gets through for 2 s. Two tries take 1 s, then the rule is asked again: at 1 s, and at 2 s.
    answers = {"timeout_s": 0.5, "retries": 1}
    link = {"outages": {"/controller": [0.0, 2.0]}, "acknowledged": answers}
    for compares, expected in (("acknowledged", [0, 33, 66]), ("sent", [0])):
        link["acknowledged"] = {**answers, "compares_with": compares}
        recording = InProcess(load("wu2018", None, ["duration_s=3", f"links.filtered_error={link}"]).build()).run()
        sent = [message.tick for message in recording.messages["filtered_error"]]
        assert sent == expected


REFUSED = {
    "a broadcast without a rule for whom": (
        "xie2021", ["links.state={loss: 0.1, acknowledged: {timeout_s: 0.1}}"],
        r"links\.sc1_state\.acknowledged\.by: is missing, and /sc2/sensor, .* receive this link\n.*all, any, or a list",
    ),
    "somebody who does not hear it": (
        "wu2018", ["links.filtered_error.acknowledged={timeout_s: 0.1, by: [actuator]}"],
        r"filtered_error\.acknowledged\.by: /actuator does not receive this link",
    ),
    "nobody": (
        "wu2018", ["links.filtered_error.acknowledged={timeout_s: 0.1, by: []}"],
        r"filtered_error\.acknowledged\.by: names nobody",
    ),
    "a rule that is none": (
        "wu2018", ["links.torque_command.acknowledged={timeout_s: 0.1, compares_with: acknowledged}"],
        r"torque_command\.acknowledged\.compares_with: no trigger rule decides .*\n.*compares_with: sent",
    ),
    "a rule that goes by the time": (
        "wu2018",
        ["sensor.trigger={class: 'etac_ros.triggers.periodic:Periodic', period_s: 1.0}",
         "links.filtered_error.acknowledged={timeout_s: 0.1, compares_with: acknowledged}"],
        r"compares_with: its rule goes by the time",
    ),
    "less time than an acknowledgement takes": (
        "wu2018", ["links.filtered_error={delay_ticks: 2, acknowledged: {timeout_s: 0.12}}"],
        r"timeout_s: found 0\.12, and an acknowledgement takes 0\.125 s\n.*that time or more",
    ),
    "acknowledgements without bytes": (
        "wu2018",
        ["media={air: {rate_bit_s: 1000.0}}",
         "links.filtered_error={medium: air, acknowledged: {timeout_s: 0.5}}"],
        r"media\.air\.overhead: 'none' has no acknowledgements.*\n.*links\.filtered_error\.acknowledged\.bytes",
    ),
    "duplicates": (
        "wu2018", ["links.filtered_error={duplication: 0.5, acknowledged: {timeout_s: 0.5}}"], "leave duplication out",
    ),
    "light": (
        "wu2018", ["links.torque={acknowledged: {timeout_s: 0.5}}"], "nobody acknowledges light or torque",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", list(REFUSED))
def test_what_is_refused_with_a_remedy(case: str) -> None:
    name, overrides, words = REFUSED[case]
    with pytest.raises(ScenarioError, match=words):
        load(name, None, overrides)


@pytest.mark.parametrize("variant", ["fitted", "events"])
def test_a_law_that_changes_at_events_is_replayed_with_those_of_the_run(variant: str) -> None:
    link = {"loss": 0.4, "acknowledged": {"timeout_s": 0.02, "retries": 0}}
    scenario = load("shi2022", variant, ["duration_s=5", f"links.torque_command={link}"])
    graph = scenario.build()
    assert graph.told == {"/controller"}
    recording = InProcess(graph).run()
    found = decisions(scenario.build(), recording, "/controller")
    assert found is not None
    assert len(found.ticks) > 10
    # Each event renews a component at least; the others stay as the other side is known to hold them.
    same = np.isclose(found.rows[found.ticks], found.held, rtol=1e-6, atol=1e-9)
    assert same.any(axis=1).all()
    for place, column in zip(*np.nonzero(~same), strict=True):
        assert found.held[place, column] in found.held[:place, column]
    assert margins(graph, found, "/controller") is None
    module = scenario.build().modules["/controller"]
    assert isinstance(module, SensingController)
    with pytest.raises(ValueError, match="give the events"):
        module.memories(recording.samples("/plant")[1], 0)
