"""Reports of runs with several plants and sensors."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import yaml
from matplotlib.figure import Figure
from toy import Ramp, toy

from etac_ros.metrics import curves
from etac_ros.report import tables, write_report
from etac_ros.report.figures import raster
from etac_ros.report.figures.registry import FIGURES
from etac_ros.report.figures.style import LIGHT
from etac_ros.report.source import read_run
from etac_ros.report.view import View
from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load

PLANTS = ("/sc1/plant", "/sc2/plant")
SENSORS = ("/sc1/sensor", "/sc2/sensor")


def formation(folder: Path) -> Path:
    """A scenario file with two spacecraft of wu2018 that start apart from each other."""
    nodes: dict[str, Any] = yaml.safe_load(load("wu2018", None, ["duration_s=300"]).text)
    run = nodes.pop("/**")["ros__parameters"]
    links = run.pop("links")
    run |= {"scenario": "formation", "links": {}}
    del run["published"], run["baseline"]
    sections: dict[str, Any] = {"/**": {"ros__parameters": run}}
    for number in (1, 2):
        for name, link in links.items():
            ends = {"from": f"/sc{number}{link['from']}", "to": [f"/sc{number}{end}" for end in link["to"]]}
            run["links"][f"{name}_{number}"] = {**link, **ends}
        for name, section in deepcopy(nodes).items():
            parameters = section["ros__parameters"]
            if "reads" in parameters:
                parameters["reads"] = f"/sc{number}{parameters['reads']}"
            if name == "/plant":
                parameters["dynamics"]["attitude_euler_deg"] = [10.0 / number, 5.0, -5.0]
            sections[f"/sc{number}{name}"] = section
    path = folder / "formation.yaml"
    path.write_text(yaml.safe_dump(sections, sort_keys=False))
    return path


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("formation")
    run_in_process(load(str(formation(folder))), folder / "bag")
    return folder / "bag"


def test_every_plant_and_sensor_has_its_place_on_the_page(bag: Path) -> None:
    text = write_report(bag).read_text(encoding="utf-8")
    for kind in FIGURES:
        assert (f'<figure id="{kind.name}">' in text) == (
            kind.name not in ("watched", "modes", "states", "lyapunov", "latency")
        )
    for name in (*PLANTS, *SENSORS):
        assert f'<th scope="row" class="text">{name}</th>' in text
    assert "Beside the published figures" not in text


def test_figures_have_a_row_for_each(bag: Path) -> None:
    view = View(read_run(bag))
    assert tuple(view.margins) == SENSORS
    assert [row.name for row in raster.rows(view)] == list(SENSORS)
    heights = {kind.name: kind.height_in(view) for kind in FIGURES}
    assert heights["attitude"] == heights["rate"] == heights["torque"] == heights["margin"] > 4.5


def test_each_sensor_is_held_against_its_own_plant_and_messages(bag: Path) -> None:
    run = read_run(bag)
    counts = []
    for name, margins in View(run).margins.items():
        np.testing.assert_array_equal(margins.errors >= margins.thresholds, margins.fired)
        counts.append(run.summary.triggers[name].count)
        assert margins.fired.sum() == counts[-1] - 1
    assert counts[0] != counts[1]
    assert curves.cumulative_bytes(run.graph, run.recording).values[-1, 0] == 24 * sum(counts)


def test_beside_another_run_rows_say_whose_they_are(bag: Path) -> None:
    run = read_run(bag)
    names = [row.name for row in raster.rows(View(run, (run,)))]
    assert names == [*SENSORS, *(f"{name}, formation" for name in SENSORS)]
    table = tables.performance_table(View(run, (run,)))
    assert table.columns == ("plant", "this run", "formation")
    assert [row.cells[0] for row in table.rows if row.cells[0].endswith("energy [N²m²s]")] == [
        f"{plant}: energy [N²m²s]" for plant in PLANTS
    ]


ODD_RUNS = {
    "at rest, and one tick long": [
        "plant.dynamics.attitude_euler_deg=[0.0,0.0,0.0]",
        "plant.dynamics.disturbance.constant_nm=[0.0,0.0,0.0]",
        "plant.dynamics.disturbance.sine_nm=[0.0,0.0,0.0]",
        "plant.dynamics.disturbance.cosine_nm=[0.0,0.0,0.0]",
        "duration_s=0.03125",
    ],
    "a fraction of a degree": ["plant.dynamics.attitude_euler_deg=[0.05,0.0,0.0]", "duration_s=20"],
    "one trigger at the start": ["sensor.trigger.gamma=10.0", "duration_s=20"],
    "a limit far off, and stamped": ["actuator.limit_nm=1e3", "wire=stamped", "duration_s=20"],
    "a trigger at every tick": ["sensor.trigger.alpha=1e-9", "sensor.trigger.gamma=1e-300", "duration_s=20"],
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("overrides", ODD_RUNS.values(), ids=ODD_RUNS.keys())
def test_odd_runs_are_drawn_without_a_warning(overrides: list[str], tmp_path: Path) -> None:
    run_in_process(load("wu2018", None, overrides), tmp_path / "bag")
    view = View(read_run(tmp_path / "bag"))
    for kind in FIGURES:
        if kind.applies(view):
            figure = Figure(figsize=kind.size_in(view))
            kind.draw(view, figure, LIGHT)
            figure.draw_without_rendering()
            assert all(axes.get_ylabel() or kind.name in ("overview", "raster", "network") for axes in figure.axes)
            assert kind.caption(view)


@pytest.mark.filterwarnings("error")
def test_plants_and_modules_of_ones_own_are_drawn_too(tmp_path: Path) -> None:
    scenario = toy(tmp_path, {"a": {"at": [2, 5, 9]}, "b": {"at": [5, 6]}}, b_says={"delay_ticks": 2})
    run_in_process(scenario, tmp_path / "bag")
    view = View(read_run(tmp_path / "bag"))
    held = curves.held_inputs(view.run.graph, view.run.recording, "/b/ramp")["push"]
    # The brake hears what was said at tick 5 two ticks late.
    assert held.times_s.tolist() == [0.0, 0.7, 0.8, 2.0]
    assert held.values.ravel().tolist() == [0.0, -0.5, -0.5, -0.5]
    assert view.margins == {}
    for kind in FIGURES:
        if kind.applies(view):
            kind.draw(view, Figure(figsize=kind.size_in(view)), LIGHT)


class Twofold(Ramp):
    """A ramp with two inputs."""

    inputs: ClassVar[dict[str, int]] = {"push": 1, "pull": 1}


def test_each_input_of_a_plant_is_held_and_spends_energy_by_itself(tmp_path: Path) -> None:
    def link(sender: str, *receivers: str, kind: str = "physical") -> dict[str, Any]:
        return {"from": sender, "to": list(receivers), "kind": kind}

    links = {
        "said": link("/sensor", "/a", "/b", kind="network"),
        "push": link("/a", "/ramp:push"),
        "pull": link("/b", "/ramp:pull"),
        "echo": link("/other", "/sensor", kind="internal"),
    }
    run = {"scenario": "twofold", "ticks_per_second": 10, "duration_s": 2.0, "links": links}
    sections = {
        "/**": run,
        "/ramp": {"module": "plant", "dynamics": {"class": "test_report_plants:Twofold"}},
        "/other": {"module": "toy:Scripted", "reads": "/ramp"},
        "/sensor": {"module": "toy:Scripted", "reads": "/ramp", "at": [4]},
        "/a": {"module": "toy:Brake"},
        "/b": {"module": "toy:Brake"},
    }
    run["links"] |= {"heard": link("/sensor:said", "/other", kind="internal") | {"topic": "/heard"}}
    path = tmp_path / "twofold.yaml"
    path.write_text(yaml.safe_dump({name: {"ros__parameters": body} for name, body in sections.items()}))
    run_in_process(load(str(path)), tmp_path / "bag")
    view = View(read_run(tmp_path / "bag"))
    held = curves.held_inputs(view.run.graph, view.run.recording, "/ramp")
    for port in ("push", "pull"):
        assert held[port].times_s.tolist() == [0.0, 0.4, 2.0]
        assert held[port].values.ravel().tolist() == [0.0, -0.5, -0.5]
    spent = view.run.energy["/ramp"].values[-1, 0]
    assert spent == pytest.approx(2 * 0.25 * 1.6)
    # Internal links are no network, and both ports have a row of their own.
    assert curves.cumulative_bytes(view.run.graph, view.run.recording).values[-1, 0] == 4.0
    torque = next(kind for kind in FIGURES if kind.name == "torque")
    figure = Figure(figsize=torque.size_in(view))
    torque.draw(view, figure, LIGHT)
    assert [axes.get_title() for axes in figure.axes] == ["/ramp: push", "/ramp: pull"]
