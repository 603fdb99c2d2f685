"""Which value holds where several are given: this order, said once.

1. **The file** (several parameter files: in their order, each over the one before).
2. **The variant**: its block is laid over the file.
3. **--set**, in the order given, over both. Of a formation, what concerns all spacecraft comes before what concerns
   one of them.
4. In **the baseline** of a run, the block of the variant that the key ``baseline`` names, over all of these. So the
   baseline is the run at hand, variant and ``--set`` included, with what the block names exchanged and nothing else.
   A component or node that the block names by ``class`` or ``module`` is the baseline's as a whole: what variant or
   ``--set`` do inside does not concern it. Where both change the same key, the baseline's value holds, and a note
   says so.

Mappings merge key by key; one that names another ``class`` than stood there replaces. The figures of the paper
(``published``) are those of the file for the file and for a variant that changes nothing; every other variant, and the
baseline, has its own or none. Its own may be ``of`` another variant, another reading of the same experiment: the same
figures, without what is said of them with regard to that reading.
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import (
    EVERYWHERE,
    Tree,
    assigned,
    choice,
    has_place,
    laid_over,
    merged,
    node_of,
    shown,
    variants_of,
    with_variant,
)
from etac_ros.scenario.formation import expanded, of_one
from etac_ros.scenario.yaml_text import parse_value

PUBLISHED = "published"
Place = tuple[str, ...]
"""Section and keys below it."""


@dataclass(frozen=True)
class Layers:
    """What stands over what: all that a scenario is made of.

    Attributes
    ----------
    file
        Sections as they were read.
    where
        The file, to begin messages with.
    variant
        Name of the variant; None is the file as it stands.
    overrides
        ``key=value`` assignments.
    """

    file: Tree
    where: str
    variant: str | None = None
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class Laid:
    """The sections that hold.

    Attributes
    ----------
    sections
        Complete, with every template written out.
    changed
        What ``--set`` changed, by key.
    notes
        What was given and does not hold, in words.
    """

    sections: Tree
    changed: dict[str, Any]
    notes: tuple[str, ...] = ()


def laid(layers: Layers, run_keys: Collection[str], baseline: str | None = None) -> Laid:
    """Lay the layers over each other.

    Parameters
    ----------
    layers
        File, variant and overrides.
    run_keys
        The keys of the section ``/**``.
    baseline
        The variant whose block is laid over all of them; None for the run itself.

    Raises
    ------
    ScenarioError
        If a variant, a node or a key is not there.
    """
    file, where = layers.file, layers.where
    sections = file
    if layers.variant is not None:
        sections = with_variant(file, layers.variant, where, run_keys)
        sections = _with_own_figures(file, sections, layers.variant, where)
    templates = [
        text for text in layers.overrides if has_place(sections, text, run_keys) and not of_one(sections, text)
    ]
    of_nodes = [text for text in layers.overrides if text not in templates]
    changed: dict[str, Any] = {}
    changes: dict[str, Tree] = {}
    for text in templates:
        key, value, changes[key] = assigned(sections, text, run_keys)
        sections = laid_over(sections, changes[key])
        changed[key] = value
    taken: tuple[Place, ...] = ()
    if baseline is not None:
        sections, taken = _with_baseline(file, sections, baseline, where, run_keys)
        changed = {key: value for key, value in changed.items() if _without(changes[key], taken)}
    sections = expanded(sections, where)
    for text in of_nodes:
        key, value, change = assigned(sections, text, run_keys)
        kept = _without(change, taken)
        if kept:
            sections = laid_over(sections, kept)
            changed[key] = value
    notes = () if baseline is None else tuple(_notes(layers, baseline, taken, run_keys))
    return Laid(sections, changed, notes)


def _with_own_figures(file: Tree, sections: Tree, variant: str, where: str) -> Tree:
    """The sections without the figures that the paper publishes for the file as it stands.

    Only a variant that changes nothing keeps them.
    """
    block = variants_of(file, where)[variant]
    published = file[EVERYWHERE].get(PUBLISHED)
    if not block or not isinstance(published, dict):
        return sections
    kept = {key: value for key, value in published.items() if key == "source"}
    given = _mapping(block.get(PUBLISHED), f"{where}: {EVERYWHERE}.variants.{variant}.{PUBLISHED}")
    if "of" in given:
        given = merged(_figures_of(str(given.pop("of")), file, variant, where), given)
    own = merged(kept, given)
    return {**sections, EVERYWHERE: {**sections[EVERYWHERE], PUBLISHED: own}}


def _figures_of(other: str, file: Tree, variant: str, where: str) -> Tree:
    """The figures of another variant; of one that changes nothing, those of the file as it stands."""
    variants = variants_of(file, where)
    if other not in variants or other == variant:
        others = [name for name in variants if name != variant]
        key = f"{where}: {EVERYWHERE}.variants.{variant}.{PUBLISHED}.of"
        raise ScenarioError(key, f"found '{other}'", choice(other, others))
    block = variants[other]
    place = f"variants.{other}.{PUBLISHED}" if block else PUBLISHED
    published = _mapping(
        block.get(PUBLISHED) if block else file[EVERYWHERE].get(PUBLISHED), f"{where}: {EVERYWHERE}.{place}"
    )
    return {name: _without_reading(value) for name, value in published.items() if name != "of"}


def _mapping(value: Any, where: str) -> Tree:
    if value is not None and not isinstance(value, dict):
        raise ScenarioError(where, f"found {shown(value)}", "a mapping")
    return dict(value or {})


_OF_A_READING = ("reason", "fitted_to")
"""What is said of a published figure with regard to one reading of the paper."""


def _without_reading(value: Any) -> Any:
    if not isinstance(value, dict):
        return value
    fitted = "fitted_to" in value
    return {
        key: _without_reading(item)
        for key, item in value.items()
        if key not in _OF_A_READING and not (fitted and key == "kind")
    }


def _with_baseline(
    file: Tree, sections: Tree, name: str, where: str, run_keys: Collection[str]
) -> tuple[Tree, tuple[Place, ...]]:
    """The sections with the baseline's block over them, and the places that it takes."""
    alone = with_variant(file, name, where, run_keys)
    block = variants_of(file, where)[name]
    by_section = _by_section(block, file)
    result = {
        section: _exchanged(body, alone[section], by_section[section]) if section in by_section else body
        for section, body in sections.items()
    }
    result = _with_own_figures(file, result, name, where)
    return result, tuple(place for place in _places(by_section) if place[:2] != (EVERYWHERE, PUBLISHED))


def _by_section(block: Tree, sections: Tree) -> Tree:
    """A variant's block as sections."""
    found: Tree = {}
    for key, value in block.items():
        node = node_of(str(key), sections)
        if node is None:
            found.setdefault(EVERYWHERE, {})[key] = value
        else:
            found[node] = value
    return found


def _exchanged(here: Any, alone: Any, block: Any) -> Any:
    """What stands here, with what the block names as it stands in the baseline alone."""
    if not isinstance(block, dict) or not isinstance(here, dict) or not isinstance(alone, dict) or _is_whole(block):
        return deepcopy(alone)
    result = dict(here)
    for key, value in block.items():
        result[key] = _exchanged(here.get(key), alone[key], value)
    return result


def _is_whole(block: Tree) -> bool:
    return "class" in block or "module" in block


def _places(change: Any, above: Place = ()) -> Iterator[Place]:
    """The places at which a change takes hold; a component or node that is named anew is one place."""
    if isinstance(change, dict) and change and not (above and _is_whole(change)):
        for key, value in change.items():
            yield from _places(value, (*above, str(key)))
    elif above:
        yield above


def _without(change: Tree, taken: Sequence[Place], above: Place = ()) -> Tree:
    """A change without what concerns places that are taken."""
    kept: Tree = {}
    for key, value in change.items():
        place = (*above, str(key))
        if any(_within(place, other) for other in taken):
            continue
        if isinstance(value, dict) and value:
            if _is_whole(value) and any(_within(other, place) for other in taken):
                continue
            below = _without(value, taken, place)
            if below:
                kept[key] = below
        else:
            kept[key] = value
    return kept


def _within(place: Place, other: Place) -> bool:
    """Whether a place is another one or lies below it; of a formation, also where that is a template's."""
    if len(place) < len(other) or not _same_section(place[0], other[0]):
        return False
    return place[1 : len(other)] == other[1:]


def _same_section(one: str, other: str) -> bool:
    first, second = one.strip("/").split("/"), other.strip("/").split("/")
    if EVERYWHERE in (one, other):
        return one == other
    return len(first) == len(second) and all(a == b or "*" in (a, b) for a, b in zip(first, second, strict=True))


def _notes(layers: Layers, baseline: str, taken: Sequence[Place], run_keys: Collection[str]) -> Iterator[str]:
    """Where variant or overrides change what the baseline takes."""
    changes: list[tuple[str, Tree]] = []
    if layers.variant is not None:
        block = variants_of(layers.file, layers.where)[layers.variant]
        changes.append((f"variant '{layers.variant}'", _by_section(block, layers.file)))
    for text in layers.overrides:
        key = text.partition("=")[0].strip()
        first, *rest = key.split(".")
        section = node_of(first, layers.file) or ("/" + first.strip("/"))
        names = [EVERYWHERE, first, *rest] if first in run_keys and section not in layers.file else [section, *rest]
        change: Any = parse_value(text.partition("=")[2], f"--set {key}")
        for name in reversed(names):
            change = {name: change}
        changes.append((f"--set {key}", change))
    for origin, change in changes:
        concerned = dict.fromkeys(
            ".".join(other).replace(f"{EVERYWHERE}.", "").lstrip("/")
            for place in _places(change)
            for other in taken
            if _within(place, other) or _within(other, place)
        )
        if concerned:
            yield f"baseline '{baseline}' keeps its own {', '.join(concerned)}, whatever {origin} says"


def as_assignment(key: str, value: Any) -> str:
    """The ``key=value`` that sets a value; :func:`laid` takes it."""
    return f"{key}={json.dumps(value)}"
