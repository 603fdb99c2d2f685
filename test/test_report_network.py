"""The communication graph of a report: an edge for each sender and receiver, with what was delivered."""

from __future__ import annotations

from pathlib import Path

import pytest

from etac_ros.report.figures import network
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import rendered
from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def view_of(folder: Path, name: str, variant: str | None, *overrides: str) -> View:
    bag = folder / f"{name}_{variant}"
    run_in_process(load(name, variant, overrides), bag)
    return View(read_run(bag))


def test_edges_of_a_formation_are_its_graph_with_deliveries(tmp_path: Path) -> None:
    view = view_of(tmp_path, "xie2021", None, "duration_s=2")
    triggers = view.run.summary.triggers
    counts = {number: triggers[f"/sc{number}/sensor"].count for number in (1, 2, 3)}
    assert network.edges(view) == {
        ("/sc1", "/sc2"): counts[1],
        ("/sc1", "/sc3"): counts[1],
        ("/sc1", "/sc4"): counts[1],
        ("/sc2", "/sc3"): counts[2],
        ("/sc3", "/sc1"): counts[3],
        ("/sc3", "/sc2"): counts[3],
    }
    assert sum(network.edges(view).values()) == view.run.summary.network.deliveries


def test_what_is_lost_or_down_is_not_delivered(tmp_path: Path) -> None:
    down = 'formation.outages={"1->2": [0, 10]}'
    view = view_of(tmp_path, "xie2021", None, "duration_s=10", down, "links.state.loss=0.4")
    found = network.edges(view)
    assert found["/sc1", "/sc2"] == 0
    assert 0 < found["/sc1", "/sc3"] < view.run.summary.triggers["/sc1/sensor"].count
    assert "1 of them carried nothing" in network.FIGURE.caption(view)


def test_one_namespace_shows_its_nodes(tmp_path: Path) -> None:
    view = view_of(tmp_path, "wu2018", None, "duration_s=10")
    count = view.run.summary.triggers["/sensor"].count
    assert network.edges(view) == {("/sensor", "/controller"): count, ("/controller", "/actuator"): count}


@pytest.mark.parametrize(("name", "overrides"), [("wu2018", ()), ("qi2022", ()), ("xie2021", ("formation.n=9",))])
def test_it_can_be_drawn(name: str, overrides: tuple[str, ...], tmp_path: Path) -> None:
    view = view_of(tmp_path, name, None, "duration_s=1", *overrides)
    assert network.FIGURE in FIGURES
    assert network.FIGURE.applies(view)
    pictures = rendered(lambda figure, theme: network.FIGURE.draw(view, figure, theme), network.FIGURE.size_in(view))
    assert pictures.light[:4] == pictures.dark[:4] == b"\x89PNG"
    assert pictures.light != pictures.dark
