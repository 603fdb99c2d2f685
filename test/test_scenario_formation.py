"""A formation in a scenario file: templates written out, and mistakes that are refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from test_engines_equal import assert_same

from etac_ros.errors import ScenarioError
from etac_ros.laws.digraph import Digraph
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load


def edges(overrides: list[str]) -> set[tuple[str, str]]:
    graph = load("xie2021", None, overrides).build()
    return {
        (link.sender.split("/")[1], receiver.split("/")[1])
        for link in graph.links.values()
        if link.kind.value == "network"
        for receiver in link.receivers
    }


def test_the_papers_graph() -> None:
    assert edges([]) == {("sc1", "sc2"), ("sc1", "sc3"), ("sc1", "sc4"), ("sc2", "sc3"), ("sc3", "sc1"), ("sc3", "sc2")}


def test_every_spacecraft_has_its_own_values_and_topics() -> None:
    scenario = load("xie2021")
    graph = scenario.build()
    assert scenario.nodes["/sc3/plant"]["dynamics"]["inertia_kg_m2"][0] == 16.0
    assert scenario.nodes["/sc4/sensor"]["neighbours"] == ["sc1"]
    assert scenario.nodes["/sc2/sensor"]["signal"]["weights"] == [1.0, 1.0]
    assert graph.links["sc1_state"].topic == "/sc1/state"
    assert graph.links["sc1_torque"].topic == "/emulation/sc1/torque"
    assert "sc4_state" not in graph.links  # nobody listens to it


@pytest.mark.parametrize("n", [2, 3, 8, 16])
def test_other_numbers_give_a_connected_graph_the_same_for_a_seed(n: int) -> None:
    found = edges([f"formation.n={n}"])
    names = [f"sc{i + 1}" for i in range(n)]
    rows = [[1.0 if (a, b) in found else 0.0 for a in names] for b in names]
    assert Digraph.from_rows(rows).has_spanning_tree()
    assert found == edges([f"formation.n={n}"])
    if n == 8:
        assert found != edges([f"formation.n={n}", "formation.seed=2"])


def test_what_is_scattered_differs_from_what_it_is_drawn_from() -> None:
    nodes = load("xie2021", None, ["formation.n=8"]).nodes
    first, fifth = (np.array(nodes[f"/sc{i}/plant"]["dynamics"]["attitude_mrp"]) for i in (1, 5))
    assert not np.array_equal(first, fifth)
    assert np.abs(fifth / first - 1.0).max() <= 0.1
    assert nodes["/sc1/plant"]["dynamics"]["inertia_kg_m2"] == nodes["/sc5/plant"]["dynamics"]["inertia_kg_m2"]


def test_a_template_and_one_spacecraft_can_be_overridden() -> None:
    nodes = load("xie2021", None, ["*/sensor.trigger.c1=0.02", "sc2/sensor.trigger.c1=0.03"]).nodes
    assert [nodes[f"/sc{i}/sensor"]["trigger"]["c1"] for i in (1, 2, 3)] == [0.02, 0.03, 0.02]
    links = load("xie2021", None, ["links.state.delay_ticks=2", "links.sc3_state.delay_ticks=5"]).run.links
    assert [links[f"sc{i}_state"].delay_ticks for i in (1, 2, 3)] == [2, 2, 5]


def test_the_resolved_file_gives_the_same_run(tmp_path: Path) -> None:
    scenario = load("xie2021", "outage", ["duration_s=2", "formation.n=5"])
    file = tmp_path / "resolved.yaml"
    file.write_text(scenario.text)
    resolved = load(str(file))
    assert resolved.digest == scenario.digest
    assert_same(run_in_process(scenario).recording, run_in_process(resolved).recording)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("formation.adjacency=[0,0,0,0, 0,0,0,0, 0,1,0,0, 0,0,1,0]", ["formation.adjacency", "spanning tree"]),
        ("formation.adjacency=[0,1,0]", ["formation.adjacency"]),
        ("formation.adjacency=[1,0,1,0, 1,0,1,0, 1,1,0,0, 1,0,0,0]", ["formation.adjacency"]),
        ("formation.n=0", ["formation.n"]),
        ("formation.sattered=[a]", ["formation.sattered", "scattered"]),
        ("formation.scattered=[mood]", ["formation.scattered", "mood"]),
        ("formation.values.rate_rad_s=[1.0, 2.0]", ["formation.values.rate_rad_s", "multiple of 4"]),
        ('formation.outages={"1->9": [1, 2]}', ["formation.outages", "1->9", "1->2"]),
        ('formation.outages={"one": [1, 2]}', ["formation.outages", "one", "1->2"]),
        ('formation.outages={"1->2": [2, 1]}', ["outages", "ascending"]),
        ('formation.outages={"1->2": [1]}', ["outages", "from, until"]),
        ('formation.outages={"1->2": [1, 1.00001]}', ["outages", "ticks"]),
        ("*/plant.dynamics.attitude_mrp='{attitude}'", ["/*/plant", "{attitude}", "attitude_mrp"]),
        ("sc9/plant.dynamics.substeps=2", ["sc9/plant"]),
        ("links.sc9_state.delay_ticks=2", ["links.sc9_state"]),
        ("sc2/sensor.neighbours=[sc1]", ["weights for 2 neighbours", "1 are named"]),
    ],
)
def test_mistakes_are_refused_with_their_place(override: str, words: list[str]) -> None:
    with pytest.raises(ScenarioError) as caught:
        load("xie2021", None, [override])
    for word in words:
        assert word in str(caught.value)
