"""A run as it happens: what is shown adds up to what the run comes to, fits the terminal, and changes nothing."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.cells import cell_len
from rich.console import Console

from etac_ros import runs
from etac_ros.bag.contents import Contents
from etac_ros.bag.monitor import PLACES, AirTraffic, Flow, Monitor, Outlet, Picture
from etac_ros.cli.screen import Screen
from etac_ros.cli.view import ASCII_BLOCKS, BLOCKS, View, lines, plain, sparkline
from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.runs import RosOptions, run_in_process, run_over_ros
from etac_ros.scenario.load import Scenario, load

STALL = "faults.hang={at_s: 4.0, node: /pm/controller, do: stall, for_s: 2.0}"
SCENARIOS = {
    "wu2018": load("wu2018", None, ["duration_s=30"]),
    "radio": load("xie2021", "radio", ["duration_s=3"]),
    "stall": load("qi2022", None, ["duration_s=8", STALL]),
}


def agrees(picture: Picture, scenario: Scenario, summary: Any) -> None:
    assert picture.tick == scenario.graph.end_tick
    assert picture.fired == {name: trigger.count for name, trigger in summary.triggers.items()}
    links = {link.name: link for link in scenario.graph.links.values()}
    for name, flow in picture.flows.items():
        topic = summary.topics[links[name].topic]
        found = flow.messages, flow.payload_bytes, flow.cdr_bytes
        if topic.kind != "emulation":
            assert found == (topic.messages, topic.payload_bytes, topic.cdr_bytes)
        assert flow.messages == topic.messages


@pytest.mark.parametrize("name", SCENARIOS)
def test_by_calls_the_last_picture_is_the_summary_and_the_bits_are_those_of_a_run_that_nobody_watches(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runs, "EVERY_S", 0.0)
    scenario = SCENARIOS[name]
    pictures: list[Picture] = []
    ticks: list[int] = []

    def take(picture: Picture) -> None:
        pictures.append(picture)
        ticks.append(picture.tick)

    watched = run_in_process(scenario, on_picture=take)
    assert watched.recording.digest() == run_in_process(scenario).recording.digest()
    last = pictures[-1]
    agrees(last, scenario, watched.summary)
    assert ticks == sorted(ticks)
    for plant, performance in watched.summary.performance.items():
        assert last.errors_deg[plant] == pytest.approx(performance.attitude_error_deg, rel=1e-12)
        assert np.isfinite(last.histories_deg[plant]).all()
    for medium, account in watched.summary.media.items():
        air = last.air[medium]
        assert air.frames + air.collided == account.frames
        assert air.lost == account.given_up + account.dropped
        assert air.busy_ns / 1e9 == pytest.approx(account.air_time_s)


def test_over_dds_the_recorder_tells_the_same(tmp_path: Path) -> None:
    pictures: list[Picture] = []
    scenario = load("wu2018", None, ["duration_s=30", "truth_every=7"])  # thinned in the bag, and not for who looks
    run = run_over_ros(scenario, tmp_path / "bag", RosOptions("one"), on_picture=pictures.append)
    agrees(pictures[-1], scenario, run.summary)
    assert np.isfinite(pictures[-1].histories_deg["/plant"]).all()
    assert pictures[-1].errors_deg["/plant"] == pytest.approx(run.summary.performance["/plant"].attitude_error_deg)
    assert run.recording.digest() == run_in_process(scenario).recording.digest()


def test_what_viewers_are_shown_by_calls_is_what_a_bag_has(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[tuple[str, bytes, int]] = []

    class Remembers:
        def __init__(self, *arguments: Any) -> None: ...

        def show(self, topic: str, cdr: bytes, log_time_ns: int) -> None:
            shown.append((topic, cdr, log_time_ns))

        def close(self) -> None:
            shown.append(("closed", b"", 0))

    monkeypatch.setattr(runs, "EVERY_S", 0.0)
    monkeypatch.setattr(runs, "LiveView", Remembers)
    run_in_process(SCENARIOS["radio"], tmp_path / "bag", live=0)
    assert shown.pop()[0] == "closed"
    written = [(m.topic.name, m.cdr, m.log_time_ns) for m in Contents(tmp_path / "bag" / "bag_0.mcap").messages()]

    def kept(messages: list[tuple[str, bytes, int]]) -> list[tuple[str, bytes, int]]:
        return [one for one in messages if not one[0].startswith(("/state", "/tf", "/emulation/air"))]

    assert kept(shown) == kept(written)
    for topic in ("/state/sc1/plant/attitude", "/state/sc1/plant/torque", "/tf"):
        # Batches differ, in which the plants of /tf take turns; contents do not.
        assert sorted(one[1:] for one in shown if one[0] == topic) == sorted(
            one[1:] for one in written if one[0] == topic
        )


@given(
    name=st.sampled_from(sorted(SCENARIOS)),
    size=st.sampled_from([(80, 24), (100, 40), (160, 12), (20, 5)]),
    count=st.integers(0, 10**6),
    share=st.floats(0.0, 1.0),
    error=st.sampled_from([float("nan"), 0.0, 1e-12, 179.9]),
    blocks=st.sampled_from([BLOCKS, ASCII_BLOCKS]),
)
def test_no_line_is_wider_than_the_terminal_and_none_is_too_many(
    name: str, size: tuple[int, int], count: int, share: float, error: float, blocks: str
) -> None:
    graph = SCENARIOS[name].graph
    view = made_up(graph, count, share, error)
    width, height = size
    shown = lines(view, width, height, blocks)
    assert len(shown) <= height
    assert max(map(cell_len, shown)) <= width
    assert "\n" not in "".join(shown)
    if width >= 80:
        assert not any("…" in line for line in shown)
        network = [link.topic for link in graph.links.values() if link.kind is LinkKind.NETWORK]
        assert [topic for topic in network if not any(line.startswith(topic) for line in shown)] == [] or height < 24
    assert plain(view).startswith("title: ")


def test_narrow_terminals_lose_columns_before_they_lose_names() -> None:
    graph = SCENARIOS["stall"].graph
    view = made_up(graph, 10**6, 0.5, 1.0)
    narrow, wide = lines(view, 64, 40), lines(view, 100, 40)
    for link in graph.links.values():
        assert any(line.startswith(f"{link.topic} ") for line in narrow)
    assert [any("CDR" in line for line in shown) for shown in (narrow, wide)] == [False, True]


def made_up(graph: Graph, count: int, share: float, error: float) -> View:
    picture = Picture(
        tick=int(share * graph.end_tick),
        flows={name: Flow(count, 12 * count, 16 * count, graph.end_tick - 1) for name in graph.links},
        fired={name: count for name, module in graph.modules.items() if module.triggers},
        errors_deg=dict.fromkeys(graph.plants, error),
        histories_deg={name: np.full(PLACES, error) for name in graph.plants},
        air={name: AirTraffic(count, count, count, count, count, count) for name in graph.media},
    )
    return View("title", graph, picture, 1234.5)


def test_what_there_is_no_room_for_is_added_up() -> None:
    view = made_up(SCENARIOS["radio"].graph, 5, 0.5, 1.0)
    shown = lines(view, 100, 16)
    topics = [line for line in shown if line.startswith("/") and "  5  " in line]
    (rest,) = [line for line in shown if line.startswith("and ")]
    left_out = len(view.graph.links) - len(topics)
    assert rest == f"and {left_out} more topics, {5 * left_out} messages"


def test_a_fault_is_told_when_it_comes() -> None:
    graph = SCENARIOS["stall"].graph

    def told(share: float) -> list[str]:
        return [line for line in lines(made_up(graph, 1, share, 1.0), 80, 40) if "hang" in line]

    words = "/pm/controller stands still from 4 s on, until 6 s (hang)"
    assert told(0.4) == []
    assert told(0.6) == [f"! {words}"]
    assert told(0.9) == [f"  {words}"]
    assert words in plain(made_up(graph, 1, 0.6, 1.0))


def test_a_curve_goes_by_decades() -> None:
    assert sparkline(np.array([1e2, 1e1, 1.0, 1e-1]), 4, "0123") == "3210"
    assert sparkline(np.array([100.0, 50.0]), 2, "0123") == "33"
    assert sparkline(np.array([np.nan, 1.0, np.nan, np.nan]), 4, "0123") == " 3"
    assert sparkline(np.full(3, np.nan), 3) == sparkline(np.ones(3), 0) == ""


def test_pictures_that_nobody_takes_hold_up_nobody() -> None:
    taken: list[Picture] = []
    outlet = Outlet(taken.append)
    assert outlet.take is not None
    for tick in range(10_000):
        outlet.take(Picture(tick))
    outlet.after(lambda tick, fired: None)(0, {})
    (picture,) = taken
    assert picture.tick > 0
    outlet.close()
    outlet.take(Picture())
    nobody = Outlet(None)
    assert nobody.take is None
    nobody.hand_on()


@pytest.mark.parametrize("width", [80, 100, 160])
def test_a_screen_draws_in_its_place(width: int) -> None:
    console = Console(file=io.StringIO(), force_terminal=True, width=width, height=30, color_system=None)
    scenario = SCENARIOS["radio"]
    with Screen(console, "radio", scenario.graph, pytest.fail) as screen:
        screen.show(made_up(scenario.graph, 7, 0.5, 1.0).picture)
        screen.say_state("over")
    assert isinstance(console.file, io.StringIO)
    frames = console.file.getvalue()
    assert frames.index("radio: 0.0 of 3 s simulated, joining") < frames.index("radio: 1.5 of 3 s simulated, over")
    assert all(cell_len(line.split("\x1b[2K")[-1].split("\r")[-1]) <= width for line in frames.split("\n"))


def test_without_a_terminal_it_is_said_and_a_quiet_one_says_nothing() -> None:
    said: list[str] = []
    graph = SCENARIOS["wu2018"].graph
    for quiet in (False, True):
        with Screen(Console(file=io.StringIO(), quiet=quiet), "wu2018", graph, said.append) as screen:
            screen.show(made_up(graph, 7, 0.5, 1.0).picture)
    assert said == ["wu2018: 15.0 of 30 s simulated, error 1 deg, 7 triggers, 14 messages and 168 B on the network"]


def test_what_is_no_message_of_the_run_is_no_matter_to_a_monitor() -> None:
    monitor = Monitor(SCENARIOS["wu2018"].graph)
    monitor.show("/state/plant/attitude", b"", 0)
    monitor.committed("/plant", 0, np.empty((0, 7)))
    assert monitor.picture.tick == 0
