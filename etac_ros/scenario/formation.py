"""A formation in a scenario file: from one template for all spacecraft to nodes and links for each.

Node templates have names that begin with ``/*/``, as have keys of ``dispersion``; a link is a template where its
``from`` contains ``{self}``. In them stand, in braces:

``{self}``, ``{number}``
    Namespace of the spacecraft, such as ``sc1``, and its number, 1.
``{neighbours}``, ``{listeners}``
    Namespaces that it hears, and that hear it, in ascending order. In a text of ``to`` they stand for one text each.
``{listener}``
    In ``from`` and ``to`` of a link: one link for each listener.
``{weights}``
    The weights ``a_ij`` of its neighbours.
``{NAME}``
    Its part of the list ``formation.values.NAME``.

A text that is nothing but braces becomes the value itself, a list for instance.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from copy import deepcopy
from typing import Any

from pydantic import Field, FiniteFloat, NonNegativeFloat, NonNegativeInt, PositiveInt

from etac_ros.errors import ScenarioError
from etac_ros.graph.topics import EMULATION
from etac_ros.laws.digraph import Digraph, ring_with_random_edges
from etac_ros.maths.noise import stream_key, uniforms
from etac_ros.parameters import Parameters
from etac_ros.scenario.classes import validated
from etac_ros.scenario.document import EVERYWHERE, FORMATION, TEMPLATE, Tree, choice, merged, shown

_PAIR = "{listener}"
_BRACES = re.compile(r"\{(\w+)\}")
_EDGE = re.compile(r"\s*(\d+)\s*->\s*(\d+)\s*")


class FormationSection(Parameters):
    """Who hears whom, and what differs from one spacecraft to the next."""

    n: PositiveInt = Field(
        le=1000, description="spacecraft; another number than the adjacency matrix has generates a graph"
    )
    prefix: str = Field(
        default="sc", pattern=r"^[A-Za-z][A-Za-z0-9_]*$", description="namespaces are PREFIX1, PREFIX2, ..."
    )
    adjacency: tuple[FiniteFloat, ...] = Field(
        default=(), description="a_ij, row by row: row i is whom spacecraft i hears; empty: nobody hears anybody"
    )
    extra_edges: NonNegativeInt | None = Field(
        default=None, description="of a generated graph, beside its ring; default n"
    )
    seed: NonNegativeInt = Field(default=1, description="of a generated graph, and of what is scattered")
    values: dict[str, tuple[FiniteFloat, ...]] = Field(default={}, description="one part a row of the matrix")
    scattered: tuple[str, ...] = Field(default=(), description="values that spacecraft beyond the matrix get scaled")
    scatter: NonNegativeFloat = Field(default=0.1, lt=1.0, description="largest relative change of what is scattered")
    outages: dict[str, tuple[FiniteFloat, ...]] = Field(
        default={}, description='"1->2": [from, until, ...] in seconds: when this edge carries nothing'
    )


def of_one(sections: Tree, assignment: str) -> bool:
    """Whether a ``key=value`` concerns a link of one spacecraft, which is there only once templates are written out."""
    first, _, rest = assignment.partition("=")[0].strip().partition(".")
    return FORMATION in sections[EVERYWHERE] and first == "links" and rest.partition(".")[0] not in _links_of(sections)


def expanded(sections: Tree, file: str) -> Tree:
    """The sections with every template written out; unchanged where there is no formation.

    Parameters
    ----------
    sections
        The tree, after variant and overrides.
    file
        For messages.

    Raises
    ------
    ScenarioError
        If the graph has no spanning tree (xie2021, assumption 1), or a template asks for what there is not.
    """
    if FORMATION not in sections[EVERYWHERE]:
        return sections
    where = f"{file}: {EVERYWHERE}.{FORMATION}"
    everywhere = deepcopy(sections[EVERYWHERE])
    formation = validated(FormationSection, everywhere.pop(FORMATION), where)
    graph = _graph(formation, where)
    names = [f"{formation.prefix}{i + 1}" for i in range(graph.size)]
    outages = _outages(formation, graph, names, where)
    nodes: dict[str, Any] = {}
    links: dict[str, Any] = {}
    templates = {name: body for name, body in sections.items() if name.startswith(TEMPLATE)}
    for i, name in enumerate(names):
        known = {
            "self": name,
            "number": i + 1,
            "neighbours": [names[j] for j in graph.in_neighbours(i)],
            "listeners": [names[j] for j in graph.out_neighbours(i)],
            "weights": list(graph.weights(i)),
            **_values(formation, i, where),
        }
        for template, body in templates.items():
            nodes[f"/{name}/{template.removeprefix(TEMPLATE)}"] = _filled(body, known, f"{file}: {template}")
        for link, body in _links_of(sections).items():
            if _is_template(body):
                links.update(_links(link, body, known, outages, f"{file}: {EVERYWHERE}.links.{link}"))
            else:
                links[link] = body
    if isinstance(everywhere.get("links"), dict):
        everywhere["links"] = links
    if isinstance(everywhere.get("dispersion"), dict):
        everywhere["dispersion"] = _for_each(everywhere["dispersion"], names)
    others = {name: body for name, body in sections.items() if name != EVERYWHERE and not name.startswith(TEMPLATE)}
    # A section of one spacecraft is laid over what the template gives it.
    own = {name: merged(nodes[name], body) if name in nodes else body for name, body in others.items()}
    return {EVERYWHERE: everywhere, **own, **{name: body for name, body in nodes.items() if name not in own}}


def _links_of(sections: Tree) -> Mapping[str, Any]:
    """The links of the file; none where something else stands there, which is refused later with all other keys."""
    found = sections[EVERYWHERE].get("links")
    return found if isinstance(found, dict) else {}


def _for_each(dispersion: Mapping[str, Any], names: list[str]) -> dict[str, Any]:
    """What is drawn, with a key of a template written out for each spacecraft."""
    found: dict[str, Any] = {}
    for key, value in dispersion.items():
        bare = str(key).lstrip("/")
        found.update({f"{name}/{bare[2:]}": value for name in names} if bare.startswith("*/") else {key: value})
    return found


def _graph(formation: FormationSection, where: str) -> Digraph:
    if not formation.adjacency:
        return Digraph.from_rows([[0.0] * formation.n] * formation.n)
    try:
        printed = Digraph.from_flat(formation.adjacency)
        if printed.size == formation.n:
            printed.require_spanning_tree()
            return printed
    except ValueError as error:
        raise ScenarioError(f"{where}.adjacency", str(error)) from None
    room = formation.n * (formation.n - 1) - formation.n
    extra = min(formation.n, max(room, 0)) if formation.extra_edges is None else formation.extra_edges
    try:
        return ring_with_random_edges(formation.n, extra, formation.seed)
    except ValueError as error:
        raise ScenarioError(f"{where}.n", f"no graph for {formation.n} spacecraft: {error}") from None


def _values(formation: FormationSection, i: int, where: str) -> dict[str, list[float]]:
    given = math.isqrt(len(formation.adjacency)) or formation.n
    found = {}
    for name, numbers in formation.values.items():
        size, rest = divmod(len(numbers), given)
        if rest or not size:
            raise ScenarioError(
                f"{where}.values.{name}",
                f"{len(numbers)} numbers",
                f"a multiple of {given}: a part for each spacecraft",
            )
        part = list(numbers[size * (i % given) : size * (i % given + 1)])
        if i >= given and name in formation.scattered:
            draws = uniforms(stream_key(formation.seed, f"formation/{name}"), i, 1, size)[0]
            part = [
                value * (1.0 + formation.scatter * (2.0 * float(u) - 1.0)) for value, u in zip(part, draws, strict=True)
            ]
        found[name] = part
    for name in formation.scattered:
        if name not in formation.values:
            raise ScenarioError(f"{where}.scattered", f"found '{name}'", choice(name, formation.values))
    return found


def _outages(
    formation: FormationSection, graph: Digraph, names: list[str], where: str
) -> dict[tuple[str, str], list[float]]:
    found = {}
    for edge, times in formation.outages.items():
        match = _EDGE.fullmatch(edge)
        if match is None:
            raise ScenarioError(f"{where}.outages", f"found '{edge}'", 'an edge such as "1->2"')
        sender, receiver = (int(number) - 1 for number in match.groups())
        if not 0 <= sender < graph.size or receiver not in graph.out_neighbours(sender):
            edges = [f"{j + 1}->{k + 1}" for j in range(graph.size) for k in graph.out_neighbours(j)]
            raise ScenarioError(f"{where}.outages", f"there is no edge {edge}", choice(edge, edges))
        found[names[sender], names[receiver]] = list(times)
    return found


def _is_template(link: Any) -> bool:
    return isinstance(link, dict) and "{self}" in str(link.get("from", ""))


def _links(
    name: str,
    body: Mapping[str, Any],
    known: Mapping[str, Any],
    outages: Mapping[tuple[str, str], list[float]],
    where: str,
) -> dict[str, Any]:
    """One link of a spacecraft, or one for each of its listeners; none where nobody would receive it."""
    own = known["self"]
    physical = str(body.get("kind")) == "physical"
    listeners = known["listeners"] if _PAIR in str(body.get("from", "")) else [None]
    wanted = body.get("to") or ()
    if not isinstance(wanted, list | tuple):
        raise ScenarioError(f"{where}.to", f"found {shown(wanted)}", "a list")
    found = {}
    for listener in listeners:
        here = {**known, "listener": listener}
        tail = name if listener is None else f"{name}_{listener}"
        receivers = [text for item in wanted for text in _receivers(str(item), here, where)]
        if not receivers:
            continue
        link = {
            "topic": f"{EMULATION if physical else ''}/{own}/{tail}",
            **_filled({key: value for key, value in body.items() if key != "to"}, here, where),
            "to": receivers,
        }
        down = {
            f"/{text.partition(':')[0].strip('/')}": outages[own, text.strip("/").partition("/")[0]]
            for text in receivers
            if (own, text.strip("/").partition("/")[0]) in outages
        }
        found[f"{own}_{tail}"] = {**link, "outages": down} if down else link
    return found


def _receivers(item: str, known: Mapping[str, Any], where: str) -> list[str]:
    """The texts that one text of ``to`` stands for."""
    for several in ("neighbours", "listeners"):
        if f"{{{several}}}" in item:
            return [str(_filled(item.replace(f"{{{several}}}", name), known, where)) for name in known[several]]
    return [str(_filled(item, known, where))]


def _filled(value: Any, known: Mapping[str, Any], where: str) -> Any:
    if isinstance(value, dict):
        return {key: _filled(item, known, f"{where}.{key}") for key, item in value.items()}
    if isinstance(value, list):
        return [_filled(item, known, where) for item in value]
    if not isinstance(value, str):
        return value
    whole = _BRACES.fullmatch(value)
    if whole is not None:
        return deepcopy(_of(whole[1], known, where))
    return _BRACES.sub(lambda match: str(_of(match[1], known, where)), value)


def _of(name: str, known: Mapping[str, Any], where: str) -> Any:
    if name not in known:
        raise ScenarioError(where, f"found '{{{name}}}'", choice(name, known))
    return known[name]
