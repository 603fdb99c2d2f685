"""The YAML text of a scenario as a tree of sections, and overrides on it.

A file is a ROS parameter file: ``/**`` with ``ros__parameters`` for the whole run, one further section a node.
"""

from __future__ import annotations

import difflib
import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import yaml

from etac_ros.errors import ScenarioError
from etac_ros.scenario.yaml_text import DEEPEST, LARGEST_BYTES, Dumper, parse_value

Tree = dict[str, Any]

EVERYWHERE = "/**"
"""Section of what concerns the whole run."""
_PARAMETERS = "ros__parameters"
FORMATION = "formation"
"""Key of the section ``/**`` that makes a formation of the scenario."""
TEMPLATE = "/*/"
"""How the names of a formation's templates begin."""
_LONGEST_SHOWN = 90
_LONGEST_COMPARED = 64


def read_sections(*paths: Path) -> Tree:
    """Read parameter files into ``{node name: parameters}``, laid over each other as ROS does it.

    Sections of one name merge, file after file, in the place of the first. A section whose name has a wildcard
    (``/*/sensor``: any one namespace, ``/**/sensor``: any or none) is laid over every node of the files that it
    matches, and whatever comes later in the file holds. ``/**`` alone is the section of the whole run.

    Parameters
    ----------
    paths
        One file or more.

    Raises
    ------
    ScenarioError
        If a file is missing, is no YAML or has not the form of a ROS parameter file; or if a wildcard matches no node.
    """
    sections: Tree = {}
    places: dict[str, str] = {}
    for path in paths:
        for name, body in _sections_of(path).items():
            sections[name] = merged(sections[name], body) if name in sections else body
            places.setdefault(name, f"{path}: {name}")
    if EVERYWHERE not in sections:
        files = ", ".join(str(path) for path in paths)
        raise ScenarioError(files, "is not a scenario file", f"a ROS parameter file with a section '{EVERYWHERE}'")
    return _without_wildcards(sections, places)


def _sections_of(path: Path) -> Tree:
    tree = parse_value(_text_of(path), str(path))
    if not isinstance(tree, dict):
        raise ScenarioError(str(path), "is not a scenario file", f"a ROS parameter file with a section '{EVERYWHERE}'")
    sections: Tree = {}
    for name, body in tree.items():
        for full, below in _nodes_in(name, body, f"{path}: {name}"):
            if full in sections:
                raise ScenarioError(f"{path}: {full}", "stands in the file twice")
            sections[full] = below
    return sections


def _nodes_in(name: str, body: Any, where: str) -> Iterator[tuple[str, Any]]:
    """The nodes in a section: itself, or those of a namespace, which may lie within each other."""
    expected = f"one key '{_PARAMETERS}' with a mapping below it"
    full = "/" + name.strip("/")
    if not isinstance(body, dict) or not body:
        raise ScenarioError(where, f"found {shown(body)}", expected)
    if _PARAMETERS in body:
        if len(body) > 1 or not isinstance(body[_PARAMETERS], dict):
            raise ScenarioError(where, f"found {shown(body)}", expected)
        yield full, body[_PARAMETERS]
        return
    for inner, below in body.items():
        if not isinstance(below, dict):  # a key of a node or of the run, more likely than a namespace
            raise ScenarioError(where, f"found {shown(body)}", expected)
        yield from _nodes_in(f"{full}/{inner.strip('/')}", below, f"{where}.{inner}")


def _text_of(path: Path) -> str:
    """The text of a file, which a scenario's author need not have meant well."""
    wanted = "a text file in UTF-8"
    try:
        if not path.is_file():  # a pipe or a device might never end
            kind = "is a directory" if path.is_dir() else "is no file" if path.exists() else "there is no such file"
            raise ScenarioError(str(path), kind, wanted)
        if path.stat().st_size > LARGEST_BYTES:
            raise ScenarioError(str(path), f"{path.stat().st_size:,} bytes", f"at most {LARGEST_BYTES:,}")
        return path.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        line = error.object[: error.start].count(b"\n") + 1
        raise ScenarioError(str(path), f"line {line} holds bytes that are no UTF-8", wanted) from None
    except (OSError, ValueError) as error:  # a name with a NUL is a ValueError
        raise ScenarioError(str(path), f"cannot be read ({error})", wanted) from None


def _without_wildcards(sections: Tree, places: Mapping[str, str]) -> Tree:
    # In a formation, a section below one wildcard is the template of all spacecraft, and as such a node.
    is_formation = FORMATION in sections[EVERYWHERE]
    nodes = [
        name
        for name in sections
        if name == EVERYWHERE or "*" not in name or (is_formation and name.startswith(TEMPLATE))
    ]
    result: Tree = {name: {} for name in nodes}
    for name, body in sections.items():
        if name in result:
            result[name] = merged(result[name], body)
            continue
        pattern = _pattern(name)
        matching = [node for node in nodes if node != EVERYWHERE and pattern.fullmatch(node)]
        if not matching:
            raise ScenarioError(places[name], "matches no node", choice(name, [n for n in nodes if n != EVERYWHERE]))
        for node in matching:
            result[node] = merged(result[node], body)
    return result


def _pattern(name: str) -> re.Pattern[str]:
    """ROS's wildcards: ``*`` is one part of a name, ``**`` any number of them."""
    parts = {"*": "/[^/]+", "**": "(?:/[^/]+)*"}
    return re.compile("".join(parts.get(part, f"/{re.escape(part)}") for part in name.strip("/").split("/")))


def write_sections(sections: Mapping[str, Any]) -> str:
    """The text of a scenario file; :func:`read_sections` reads it back."""
    tree = {name: {_PARAMETERS: body} for name, body in sections.items()}
    return yaml.dump(tree, Dumper=Dumper, sort_keys=False, default_flow_style=None, width=110)


def merged(base: Any, change: Any) -> Any:
    """``change`` laid over ``base``: mappings merge key by key, one that names another ``class`` replaces."""
    if not isinstance(base, dict) or not isinstance(change, dict):
        return deepcopy(change)
    if "class" in change and change["class"] != base.get("class"):
        return deepcopy(change)
    result = dict(base)
    for key, value in change.items():
        result[key] = merged(base[key], value) if key in base else deepcopy(value)
    return result


def variants_of(sections: Tree, path: str) -> Tree:
    """The named blocks of overrides that stand in the file.

    Raises
    ------
    ScenarioError
        If they are no mapping of mappings.
    """
    variants = sections[EVERYWHERE].get("variants") or {}
    if not isinstance(variants, dict):
        raise ScenarioError(
            f"{path}: {EVERYWHERE}.variants", f"found {shown(variants)}", "a mapping of names to overrides"
        )
    for name, block in variants.items():
        if not isinstance(block, dict):
            raise ScenarioError(
                f"{path}: {EVERYWHERE}.variants.{name}",
                f"found {shown(block)}",
                "a mapping of nodes and keys to values",
            )
    return variants


def with_variant(sections: Tree, name: str, path: str, run_keys: Collection[str]) -> Tree:
    """The sections with a variant's block laid over them.

    Keys of the block are node names or keys of the ``/**`` section, which are ``run_keys``.
    """
    variants = variants_of(sections, path)
    if name not in variants:
        raise ScenarioError(f"{path}: {EVERYWHERE}.variants", f"no variant '{name}'", choice(name, variants))
    result = deepcopy(sections)
    for key, value in variants[name].items():
        node = node_of(str(key), sections)
        if node is not None:
            result[node] = merged(result[node], value)
        elif key in run_keys:
            result[EVERYWHERE] = merged(result[EVERYWHERE], {key: value})
        else:
            raise _no_such_key(f"{path}: {EVERYWHERE}.variants.{name}.{key}", str(key), sections, run_keys)
    return result


def assigned(sections: Tree, assignment: str, run_keys: Collection[str]) -> tuple[str, Any, Tree]:
    """What one ``key=value`` sets.

    Parameters
    ----------
    sections
        The tree that it concerns.
    assignment
        ``NODE.key.key=value`` or ``key.key=value`` for the whole run; the value is YAML.
    run_keys
        The keys of the ``/**`` section, whether they stand in the file or not.

    Returns
    -------
    key, value, change
        What was set, and the same as a tree of sections, to be laid over the others.
    """
    key, equals, text = assignment.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ScenarioError(f"--set {shortened(assignment)}", "is no assignment", "key=value")
    value = parse_value(text, f"--set {shortened(key)}")
    first, *rest = key.split(".")
    node = node_of(first, sections)
    names = rest if node is not None else [first, *rest]
    if not names:
        raise ScenarioError(f"--set {key}", "names a whole node", f"a key below it, as in {key}.KEY=VALUE")
    if node is None and first not in run_keys:
        raise _no_such_key(f"--set {shortened(key)}", first, sections, run_keys)
    if len(names) > DEEPEST:
        raise ScenarioError(f"--set {shortened(key)}", f"{len(names)} keys below each other", f"at most {DEEPEST}")
    change: Any = value
    for name in reversed(names):
        change = {name: change}
    return key, value, {EVERYWHERE if node is None else node: change}


def with_override(sections: Tree, assignment: str, run_keys: Collection[str]) -> tuple[Tree, str, Any]:
    """The sections with one ``key=value`` set, and what was set; those that are given are not changed."""
    key, value, change = assigned(sections, assignment, run_keys)
    return laid_over(sections, change), key, value


def laid_over(sections: Tree, change: Tree) -> Tree:
    """The sections with a change of some of them merged into each."""
    return {**sections, **{name: merged(sections[name], body) for name, body in change.items()}}


def has_place(sections: Tree, assignment: str, run_keys: Collection[str]) -> bool:
    """Whether a ``key=value`` concerns a node that is there, or a key of the ``/**`` section."""
    first = assignment.partition("=")[0].strip().split(".")[0]
    return node_of(first, sections) is not None or first in run_keys


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The nearest valid name, or an empty text."""
    names = [str(candidate) for candidate in candidates]
    # Comparing takes the product of the lengths.
    found = difflib.get_close_matches(name[:_LONGEST_COMPARED], names, n=1, cutoff=0.5)
    return found[0] if found else ""


def choice(name: str, candidates: Iterable[str]) -> str:
    """The nearest valid name, and all of them."""
    names = [str(candidate) for candidate in candidates]
    best = nearest(name, names)
    listed = ", ".join(names) if names else "nothing here"
    return f"'{best}'? (there are: {listed})" if best else f"one of: {listed}"


def node_of(key: str, sections: Mapping[str, Any]) -> str | None:
    """The node that a key names, with or without its leading slash; None if there is none."""
    name = "/" + key.strip("/")
    return name if name in sections else None


def shown(value: Any) -> str:
    """A value as in the file, cut where it is long."""
    return shortened(json.dumps(value))


def shortened(text: str) -> str:
    """A text, cut where it is long."""
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def _no_such_key(where: str, key: str, sections: Tree, run_keys: Collection[str]) -> ScenarioError:
    nodes = [name.lstrip("/") for name in sections if name != EVERYWHERE]
    return ScenarioError(where, f"unknown key '{shortened(key)}'", choice(key, [*nodes, *run_keys]))
