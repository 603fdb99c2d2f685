"""docs/readings.md and docs/theorems.md are what their commands write."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

from etac_ros.runs import run_in_process
from etac_ros.scenario.load import load
from etac_ros.theorems.papers import PAPERS, theorems_of

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def readings() -> ModuleType:
    spec = importlib.util.spec_from_file_location("readings", ROOT / "bench" / "readings.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["readings"] = module
    spec.loader.exec_module(module)
    return module


def test_the_page_of_readings_has_every_search_with_the_number_that_was_tried(readings: ModuleType) -> None:
    text = (ROOT / "docs" / "readings.md").read_text(encoding="utf-8")
    for searches in readings.SCENARIOS.values():
        for search in searches():
            assert f"## {search.name}\n\n{search.text} Readings tried: {len(search.readings)}.\n" in text
            for reading in search.readings:
                assert f"| {reading.label.replace('|', '&#124;')}" in text


def test_a_search_on_the_page_is_what_its_runs_give(readings: ModuleType) -> None:
    text = (ROOT / "docs" / "readings.md").read_text(encoding="utf-8")
    layer = next(search for search in readings.flexible() if "boundary layer" in search.name)
    kept = [reading for reading in layer.readings if reading.label in ("width 0.15 rad/s", "width 0.2 rad/s")]
    layer.readings[:] = kept
    found = [line for line in readings.rows(layer) if line.startswith("| width")]
    assert len(found) == 2
    for line in found:
        assert line in text


def test_what_its_own_tables_exclude_stands_on_the_page(readings: ModuleType) -> None:
    text = (ROOT / "docs" / "readings.md").read_text(encoding="utf-8")
    for line in (*readings.case_two(), *readings.environment()):
        assert line in text


def test_a_run_that_ends_before_its_time_is_shown_as_that(readings: ModuleType) -> None:
    collision = readings.Reading(
        "uncoupled", lambda: readings.summary("qi2022", None, ["sim/plant.dynamics.air_clearance_deg=0.1"])
    )
    label, figures = readings._measured(collision)
    assert label.startswith("uncoupled: the run ends, ")
    assert figures == {}


@pytest.mark.parametrize("name", PAPERS)
def test_the_page_of_theorems_says_what_becomes_of_every_bound(name: str) -> None:
    text = (ROOT / "docs" / "theorems.md").read_text(encoding="utf-8")
    section = text.partition(f"## {name}\n")[2].partition("\n## ")[0]
    scenario = load(name)
    found = theorems_of(scenario, run_in_process(scenario).recording)
    assert found is not None
    lines = [line for line in section.splitlines() if " | " in line][1:]
    assert len(lines) == len(found.bounds)
    for line, bound in zip(lines, found.bounds, strict=True):
        assert line.startswith(f"| {bound.equation} | {bound.says.replace('|', '&#124;')} | ")
        assert f" | {bound.standing.value} | " in line
