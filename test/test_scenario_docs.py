"""docs/scenarios.md names every key that a scenario may have, and shows what the commands print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from pydantic import BaseModel

from etac_ros.scenario.faults import field_names
from etac_ros.scenario.formation import FormationSection
from etac_ros.scenario.load import baseline_of, load
from etac_ros.scenario.schema import (
    Dispersion,
    LinkSection,
    Measure,
    NodeSection,
    Published,
    PublishedFigure,
    RunSection,
    TradeoffCurve,
    TradeoffSection,
    WindowSection,
)
from etac_ros.scenario.yaml_text import DEEPEST, LARGEST_BYTES, LONGEST_KEY, MOST_VALUES

PAGE = (Path(__file__).parents[1] / "docs" / "scenarios.md").read_text(encoding="utf-8")
MODELS = [
    RunSection, LinkSection, WindowSection, NodeSection, Dispersion, FormationSection, Published, PublishedFigure,
    Measure, TradeoffSection, TradeoffCurve,
]  # fmt: skip


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.__name__)
def test_every_key_stands_on_the_page(model: type[BaseModel]) -> None:
    named = set(re.findall(r"`([a-z_]+)`", PAGE))
    assert set(field_names(model)) <= named


def test_limits_are_those_of_the_reader() -> None:
    assert (LARGEST_BYTES, DEEPEST, MOST_VALUES, LONGEST_KEY) == (16 * 1024 * 1024, 32, 1_000_000, 256)
    for words in ("16 MiB", "32 lists and mappings", "a million values", "at most 256 characters"):
        assert words in PAGE.replace("\n", " ")


def test_the_note_that_is_shown_is_the_one_that_is_printed() -> None:
    baseline = baseline_of(load("flexible", "rho1e-4"))
    assert baseline is not None
    assert baseline.notes[0] in PAGE
