"""Every item of the papers is listed once, and each command that is named for one exists."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest
import typer
from pydantic import ValidationError

from etac_ros.cli.main import app
from etac_ros.cli.papers import markdown
from etac_ros.reproduce.papers import Item, PaperItems, paper_items
from etac_ros.scenario.load import load
from etac_ros.scenario.places import available

PAGE = Path(__file__).parents[1] / "docs" / "papers.md"
COMMANDS = sorted({one for paper in paper_items().values() for item in paper.items for one in item.commands})


@pytest.mark.parametrize("name", available())
def test_every_item_is_listed_once(name: str) -> None:
    assert paper_items()[name].faults() == []


def test_what_is_missing_or_twice_is_found() -> None:
    items = [{"equation": "1-2", "what": "x", "reason": "y"}, {"equation": 2, "what": "x", "command": "etac list"}]
    paper = PaperItems.model_validate({"title": "", "numbered": {"equation": 3}, "items": items})
    assert paper.faults() == ["equation 3 is missing", "equation 2 is listed twice, or is none"]
    with pytest.raises(ValidationError, match="neither a command nor a reason"):
        Item.model_validate({"equation": 1, "what": "x"})


@pytest.mark.parametrize("command", COMMANDS)
def test_each_command_exists_and_its_scenario_loads(command: str) -> None:
    program, name, *arguments = shlex.split(command)
    assert program == "etac"
    group = typer.main.get_command(app)
    one = group.commands[name]  # type: ignore[attr-defined]
    values = one.make_context(name, list(arguments)).params  # refuses what it does not know
    scenarios = values.get("scenarios") or [values["scenario"]] if name != "report" else []
    variants = values.get("variant") or []
    for scenario in scenarios:
        for variant in [variants] if isinstance(variants, str) else variants or [None]:
            load(scenario, variant)


def test_a_report_is_of_a_bag_that_the_command_before_it_wrote() -> None:
    for paper in paper_items().values():
        for item in paper.items:
            if len(item.commands) > 1:
                run, report = item.commands
                assert report.split()[-1] == run.split()[-1]


def test_the_page_is_what_the_command_writes() -> None:
    assert PAGE.read_text(encoding="utf-8") == markdown()
