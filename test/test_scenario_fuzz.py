"""Mangled scenarios: whatever a file or an option holds, it loads or is refused in words, never with a traceback.

``ETAC_FUZZ=20`` tries twenty times as many.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import read_sections, write_sections
from etac_ros.scenario.load import baseline_of, load
from etac_ros.scenario.places import available, find

SCALE = int(os.environ.get("ETAC_FUZZ", "1"))
FILES = {name: find(name).read_text(encoding="utf-8") for name in available()}
TREES = {name: read_sections(find(name)) for name in available()}
ODD_VALUES: list[Any] = [
    None, True, False, 0, -1, 1, 2, 10**18, -(2**63), 2**63 - 1, 0.0, -0.0, 1e-320, 1e308, -1e308, float("nan"),
    float("inf"), "", " ", "x", "~", "1e5", "010", "/", "//", ":", "/plant", "/plant:", "a:b:c", "\x1b[31m", "\n", "é",
    "{self}", "{x}", "{", "/*/x", "/**", "/**/sensor", "os:system", "etac_ros:Nothing", "etac_ros.errors:EtacError",
    "etac_ros.plants.rigid:RigidBody", "etac_ros.modules.actuator:Actuator", "builtins:int", "pathlib:Path",
    [], [None], [[]], [1, "x"], [0.0] * 3, [1.0] * 4, [1] * 9, ["/plant"], {}, {"": 1}, {"class": "x:y"},
    {"a": {"b": {}}},
    {"class": "etac_ros.triggers.periodic:Periodic", "period_s": 1e-9}, {"from": "/plant", "to": [], "kind": "network"},
]  # fmt: skip
ODD_TEXTS = [
    "!!int abc", "!!timestamp 2024-13-45", "*a", "&a", "<<: *a", "\t", "[" * 50, "{" * 50, "]", "}", ": ", "- ", "? ",
    "|", ">", "'", '"', "#", "---", "...", "%YAML 1.1", "\x00", "\x85", "\ufeff", "9" * 400, "1:30", "010", "1e999",
    "ros__parameters:", "/**:", "null", "~", ",", "\n", "  ", "@", "`",
]  # fmt: skip


def outcome(path: Path, variant: str | None = None, overrides: tuple[str, ...] = ()) -> str:
    """Loaded, or the refusal; anything else that is raised fails the test."""
    try:
        scenario = load(str(path), variant, overrides)
        baseline_of(scenario)
    except ScenarioError as error:
        refusal = str(error)
    else:
        refusal = ""
        assert scenario.text
    assert len(refusal) < 20_000
    return refusal


def places(tree: Any, above: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every place in a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for key, value in items:
        yield (*above, key)
        yield from places(value, (*above, key))


PLACES = {name: list(places(tree)) for name, tree in TREES.items()}


@st.composite
def mangled_trees(draw: st.DrawFn) -> str:
    """A shipped scenario in which some places hold something else, are gone, or have another name."""
    name = draw(st.sampled_from(sorted(TREES)))
    tree = deepcopy(TREES[name])
    for _ in range(draw(st.integers(1, 3))):
        *above, key = draw(st.sampled_from(PLACES[name]))
        target: Any = tree
        for part in above:
            target = target[part] if _has(target, part) else None
        if not _has(target, key):
            continue
        match draw(st.sampled_from(["other", "other", "other", "gone", "renamed", "copied"])):
            case "other":
                target[key] = draw(st.sampled_from(ODD_VALUES))
            case "gone":
                del target[key]
            case "renamed" if isinstance(target, dict):
                target[draw(st.sampled_from(["", "x", "/**", "class", "module", "sensor", "é", "a.b"]))] = target.pop(
                    key
                )
            case "copied":
                source: Any = tree
                for part in draw(st.sampled_from(PLACES[name])):
                    source = source[part] if _has(source, part) else source
                target[key] = deepcopy(source)
    return write_sections(tree)


def _has(target: Any, key: Any) -> bool:
    if isinstance(target, dict):
        return key in target
    return isinstance(target, list) and isinstance(key, int) and key < len(target)


@st.composite
def mangled_texts(draw: st.DrawFn) -> str:
    """The text of a shipped scenario with pieces cut out, doubled or put in."""
    text = FILES[draw(st.sampled_from(sorted(FILES)))]
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(text)))
        length = draw(st.integers(0, 60))
        match draw(st.sampled_from(["cut", "double", "odd", "end"])):
            case "cut":
                text = text[:at] + text[at + length :]
            case "double":
                text = text[: at + length] + text[at:]
            case "odd":
                text = text[:at] + draw(st.sampled_from(ODD_TEXTS)) + text[at:]
            case "end":
                text = text[:at]
    return text


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("mangled") / "mangled.yaml"


@settings(max_examples=250 * SCALE)
@given(text=mangled_trees(), variant=st.sampled_from([None, None, "periodic", "case2", "smc"]))
def test_mangled_values(file: Path, text: str, variant: str | None) -> None:
    file.write_text(text, encoding="utf-8")
    outcome(file, variant)


@settings(max_examples=250 * SCALE)
@given(text=mangled_texts())
def test_mangled_texts(file: Path, text: str) -> None:
    file.write_text(text, encoding="utf-8", errors="surrogatepass")
    outcome(file)


@settings(max_examples=150 * SCALE)
@given(content=st.binary(max_size=200))
def test_bytes_that_mean_nothing(file: Path, content: bytes) -> None:
    file.write_bytes(content)
    assert outcome(file)


KEYS = [
    "", ".", "..", "plant", "plant.", ".plant", "sensor.trigger", "sensor.trigger.alpha", "sensor.trigger.class",
    "plant.dynamics.attitude_q", "links", "links.signal", "links.torque.to", "published", "published.triggers",
    "variants", "variants.periodic", "baseline", "formation.n", "windows", "title", "seed", "duration_s", "*/sensor.x",
    "ticks_per_second", "dispersion", "tradeoff", "a" * 5000, "é", "sensor.noise", "controller.module", "scenario",
]  # fmt: skip


@settings(max_examples=200 * SCALE)
@given(
    name=st.sampled_from(sorted(FILES)),
    assignments=st.lists(
        st.tuples(st.sampled_from(KEYS), st.sampled_from([*ODD_TEXTS, *map(repr, ODD_VALUES)])), max_size=3
    ),
)
def test_odd_options(file: Path, name: str, assignments: list[tuple[str, str]]) -> None:
    file.write_text(FILES[name], encoding="utf-8")
    outcome(file, None, tuple(f"{key}={value}" for key, value in assignments))
