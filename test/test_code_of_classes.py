"""The digest of a scenario is also that of the code of a user's classes, wherever it stands."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from etac_ros.scenario import code
from etac_ros.scenario.load import load

FILES = {
    "own_lab/__init__.py": "",
    "own_lab/law.py": """
import math
import numpy as np
from etac_ros.laws.wu2018 import Proportional
from . import shapes, statistics
from .numbers import GAIN
from own_constants import LIMIT

class OwnLaw(Proportional):
    def call_later(self):
        import own_late
""",
    "own_lab/shapes.py": "import own_lab.deep as deep\n",
    "own_lab/deep.py": "value = 1\n",
    "own_lab/numbers.py": "GAIN = 2.0\n",
    "own_constants.py": "LIMIT = 0.5\n",
    "own_other.py": "unused = 1\n",
    "own_late.py": "late = 1\n",
    "own_lab/statistics.py": "named_like_others = 1\n",
}


@pytest.fixture
def digest(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):  # type: ignore[no-untyped-def]
    """What a fresh process finds, with some of the files changed."""
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    ours = {name.removesuffix(".py").replace("/", ".").removesuffix(".__init__") for name in FILES}

    def found(**changes: str) -> str:
        for name, text in FILES.items():
            path = tmp_path / name
            path.parent.mkdir(exist_ok=True)
            path.write_text(changes.get(path.stem, text), newline="")
        for name in ours:
            sys.modules.pop(name, None)
        code._code.cache_clear()
        importlib.invalidate_caches()
        return load("wu2018", None, ['/controller.law={class: "own_lab.law:OwnLaw", k: 26.0}']).digest

    yield found
    for name in ours:
        sys.modules.pop(name, None)
    code._code.cache_clear()


def test_it_is_the_same_for_the_same(digest) -> None:  # type: ignore[no-untyped-def]
    assert digest() == digest()


@pytest.mark.parametrize("name", ["law", "shapes", "deep", "numbers", "own_constants", "own_late", "statistics"])
def test_it_differs_with_each_file_that_the_class_may_use(digest, name: str) -> None:  # type: ignore[no-untyped-def]
    source = next(text for file, text in FILES.items() if Path(file).stem == name)
    assert digest(**{name: f"{source}\n"}) != digest()


def test_it_does_not_differ_by_what_has_been_imported_before(digest) -> None:  # type: ignore[no-untyped-def]
    first = digest()
    importlib.import_module("own_late")
    code._code.cache_clear()
    assert "own_late" in sys.modules
    assert load("wu2018", None, ['/controller.law={class: "own_lab.law:OwnLaw", k: 26.0}']).digest == first


def test_it_does_not_by_line_ends(digest) -> None:  # type: ignore[no-untyped-def]
    assert digest(own_constants="LIMIT = 0.5\r\n") == digest()


def test_it_does_not_with_others(digest) -> None:  # type: ignore[no-untyped-def]
    assert digest(own_other="unused = 2\n") == digest()


def test_a_scenario_of_classes_of_ours_keeps_its_digest(digest) -> None:  # type: ignore[no-untyped-def]
    before = load("wu2018", None, []).digest
    digest()
    assert load("wu2018", None, []).digest == before


def test_what_is_installed_or_ours_has_a_version() -> None:
    assert not code.code_digests(["etac_ros.laws.wu2018:Law", "json.decoder:JSONDecoder", "absent:No"])


@pytest.mark.parametrize("name", ["own_set/__init__.py", "own_set/inner.py", "own_file.py"])
def test_a_class_that_is_installed_has_the_code_of_its_package(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """As a workspace installs it, again and again under one version."""
    folder = tmp_path / "lib" / "site-packages"
    monkeypatch.syspath_prepend(folder)
    file = folder / name
    found: list[dict[str, str]] = []
    for text in ("value = 1\n", "value = 2\n"):
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        importlib.invalidate_caches()
        code._code.cache_clear()
        found.append(code.code_digests([f"{name.partition('/')[0].removesuffix('.py')}:Law"]))
    code._code.cache_clear()
    assert {} not in found
    assert found[0] != found[1]
