"""Load a scenario: find its file, lay variant and overrides over it, validate it before anything starts."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from etac_ros.errors import ScenarioError
from etac_ros.graph.graph import Graph
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.ticks import whole_ticks
from etac_ros.plants.plant import notes_of
from etac_ros.scenario.build import build, node_parameters, rounded_delays
from etac_ros.scenario.classes import validated
from etac_ros.scenario.code import code_digests
from etac_ros.scenario.document import EVERYWHERE, FORMATION, read_sections, variants_of, write_sections
from etac_ros.scenario.faults import field_names
from etac_ros.scenario.places import find
from etac_ros.scenario.precedence import Laid, Layers, as_assignment, laid
from etac_ros.scenario.schema import NodeSection, PublishedFigure, RunSection
from etac_ros.scenario.trust import foreign_classes
from etac_ros.scenario.values import with_value

_RUN_KEYS = [*field_names(RunSection), FORMATION]
BEARS_NOT = {
    "published",
    "title",
    "baseline",
    "compare",
    "windows",
    "state_rate_hz",
    "truth_every",
    "bag_compression",
    "variant",
    "dispersion",
    "tradeoff",
}
"""Keys of the run that bear on no result."""
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
        Where it was read from; the first of several files.
    layers
        What it is made of: file, variant and overrides; None if it was not loaded to be run.
    overruled
        What was given and does not hold, in words.
    """

    name: str
    run: RunSection
    nodes: Mapping[str, Mapping[str, Any]]
    variant: str | None
    overrides: Mapping[str, Any]
    variants: tuple[str, ...]
    path: Path
    layers: Layers | None = field(default=None, repr=False, compare=False)
    overruled: tuple[str, ...] = ()

    @property
    def end_tick(self) -> int:
        """The first tick that is not acted on."""
        return whole_ticks(self.run.duration_s, self.run.ticks_per_second)

    @property
    def published(self) -> Mapping[str, PublishedFigure]:
        """The paper's figures by key."""
        return self.run.published.figures

    @property
    def classes(self) -> Mapping[str, Any]:
        """The parts of the scenario that name classes: its nodes, and the access rules of its media."""
        return {**self.nodes, "media": {name: medium.access for name, medium in self.run.media.items()}}

    @property
    def text(self) -> str:
        """The complete parameter file of this run."""
        return write_sections(self.sections)

    @property
    def told(self) -> str:
        """The same for who listens to a run, as JSON, which takes no time to write; :func:`load_told` reads it."""
        return json.dumps(self.sections)

    @property
    def sections(self) -> dict[str, dict[str, Any]]:
        """The complete parameters of this run, by node; those of the whole run are of ``/**``."""
        everywhere = self.run.model_dump(mode="json", by_alias=True, exclude_none=True, exclude={"compare", "tradeoff"})
        # Without empty mappings: ROS's parser loses its place after one.
        kept: dict[str, dict[str, Any]] = _without_empty({EVERYWHERE: everywhere, **self.nodes})
        return kept

    @property
    def digest(self) -> str:
        """Digest of all that bears on the result, code of users' classes too: processes compare it, and sweeps do."""
        return self._digest(self.run.model_dump(mode="json", by_alias=True, exclude=BEARS_NOT))

    @property
    def content_digest(self) -> str:
        """The same, but for keys of the run at their default: one that a later version adds does not change it."""
        return self._digest(self.run.model_dump(mode="json", by_alias=True, exclude_defaults=True, exclude=BEARS_NOT))

    def _digest(self, everywhere: Mapping[str, Any]) -> str:
        # Keys stay in order: that of the nodes and links is the order of sums and bags.
        canonical = json.dumps({EVERYWHERE: everywhere, **self.nodes})
        if code := code_digests(foreign_classes(self.classes)):
            canonical += json.dumps(code)
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
        changed = {**values, "seed": seed}
        assignments = (as_assignment(key, value) for key, value in changed.items())
        return replace(
            self,
            run=self.run.model_copy(update={"seed": seed}),
            nodes=nodes,
            overrides={**self.overrides, **changed},
            layers=self.layers and replace(self.layers, overrides=(*self.layers.overrides, *assignments)),
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know before the run, a sentence each."""
        return (*self.overruled, *self.rounded, *_notes_of_plants(self.graph))

    @property
    def rounded(self) -> tuple[str, ...]:
        """What is no whole number of ticks, and what became of it, a sentence each."""
        return tuple(rounded_delays(self.run))

    @cached_property
    def graph(self) -> Graph:
        """The graph of this scenario, built once: to look at, or to fork, and never to run in this process."""
        return self.build()

    def build(self) -> Graph:
        """A fresh graph of this scenario's modules, to run."""
        return build(self.run, self.nodes, self.end_tick, str(self.path))

    def __getstate__(self) -> dict[str, Any]:
        # Another process builds its own.
        return {name: value for name, value in self.__dict__.items() if name != "graph"}


def _notes_of_plants(graph: Graph) -> Iterator[str]:
    for name in graph.plants:
        module = graph.modules[name]
        assert isinstance(module, PlantModule)
        for note in notes_of(module.plant):
            yield f"{name}: {note}"


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
    return load_files([name], variant, overrides)


def read_resolved(name: str) -> Scenario:
    """The scenario of a complete parameter file as data: no class that it names is imported.

    Its nodes are as they stand there. It cannot be built before it was loaded by :func:`load`.

    Raises
    ------
    ScenarioError
        If it is no scenario file, or what concerns the whole run is not valid.
    """
    path = Path(name)
    sections = read_sections(path)
    everywhere = {key: value for key, value in sections[EVERYWHERE].items() if key != "variants"}
    run = validated(RunSection, everywhere, f"{path}: {EVERYWHERE}")
    nodes: dict[str, Mapping[str, Any]] = {name: body for name, body in sections.items() if name != EVERYWHERE}
    return Scenario(run.scenario, run, nodes, run.variant, {}, (), path)


def load_files(names: Sequence[str], variant: str | None = None, overrides: Sequence[str] = ()) -> Scenario:
    """Load a scenario from several parameter files, each laid over those before, as ROS does it.

    Parameters
    ----------
    names
        Of files, or paths to them, as several ``--params-file`` give them.
    variant, overrides
        As for :func:`load`.

    Raises
    ------
    ScenarioError
        As :func:`load` does.
    """
    paths = [find(name) for name in names]
    layers = Layers(read_sections(*paths), str(paths[0]), variant, tuple(overrides))
    return _validated(laid(layers, _RUN_KEYS), layers, paths[0], variant)


def load_told(text: str, where: str) -> Scenario:
    """Load what a run tells of its scenario (:attr:`Scenario.told`).

    Parameters
    ----------
    text
        What it tells.
    where
        Who, to begin messages with.

    Raises
    ------
    ScenarioError
        As :func:`load` does.
    """
    try:
        sections = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ScenarioError(where, f"does not tell what it is: {error}") from None
    if not isinstance(sections, dict) or EVERYWHERE not in sections:
        raise ScenarioError(where, f"tells of no section '{EVERYWHERE}'")
    layers = Layers(sections, where)
    return _validated(laid(layers, _RUN_KEYS), layers, Path(where), None)


def baseline_of(scenario: Scenario) -> Scenario | None:
    """The baseline of a run: the same run with what the scenario's ``baseline`` names exchanged, and nothing else.

    See :mod:`etac_ros.scenario.precedence` for what holds where both change the same; the baseline's ``notes`` say
    where that is so.

    Returns
    -------
    Scenario or None
        None if the scenario names no baseline, is the baseline itself, or carries no variants any more, as what
        `etac resolve` prints.

    Raises
    ------
    ScenarioError
        If the baseline does not fit this run.
    """
    name = scenario.run.baseline
    layers = scenario.layers
    if layers is None or name is None or name == scenario.variant or name not in scenario.variants:
        return None
    try:
        return _validated(laid(layers, _RUN_KEYS, name), layers, scenario.path, name)
    except ScenarioError as error:
        where = f"baseline '{name}' of {error.where}"
        raise ScenarioError(where, error.found, error.expected, error.remedy) from None


def _without_empty(value: Any) -> Any:
    if not isinstance(value, Mapping):
        return value
    kept = {key: _without_empty(below) for key, below in value.items()}
    return {key: below for key, below in kept.items() if not isinstance(below, dict) or below}


def _validated(found: Laid, layers: Layers, path: Path, variant: str | None) -> Scenario:
    sections = found.sections
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
    scenario = Scenario(run.scenario, run, nodes, run.variant, found.changed, variants, path, layers, found.notes)
    _ = scenario.graph  # building it is the last check, and it stays with the scenario
    return scenario
