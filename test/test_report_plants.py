"""Reports of runs with several plants and sensors."""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from etac_ros.report import tables, write_report
from etac_ros.report.figures import data, raster
from etac_ros.report.figures.registry import FIGURES
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
        assert f'<figure id="{kind.name}">' in text
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
    assert data.cumulative_bytes(run.graph, run.recording).values[-1, 0] == 24 * sum(counts)


def test_beside_another_run_rows_say_whose_they_are(bag: Path) -> None:
    run = read_run(bag)
    names = [row.name for row in raster.rows(View(run, run))]
    assert names == [*SENSORS, *(f"{name}, other run" for name in SENSORS)]
    table = tables.performance_table(View(run, run))
    assert [row.cells[0] for row in table.rows] == [
        f"{plant}, {whose}" for whose in ("this run", "other run") for plant in PLANTS
    ]
