"""The YAML text of a scenario as a tree of sections, and overrides on it.

A file is a ROS parameter file: ``/**`` with ``ros__parameters`` for the whole run, one further key a node.
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

Tree = dict[str, Any]

EVERYWHERE = "/**"
"""Section of what concerns the whole run."""
_PARAMETERS = "ros__parameters"
_LONGEST_SHOWN = 90


class _Loader(yaml.SafeLoader):
    """YAML with the numbers of YAML 1.2: PyYAML alone takes ``1e-6`` for a text."""


class _Dumper(yaml.SafeDumper):
    """The same numbers, so that a text that looks like one is quoted; no aliases, which ROS cannot read."""

    def ignore_aliases(self, data: Any) -> bool:
        return True


for _part in (_Loader, _Dumper):
    _part.add_implicit_resolver(
        "tag:yaml.org,2002:float",
        re.compile(r"^[-+]?(?:\d+\.?\d*|\.\d+)[eE][-+]?\d+$"),
        list("-+0123456789."),
    )


def _mapping_without_twins(loader: _Loader, node: yaml.MappingNode) -> Iterator[Tree]:
    """A key that stands twice is refused: YAML forbids it, PyYAML would silently take the last."""
    seen = set()
    for key, _ in node.value:
        if isinstance(key, yaml.ScalarNode) and key.value != "<<":
            if key.value in seen:
                raise yaml.constructor.ConstructorError(
                    problem=f"the key '{key.value}' stands twice in one mapping", problem_mark=key.start_mark
                )
            seen.add(key.value)
    return loader.construct_yaml_map(node)


_Loader.add_constructor("tag:yaml.org,2002:map", _mapping_without_twins)


def parse_value(text: str, where: str) -> Any:
    """A YAML value as it stands in a file or behind ``--set key=``."""
    try:
        return yaml.load(text, Loader=_Loader)  # a SafeLoader: builds plain data only
    except yaml.YAMLError as error:
        raise ScenarioError(where, _yaml_problem(error), "valid YAML") from None


def read_sections(path: Path) -> Tree:
    """Read a scenario file into ``{section name: parameters}``.

    Raises
    ------
    ScenarioError
        If the file is missing, is no YAML, or has not the form of a ROS parameter file.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(str(path), f"cannot be read ({error})") from None
    tree = parse_value(text, str(path))
    if not isinstance(tree, dict) or EVERYWHERE not in tree:
        raise ScenarioError(str(path), "is not a scenario file", f"a ROS parameter file with a section '{EVERYWHERE}'")
    sections: Tree = {}
    for name, body in tree.items():
        below = body.get(_PARAMETERS) if isinstance(body, dict) and len(body) == 1 else None
        if not isinstance(below, dict):
            raise ScenarioError(
                f"{path}: {name}", f"found {shown(body)}", f"one key '{_PARAMETERS}' with a mapping below it"
            )
        key = EVERYWHERE if name == EVERYWHERE else "/" + str(name).strip("/")
        if key in sections:
            raise ScenarioError(f"{path}: {name}", "stands in the file twice")
        sections[key] = below
    return sections


def write_sections(sections: Mapping[str, Any]) -> str:
    """The text of a scenario file; :func:`read_sections` reads it back."""
    tree = {name: {_PARAMETERS: body} for name, body in sections.items()}
    return yaml.dump(tree, Dumper=_Dumper, sort_keys=False, default_flow_style=None, width=110)


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
        node = _node(str(key), sections)
        if node is not None:
            result[node] = merged(result[node], value)
        elif key in run_keys:
            result[EVERYWHERE] = merged(result[EVERYWHERE], {key: value})
        else:
            raise _no_such_key(f"{path}: {EVERYWHERE}.variants.{name}.{key}", str(key), sections, run_keys)
    return result


def with_override(sections: Tree, assignment: str, run_keys: Collection[str]) -> tuple[Tree, str, Any]:
    """The sections with one ``key=value`` set.

    Parameters
    ----------
    sections
        The tree; it is not changed.
    assignment
        ``NODE.key.key=value`` or ``key.key=value`` for the whole run; the value is YAML.
    run_keys
        The keys of the ``/**`` section, whether they stand in the file or not.

    Returns
    -------
    tree, key, value
        The new tree and what was set.
    """
    key, equals, text = assignment.partition("=")
    key = key.strip()
    if not equals or not key:
        raise ScenarioError(f"--set {assignment}", "is no assignment", "key=value")
    value = parse_value(text, f"--set {key}")
    first, *rest = key.split(".")
    node = _node(first, sections)
    names = rest if node is not None else [first, *rest]
    if not names:
        raise ScenarioError(f"--set {key}", "names a whole node", f"a key below it, as in {key}.KEY=VALUE")
    change: Any = value
    for name in reversed(names):
        change = {name: change}
    section = EVERYWHERE if node is None else node
    if section == EVERYWHERE and names[0] not in run_keys:
        raise _no_such_key(f"--set {key}", names[0], sections, run_keys)
    result = dict(sections)
    result[section] = merged(sections[section], change)
    return result, key, value


def has_place(sections: Tree, assignment: str, run_keys: Collection[str]) -> bool:
    """Whether a ``key=value`` concerns a node that is there, or a key of the ``/**`` section."""
    first = assignment.partition("=")[0].strip().split(".")[0]
    return _node(first, sections) is not None or first in run_keys


def nearest(name: str, candidates: Iterable[str]) -> str:
    """The nearest valid name, or an empty text."""
    found = difflib.get_close_matches(name, [str(candidate) for candidate in candidates], n=1, cutoff=0.5)
    return found[0] if found else ""


def choice(name: str, candidates: Iterable[str]) -> str:
    """The nearest valid name, and all of them."""
    names = [str(candidate) for candidate in candidates]
    best = nearest(name, names)
    listed = ", ".join(names) if names else "nothing here"
    return f"'{best}'? (there are: {listed})" if best else f"one of: {listed}"


def _node(key: str, sections: Mapping[str, Any]) -> str | None:
    name = "/" + key.strip("/")
    return name if name in sections else None


def shown(value: Any) -> str:
    """A value as in the file, cut where it is long."""
    text = json.dumps(value, default=str)
    return text if len(text) <= _LONGEST_SHOWN else text[: _LONGEST_SHOWN - 3] + "..."


def _no_such_key(where: str, key: str, sections: Tree, run_keys: Collection[str]) -> ScenarioError:
    nodes = [name.lstrip("/") for name in sections if name != EVERYWHERE]
    return ScenarioError(where, f"unknown key '{key}'", choice(key, [*nodes, *run_keys]))


def _yaml_problem(error: yaml.YAMLError) -> str:
    mark = getattr(error, "problem_mark", None)
    problem = getattr(error, "problem", None) or str(error)
    return f"line {mark.line + 1}, column {mark.column + 1}: {problem}" if mark else problem
