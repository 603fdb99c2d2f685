"""The dispatcher by what comes in: reports that nobody asked for, of another tick, too early; pauses, and halts."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from toy import toy

from etac_ros.errors import ProtocolError
from etac_ros.runs import windows_of
from etac_ros.scenario.load import load
from etac_ros.timing.dispatcher import Call, Command, Dispatcher, Effect, Finished
from etac_ros.timing.duties import Duties
from etac_ros.timing.master import TimeMaster
from etac_ros.timing.orders import Fire, Look, Open, Report
from etac_ros.timing.windows import WindowPolicy


class Driven:
    """A dispatcher of two plants in processes of their own; what it hands out is kept."""

    def __init__(self, folder: Path, length: int = 8, **sensors: dict[str, Any]) -> None:
        graph = toy(folder, sensors or {"a": {"at": [3, 6]}, "b": {"at": [4]}}).build()
        windows = WindowPolicy(length, length)
        self.effects: list[Effect] = []
        self.steps = 0
        self.master = TimeMaster(graph, windows)
        self.dispatcher = Dispatcher(graph, Duties(graph, windows), self.master, self.effects.append, self._on_step)
        self.dispatcher.begin()

    def _on_step(self) -> None:
        self.steps += 1

    def new(self) -> list[Effect]:
        taken, self.effects[:] = self.effects[:], []
        return taken

    def report(self, module: str, report: Report, tick: int, ahead: int | None = None) -> None:
        self.dispatcher.on_report(module, report, tick, ahead)


def test_it_begins_with_windows_and_waits_for_who_looks_at_them(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    opens = [effect for effect in driven.new() if isinstance(effect, Command)]
    assert [(command.module, command.orders) for command in opens] == [
        (name, (Open(name, -1, 8, -1),)) for name in ("/a/ramp", "/b/ramp")
    ]
    assert driven.dispatcher.owing() == ["/a/sensor", "/b/sensor"]
    assert (driven.dispatcher.steps, driven.steps) == (0, 0)
    driven.report("/a/sensor", Report(proposal=3), -1, 3)
    assert driven.dispatcher.owing() == ["/b/sensor"]
    assert driven.new() == []
    driven.report("/b/sensor", Report(proposal=4), -1, 4)
    assert driven.new() == [Command("/a/sensor", (Fire("/a/sensor", 3, 1, False),))]
    assert driven.dispatcher.owing() == ["/a/sensor"]
    assert (driven.dispatcher.steps, driven.steps) == (1, 1)
    assert driven.master.tick == 3
    assert not driven.dispatcher.finished


def test_a_report_that_nobody_asked_for_names_its_node(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.report("/a/sensor", Report(proposal=3), -1, 3)
    with pytest.raises(ProtocolError, match=r"^node /a/sensor: has reported without being asked"):
        driven.report("/a/sensor", Report(proposal=3), -1, 3)


@pytest.mark.parametrize("tick", [-2, 0, 3])
def test_a_report_on_another_tick_names_its_node(tick: int, tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    with pytest.raises(
        ProtocolError, match=rf"^node /a/sensor: has reported on tick {tick} when it was told 'Look' about tick -1"
    ):
        driven.report("/a/sensor", Report(proposal=3), tick, 3)


def test_an_act_at_another_tick_names_its_node(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.report("/a/sensor", Report(proposal=3), -1, 3)
    driven.report("/b/sensor", Report(proposal=4), -1, 4)
    with pytest.raises(ProtocolError, match=r"has reported on tick 4 when it was told 'Fire' about tick 3"):
        driven.report("/a/sensor", Report(("a_says",)), 4, 6)


@pytest.mark.parametrize(
    ("fired", "tick", "good"), [(True, 5, True), (True, 6, True), (True, 7, False), (False, 5, False), (True, 3, False)]
)
def test_with_leave_one_may_report_on_a_later_tick(fired: bool, tick: int, good: bool, tmp_path: Path) -> None:
    dispatcher = Driven(tmp_path).dispatcher
    order = Look("/a/sensor", 4, 6)
    report = Report(("a_says",), tick, fired)
    if good:
        dispatcher._check_tick("/a/sensor", order, report, tick)
    else:
        with pytest.raises(ProtocolError):
            dispatcher._check_tick("/a/sensor", order, report, tick)


def test_nothing_is_handed_out_in_a_pause(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.dispatcher.resume()  # there is none yet
    driven.new()
    driven.dispatcher.pause()
    driven.report("/a/sensor", Report(proposal=3), -1, 3)
    driven.report("/b/sensor", Report(proposal=4), -1, 4)
    assert driven.new() == []
    assert driven.dispatcher.owing() == []
    assert driven.dispatcher.steps == 0
    driven.dispatcher.resume()
    assert driven.new() == [Command("/a/sensor", (Fire("/a/sensor", 3, 1, False),))]
    driven.dispatcher.resume()
    assert driven.new() == []
    assert driven.dispatcher.steps == 1


def test_a_pause_that_ends_while_somebody_owes_changes_nothing(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.dispatcher.pause()
    driven.dispatcher.resume()
    assert driven.dispatcher.steps == 0
    driven.report("/a/sensor", Report(proposal=3), -1, 3)
    driven.report("/b/sensor", Report(proposal=4), -1, 4)
    assert driven.dispatcher.steps == 1


def test_a_halt_while_windows_open_is_not_waited_for_by_who_would_see_them(tmp_path: Path) -> None:
    driven = Driven(tmp_path)
    driven.new()
    driven.dispatcher.on_halt("/b/ramp", Report(halt="too far"))
    assert driven.master.halted == "/b/ramp: too far"
    assert [type(effect) for effect in driven.new()][-1] is Finished
    assert driven.dispatcher.finished
    assert driven.dispatcher.owing() == []
    steps = driven.dispatcher.steps
    driven.dispatcher.pause()
    driven.dispatcher.resume()
    assert driven.dispatcher.steps == steps


def test_a_plant_beside_the_coordinator_is_called() -> None:
    scenario = load("wu2018", None, ["duration_s=1"])
    graph = scenario.build()
    windows = windows_of(scenario)
    effects: list[Effect] = []
    master = TimeMaster(graph, windows)
    dispatcher = Dispatcher(graph, Duties(graph, windows), master, effects.append)
    dispatcher.begin()
    # The only sensor may act at once, up to the sample at which the window ends.
    assert effects == [Call("/plant", Open("/plant", -1, 33, 31))]
    assert dispatcher.owing() == ["/plant", "/sensor"]
    dispatcher.on_obeyed("/plant", Report())
    assert dispatcher.owing() == ["/sensor"]


def test_a_plant_beside_the_coordinator_may_halt_as_it_opens() -> None:
    scenario = load("wu2018", None, ["duration_s=1"])
    graph = scenario.build()
    windows = windows_of(scenario)
    effects: list[Effect] = []
    master = TimeMaster(graph, windows)
    dispatcher = Dispatcher(graph, Duties(graph, windows), master, effects.append)
    dispatcher.begin()
    dispatcher.on_obeyed("/plant", Report(halt="too fast"))
    assert master.halted == "/plant: too fast"
    assert dispatcher.owing() == ["/plant"]  # it has to close
    dispatcher.on_obeyed("/plant", Report(halt="too fast"))
    assert dispatcher.finished
    assert isinstance(effects[-1], Finished)


@pytest.mark.parametrize(("alone", "concludes"), [(True, True), (True, False), (False, True)])
def test_who_always_fires_alike_is_not_heard(alone: bool, concludes: bool) -> None:
    """It sends on the ports of its role, and concludes, where it is alone, on the port that its trigger decides on."""
    module = SimpleNamespace(fires_on=("a", "b", "c"), triggers="b", concludes=concludes)
    links = tuple(SimpleNamespace(name=f"link_{port}", port=port) for port in "dcba")
    dispatcher: Any = object.__new__(Dispatcher)
    dispatcher._graph = SimpleNamespace(modules={"/m": module}, sends={"/m": links})
    concluded = ("link_b",) if alone and concludes else None
    assert dispatcher._fires("/m", alone) == Report(("link_c", "link_b", "link_a"), concluded=concluded)
