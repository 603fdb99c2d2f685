"""``etac list``: what can be run, and what a variant changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from rich.console import Console

from etac_ros.plain_text import one_line
from etac_ros.scenario.document import EVERYWHERE, read_sections, variants_of
from etac_ros.scenario.places import config_folders
from etac_ros.tables.table import Row, Table
from etac_ros.tables.terminal import show

_SAYS_NOTHING_OF_THE_RUN = ("published", "title", "compare")


def list_scenarios(console: Console) -> None:
    """Every scenario that is shipped, with the names of its variants."""
    for path in sorted({path for folder in config_folders() for path in folder.glob("*.yaml")}):
        sections = read_sections(path)
        console.print(f"{path.stem}: {one_line(str(sections[EVERYWHERE].get('title', '')))}", style="bold")
        variants = variants_of(sections, str(path))
        if variants:
            console.print(f"  variants: {', '.join(map(one_line, variants))}")
    console.print(
        "\nA variant is a named set of changes to its scenario: etac run NAME --variant VARIANT. "
        "etac list NAME says what each changes."
    )


def list_variants(name: str, console: Console) -> None:
    """The variants of one scenario, each with what it changes.

    Raises
    ------
    ScenarioError
        If there is no such scenario.
    """
    from etac_ros.scenario.load import load  # with all that a scenario may name: the plain list needs none of it

    scenario = load(name)
    assert scenario.layers is not None  # it was loaded to be run
    console.print(f"{scenario.name}: {one_line(scenario.run.title)}", style="bold")
    blocks = variants_of(scenario.layers.file, str(scenario.path))
    rows = []
    for variant, block in blocks.items():
        changes = [f"{key} = {one_line(value)}" for key, value in _changes(block)]
        rows += [
            Row((one_line(variant) if place == 0 else "", change), ends=place == len(changes) - 1)
            for place, change in enumerate(changes or ["nothing: the file as it stands"])
        ]
    if rows:
        show(Table("", ("variant", "changes"), tuple(rows), texts=frozenset({"changes"})), console)
    else:
        console.print("it has no variants")


def _changes(block: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, str]]:
    for key, value in block.items():
        if not above and key in _SAYS_NOTHING_OF_THE_RUN:
            continue
        name = f"{above}.{key}" if above else str(key)
        if isinstance(value, Mapping) and value:
            yield from _changes(value, name)
        else:
            yield name, str(value)
