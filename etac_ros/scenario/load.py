"""Load a scenario: find its file, lay variant and overrides over it, validate it before anything starts."""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.maths.ticks import whole_ticks
from etac_ros.scenario.build import build, node_parameters
from etac_ros.scenario.classes import validated
from etac_ros.scenario.document import (
    EVERYWHERE,
    Tree,
    has_place,
    merged,
    nearest,
    read_sections,
    variants_of,
    with_override,
    with_variant,
    write_sections,
)
from etac_ros.scenario.faults import field_names
from etac_ros.scenario.formation import FORMATION, expanded, of_one
from etac_ros.scenario.schema import NodeSection, PublishedFigure, RunSection
from etac_ros.scenario.values import with_value

_RUN_KEYS = [*field_names(RunSection), FORMATION]
_NODE_NAME = re.compile(r"(/[A-Za-z_][A-Za-z0-9_]*)+")


@dataclass(frozen=True)
class Scenario:
    """A validated scenario with variant and overrides applied.

    Attributes
    ----------
    name
        Name of the experiment.
    run
        What concerns the whole run.
    nodes
        Parameters of every node, complete with defaults, in the file's order.
    variant
        The variant that was chosen; None is the file as it stands.
    overrides
        What ``--set`` changed.
    variants
        Names of all variants in the file.
    path
        Where it was read from.
    """

    name: str
    run: RunSection
    nodes: Mapping[str, Mapping[str, Any]]
    variant: str | None
    overrides: Mapping[str, Any]
    variants: tuple[str, ...]
    path: Path

    @property
    def end_tick(self) -> int:
        """The first tick that is not acted on."""
        return whole_ticks(self.run.duration_s, self.run.ticks_per_second)

    @property
    def published(self) -> Mapping[str, PublishedFigure]:
        """The paper's figures by key."""
        return self.run.published.figures

    @property
    def text(self) -> str:
        """The complete parameter file of this run."""
        everywhere = self.run.model_dump(mode="json", by_alias=True, exclude_none=True, exclude={"compare", "tradeoff"})
        if not everywhere["dispersion"]:
            del everywhere["dispersion"]
        return write_sections({EVERYWHERE: everywhere, **self.nodes})

    @property
    def digest(self) -> str:
        """Digest of everything that bears on the result: processes compare it before they run together."""
        everywhere = self.run.model_dump(
            mode="json",
            by_alias=True,
            exclude={"published", "title", "baseline", "compare", "windows", "variant", "dispersion", "tradeoff"},
        )
        # Keys stay in order: that of the nodes and links is the order of sums and bags.
        canonical = json.dumps({EVERYWHERE: everywhere, **self.nodes})
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]

    def with_values(self, values: Mapping[str, Any], seed: int) -> Scenario:
        """The scenario with other values of its nodes and another seed, without reading its file again.

        Parameters
        ----------
        values
            By NODE.KEY, as behind ``--set``. Each replaces one that is there.
        seed
            Of the noise and the lossy links.

        Returns
        -------
        Scenario
            Its values are as long unchecked as it is not built.

        Raises
        ------
        ScenarioError
            If a key is not there.
        """
        nodes = self.nodes
        for key, value in values.items():
            nodes = with_value(nodes, key, value, str(self.path))
        return replace(
            self,
            run=self.run.model_copy(update={"seed": seed}),
            nodes=nodes,
            overrides={**self.overrides, **values, "seed": seed},
        )

    def build(self) -> Graph:
        """A fresh graph of this scenario's modules."""
        return build(self.run, self.nodes, self.end_tick, str(self.path))


def find(name: str) -> Path:
    """The file of a scenario, by name or by path.

    Raises
    ------
    ScenarioError
        If there is none; the message names the nearest that exists.
    """
    given = Path(name)
    if given.suffix in (".yaml", ".yml"):
        if given.is_file():
            return given
        raise ScenarioError(name, "there is no such file")
    folders = config_folders()
    for folder in folders:
        path = folder / f"{name}.yaml"
        if path.is_file():
            return path
    known = sorted({path.stem for folder in folders for path in folder.glob("*.yaml")})
    best = nearest(name, known)
    expected = f"'{best}'? (there are: {', '.join(known)})" if best else f"one of: {', '.join(known)}"
    raise ScenarioError(f"scenario '{name}'", "there is none of this name", expected, "or give a path to a .yaml")


def config_folders() -> list[Path]:
    """Where scenario files stand: beside the package in a checkout, or in a share folder once installed."""
    checkout = Path(__file__).resolve().parents[2] / "config"
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    shares = [Path(prefix) / "share" / "etac_ros" / "config" for prefix in prefixes if prefix]
    return [folder for folder in [checkout, *dict.fromkeys(shares)] if folder.is_dir()]


def available() -> list[str]:
    """Names of the scenarios that are shipped."""
    return sorted({path.stem for folder in config_folders() for path in folder.glob("*.yaml")})


def load(name: str, variant: str | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """Load and validate a scenario.

    Parameters
    ----------
    name
        Name of a file in ``config/``, or a path to one.
    variant
        A named block of the file to lay over it.
    overrides
        ``key=value`` assignments, applied after the variant, in order.

    Raises
    ------
    ScenarioError
        If anything at all is wrong with it; a scenario that loads can be built.
    """
    path = find(name)
    sections = read_sections(path)
    if variant is not None:
        sections = _with_own_figures(sections, with_variant(sections, variant, str(path), _RUN_KEYS), variant, path)
    # What concerns a template or the formation itself comes first; then every spacecraft has nodes of its own.
    templates = [text for text in overrides if has_place(sections, text, _RUN_KEYS) and not of_one(sections, text)]
    changed: dict[str, Any] = {}
    for assignment in templates:
        sections, key, value = with_override(sections, assignment, _RUN_KEYS)
        changed[key] = value
    sections = expanded(sections, str(path))
    for assignment in (assignment for assignment in overrides if assignment not in templates):
        sections, key, value = with_override(sections, assignment, _RUN_KEYS)
        changed[key] = value
    return _validated(sections, path, variant, changed)


def _with_own_figures(file: Tree, laid: Tree, variant: str, path: Path) -> Tree:
    """The sections of a variant without the figures that the paper publishes for the file as it stands.

    Only a variant that changes nothing keeps them; every other has its own or none.
    """
    block = variants_of(file, str(path))[variant]
    published = file[EVERYWHERE].get("published")
    if not block or not isinstance(published, dict):
        return laid
    kept = {key: value for key, value in published.items() if key == "source"}
    own = merged(kept, block.get("published") or {})
    return {**laid, EVERYWHERE: {**laid[EVERYWHERE], "published": own}}


def _validated(sections: Tree, path: Path, variant: str | None, overrides: Mapping[str, Any]) -> Scenario:
    everywhere = dict(sections[EVERYWHERE])
    variants = tuple(variants_of(sections, str(path)))
    everywhere.pop("variants", None)
    if variant is not None:
        everywhere["variant"] = variant
    run = validated(RunSection, everywhere, f"{path}: {EVERYWHERE}")
    try:
        whole_ticks(run.duration_s, run.ticks_per_second)
    except ValueError as error:
        raise ScenarioError(
            f"{path}: {EVERYWHERE}.duration_s",
            str(error),
            f"a whole number of ticks of 1/{run.ticks_per_second} s",
        ) from None
    nodes: dict[str, Mapping[str, Any]] = {}
    for name, body in sections.items():
        if name == EVERYWHERE:
            continue
        if not _NODE_NAME.fullmatch(name):
            raise ScenarioError(f"{path}: {name}", "is no name of a ROS node", "letters, digits and _ between /")
        section = validated(NodeSection, body, f"{path}: {name}")
        nodes[name] = node_parameters(section, f"{path}: {name}")
    scenario = Scenario(run.scenario, run, nodes, run.variant, overrides, variants, path)
    scenario.build()
    return scenario
