"""What benches print stands in docs/: each writes its own section of a page and leaves the others alone."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import patch

import pytest

from etac_ros.tables.table import Row, Table

ROOT = Path(__file__).resolve().parent.parent
BENCH = ROOT / "bench"


def load_section() -> ModuleType:
    spec = importlib.util.spec_from_file_location("section", BENCH / "section.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with patch.dict(sys.modules):
        spec.loader.exec_module(module)
    return module


SECTION = load_section()
PAGE = SECTION.PAGE.read_text(encoding="utf-8")
SOURCES = {path.stem: path.read_text(encoding="utf-8") for path in BENCH.glob("*.py")}


PAGES = {name: SECTION.ELSEWHERE[name].read_text(encoding="utf-8") for name in SECTION.ELSEWHERE}


def in_page(name: str) -> str:
    page = PAGES.get(name, PAGE)
    return str(page[page.index(f"<!-- bench {name} -->") : page.index(f"<!-- end {name} -->")])


def test_the_page_has_sections() -> None:
    assert SECTION.sections(PAGE)


@pytest.mark.parametrize("name", [*SECTION.sections(PAGE), *PAGES])
def test_a_section_is_written_by_the_bench_that_it_names(name: str) -> None:
    command = re.search(r"Written by `\./scripts/bench ?(\w*)", in_page(name))
    assert command is not None
    assert f'Section("{name}"' in re.sub(r"\s", "", SOURCES[command[1] or "speed"])


def test_sections_stand_in_their_order() -> None:
    assert SECTION.sections(PAGE) == [name for name in SECTION.ORDER if name in SECTION.sections(PAGE)]


def test_benches_that_the_page_names_are_there() -> None:
    named = set(re.findall(r"\./scripts/bench (\w+)", PAGE))
    assert named
    assert named <= SOURCES.keys()


def test_a_section_replaces_itself_and_no_other(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Head\n\nWords.\n\n<!-- bench sweep -->\n\nof others\n\n<!-- end sweep -->\n\nTail.\n")
    for value in ("first", "second"):
        section = SECTION.Section("hop", "Hops", "./scripts/bench hop")
        section.say("What it means.")
        section.show(Table("", ("what", "least [s]"), (Row(("loop", value)),)))
        section.write(page)
    text = page.read_text()
    assert SECTION.sections(text) == ["hop", "sweep"]  # in its place, before what follows it
    assert "| loop | second |" in text
    assert "first" not in text
    assert text.startswith(
        "# Head\n\nWords.\n\n<!-- bench hop -->\n\n## Hops\n\nWritten by `./scripts/bench hop --write`"
    )
    assert text.endswith("<!-- bench sweep -->\n\nof others\n\n<!-- end sweep -->\n\nTail.\n")


def test_the_last_section_goes_to_the_end() -> None:
    text = SECTION.put("# Head\n", SECTION.ORDER[-1], "words")
    assert text == f"# Head\n\n<!-- bench {SECTION.ORDER[-1]} -->\n\nwords\n\n<!-- end {SECTION.ORDER[-1]} -->\n"


def test_a_section_of_another_page_is_put_there(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text("# Head\n\n<!-- bench wall -->\n\nold\n\n<!-- end wall -->\n\nTail.\n")
    section = SECTION.Section("wall", "What was measured", "./scripts/bench wall")
    section.say("New.")
    section.write(page)
    assert "old" not in page.read_text()
    assert page.read_text().endswith("\nNew.\n\n<!-- end wall -->\n\nTail.\n")
    with patch.dict(SECTION.ELSEWHERE, {"wall": page}):
        section.say("Newer.")
        section.write()
    assert "Newer." in page.read_text()


def test_a_section_without_a_place_is_refused() -> None:
    with pytest.raises(ValueError, match="name it in ORDER"):
        SECTION.Section("other", "Other", "./scripts/bench other")
