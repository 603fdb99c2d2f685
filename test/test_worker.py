"""A module's side of the protocol by what comes in: nothing is done before all that it needs is here."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from toy import toy

from etac_ros.errors import ProtocolError
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Window
from etac_ros.scenario.load import load
from etac_ros.timing.duties import Duties
from etac_ros.timing.orders import Close, Deliver, Fire, Look, MessageId, Open, Report
from etac_ros.timing.windows import WindowPolicy
from etac_ros.timing.worker import Commit, Effect, ModuleWorker, Obeyed, Offer, PlantWorker, Send, Tell, Waiting


def ramp(start: int, count: int, epoch: int, plant: str = "/a/ramp") -> Window:
    return Window(plant, epoch, start, np.arange(start, start + count, dtype=float)[:, np.newaxis])


class Driven:
    """The worker of ``/a/sensor`` of the toy system; what it does is kept."""

    def __init__(self, folder: Path, name: str = "/a/sensor", **changes: Any) -> None:
        sensors = {"a": {"at": changes.pop("at", [3, 9])}, "b": {"at": [4]}}
        self.graph: Graph = toy(folder, sensors, **changes).build()
        self.effects: list[Effect] = []
        kind = PlantWorker if name in self.graph.plants else ModuleWorker
        self.worker: Any = kind(self.graph, Duties(self.graph, WindowPolicy(8, 8)), name, self.effects.append)

    def new(self) -> list[Effect]:
        taken, self.effects[:] = self.effects[:], []
        return taken

    def said(self) -> list[Any]:
        """What is new, arrays as numbers and links as names."""
        return [
            ("send", effect.link.name, effect.value.tolist(), effect.tick) if isinstance(effect, Send) else effect
            for effect in self.new()
        ]


def test_a_window_is_looked_at_at_once(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    assert driven.worker.is_idle()
    driven.worker.on_window(ramp(0, 8, 1), -1)
    assert driven.said() == [Tell(Report(proposal=3), -1, 3)]
    assert driven.worker.is_idle()


def test_leave_to_act_is_used_up_to_its_tick(tmp_path: Path) -> None:
    for grant, fires in ((2, False), (3, True), (5, True)):
        driven = Driven(tmp_path)
        driven.worker.on_window(ramp(0, 8, 1), grant)
        said = driven.said()
        assert (("send", "a_says", [3.0], 3) in said) == fires
        # What it acts on next lies beyond the window: it has nothing to name.
        wanted = Tell(Report(("a_says",), 3, True), 3, None) if fires else Tell(Report(proposal=3), -1, 3)
        assert said[-1] == wanted


def test_an_order_waits_for_the_window_that_was_opened_before_it(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.worker.on_orders([Fire("/a/sensor", 3, 1)])
    assert driven.new() == []
    assert not driven.worker.is_idle()
    assert driven.worker.waits_for() == Waiting((), 1)
    driven.worker.on_window(ramp(0, 8, 1), -1)
    assert driven.said() == [
        Tell(Report(proposal=3), -1, 3),
        ("send", "a_says", [3.0], 3),
        Tell(Report(("a_says",)), 3, None),
    ]
    assert driven.worker.is_idle()
    assert driven.worker.waits_for() == Waiting()


def test_a_window_waits_for_the_order_that_was_given_before_it(tmp_path: Path) -> None:
    """The window from tick 4 on tells that tick 3 is over: the order to act at 3 has to come first."""
    driven = Driven(tmp_path)
    driven.worker.on_window(ramp(0, 8, 1), -1)
    driven.new()
    driven.worker.on_window(ramp(4, 8, 2), -1)
    assert driven.new() == []
    assert not driven.worker.is_idle()
    driven.worker.on_orders([Fire("/a/sensor", 3, 1)])
    assert driven.said() == [
        ("send", "a_says", [3.0], 3),
        Tell(Report(("a_says",)), 3, None),
        Tell(Report(proposal=9), 3, 9),
    ]


def test_a_window_that_begins_with_the_named_tick_or_before_is_seen(tmp_path: Path) -> None:
    """The plant's input changed meanwhile: the samples from here on are new."""
    for start in (2, 3):
        driven = Driven(tmp_path)
        driven.worker.on_window(ramp(0, 8, 1), -1)
        driven.new()
        driven.worker.on_window(ramp(start, 8, 2), -1)
        assert driven.said() == [Tell(Report(proposal=3), start - 1, 3)]


def test_a_message_waits_for_the_order_to_take_it_and_the_order_for_the_message(tmp_path: Path) -> None:
    link, value = "b_says", np.array([5.0])
    for message_first in (True, False):
        driven = Driven(tmp_path)
        driven.worker.on_window(ramp(0, 8, 1), -1)
        driven.new()
        order = Deliver("/a/sensor", 2, 1, (MessageId(link, 1),), 1)
        if message_first:
            driven.worker.on_message(driven.graph.links[link], 1, value)
            assert driven.worker.waits_for() == Waiting()
            assert driven.worker.is_idle()
        else:
            driven.worker.on_orders([order])
            assert driven.worker.waits_for() == Waiting((MessageId(link, 1),), 1)
        assert driven.new() == []
        if message_first:
            driven.worker.on_orders([order])
        else:
            driven.worker.on_message(driven.graph.links[link], 1, value)
        assert driven.said() == [Tell(Report(), 2, 3)]
        assert driven.worker.is_idle()


def test_a_lost_message_is_not_waited_for_and_its_value_is_known(tmp_path: Path) -> None:
    driven = Driven(tmp_path, b_says={"loss": 0.5})
    link = driven.graph.links["b_says"]
    lost = next(number for number in range(1, 50) if link.channel.drops("/a/sensor", number))
    before = driven.worker.values["b_says"]
    driven.worker.on_message(link, lost, np.array([5.0]))
    assert driven.worker.values["b_says"] != before
    driven.worker.on_window(ramp(0, 8, 1), -1)
    driven.new()
    driven.worker.on_orders([Deliver("/a/sensor", 2, 1, (MessageId("b_says", lost),), 1)])
    assert driven.new() == []  # no master orders that; it would wait for ever
    assert driven.worker.waits_for().messages == (MessageId("b_says", lost),)


def test_a_look_is_obeyed_in_its_turn(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.worker.on_window(ramp(0, 12, 1), -1)
    driven.new()
    driven.worker.on_orders([Look("/a/sensor", 3, -1), Look("/a/sensor", 3, 9)])
    assert driven.said() == [
        Tell(Report(proposal=9), 3, 9),
        ("send", "a_says", [9.0], 9),
        Tell(Report(("a_says",), 9, True), 9, None),
    ]


def test_what_answers_needs_no_window_and_tells_nobody(tmp_path: Path) -> None:
    driven = Driven(tmp_path, "/a/brake")
    assert not driven.worker.wants_stamps
    driven.worker.on_message(driven.graph.links["a_says"], 1, np.array([5.0]))
    assert driven.said() == [("send", "a_push", [-0.5], 0)]
    assert driven.worker.done != 0


def test_who_sees_a_plant_and_acts_on_arrival_takes_the_sample_of_the_message() -> None:
    scenario = load("qi2022", None, ["duration_s=0.5", "links.torque_p.wire=stamped"])
    name = "/pm/relative_sensor"
    graph = scenario.build()
    worker = ModuleWorker(graph, Duties(graph, WindowPolicy(1, 1)), name, lambda effect: None)
    assert worker.wants_stamps
    assert not ModuleWorker(graph, Duties(graph, WindowPolicy(1, 2)), name, lambda effect: None).wants_stamps
    width = graph.modules[graph.reads[name]].state.size  # type: ignore[attr-defined]
    assert not worker._has_sample(0)
    worker.on_window(Window(graph.reads[name], 1, 5, np.zeros((1, width))), -1)
    assert not worker._has_sample(6)
    assert worker._has_sample(5)
    with pytest.raises(ProtocolError, match=rf"node {name}: a message of tick 4 came after the window that begins"):
        worker._has_sample(4)


def test_a_plant_opens_commits_and_closes(tmp_path: Path) -> None:
    driven = Driven(tmp_path, "/a/ramp")
    driven.worker.on_orders([Open("/a/ramp", -1, 4, 7)])
    offer, obeyed = driven.new()
    assert isinstance(offer, Offer)
    assert (offer.window.start, offer.window.samples.ravel().tolist(), offer.grant) == (0, [0.0, 1.0, 2.0, 3.0], 7)
    assert obeyed == Obeyed(Report())
    push = driven.graph.links["a_push"]
    driven.worker.on_orders([Deliver("/a/ramp", 2, 1, (MessageId("a_push", 1),)), Open("/a/ramp", 2, 2, -1)])
    assert driven.new() == []
    assert driven.worker.waits_for().messages == (MessageId("a_push", 1),)
    driven.worker.on_message(push, 1, np.array([-0.5]))
    commit, offer, obeyed = driven.new()
    assert isinstance(commit, Commit)
    assert (commit.first_tick, commit.samples.ravel().tolist()) == (0, [0.0, 1.0, 2.0])
    assert isinstance(offer, Offer)
    assert (offer.window.start, offer.window.samples.ravel().tolist(), offer.grant) == (3, [2.5, 3.0], -1)
    assert not driven.worker.closed
    driven.worker.on_orders([Close("/a/ramp", 3)])
    commit, obeyed = driven.new()
    assert isinstance(commit, Commit)
    assert (commit.first_tick, commit.samples.ravel().tolist()) == (3, [2.5])
    assert driven.worker.closed


def test_orders_for_others_are_refused(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    with pytest.raises(TypeError, match="/a/sensor is no plant"):
        driven.worker.on_orders([Close("/a/sensor", 3)])
    plant = Driven(tmp_path, "/a/ramp")
    with pytest.raises(TypeError, match="/a/ramp is a plant"):
        plant.worker.on_orders([Look("/a/ramp", 3, -1)])


def test_digests_tell_of_every_act_and_every_value(tmp_path: Path) -> None:
    def after(*, tick: int = 3, value: float = 5.0) -> tuple[Any, ...]:
        driven = Driven(tmp_path, at=[3, 4])
        driven.worker.on_window(ramp(0, 8, 1), -1)
        driven.worker.on_orders([Fire("/a/sensor", tick, 1)])
        driven.worker.on_message(driven.graph.links["b_says"], 1, np.array([value]))
        return driven.worker.done, driven.worker.values["b_says"], driven.worker.sent_values["a_says"]

    assert after() == after()
    assert after()[0] != after(tick=4)[0]
    assert after()[1] != after(value=5.5)[1]
    assert after()[2] != after(tick=4)[2]
    assert 0 not in after()
