"""From the section ``faults`` of a run to what happens to the process of which module, in ticks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import pairwise

from etac_ros.errors import ScenarioError
from etac_ros.graph.faults import Fault, FaultKind
from etac_ros.graph.graph import Graph
from etac_ros.graph.module import Module
from etac_ros.graph.plant import PlantModule
from etac_ros.maths.ticks import whole_ticks
from etac_ros.modules.sensing_controller import SensingController
from etac_ros.scenario.document import EVERYWHERE, choice
from etac_ros.scenario.schema import FaultSection, RunSection


def faults_of(run: RunSection, modules: Mapping[str, Module], end_tick: int, file: str) -> tuple[Fault, ...]:
    """The faults of a run, in the order in which they begin.

    Raises
    ------
    ScenarioError
        If one concerns nobody, or what cannot fail, or lies off the grid or beyond the run, or two overlap.
    """
    key = f"{file}: {EVERYWHERE}.faults"
    found = [_fault(name, section, run, modules, end_tick, f"{key}.{name}") for name, section in run.faults.items()]
    found.sort(key=lambda fault: fault.from_tick)
    for node in modules:
        for one, other in pairwise(fault for fault in found if fault.node == node):
            if other.from_tick < one.until_tick:
                until = "for good" if one.kind is FaultKind.KILL else f"until {_s(one.until_tick, run):g} s"
                raise ScenarioError(
                    f"{key}.{other.name}.at_s",
                    f"begins at {_s(other.from_tick, run):g} s, and {node} is down {until}, by '{one.name}'",
                    "faults of one node one after the other",
                )
    return tuple(found)


def spares_of(faults: tuple[Fault, ...], make: Callable[[str], Module]) -> dict[str, Module]:
    """The module that takes the place of each one that is restarted."""
    return {fault.name: make(fault.node) for fault in faults if fault.kind is FaultKind.RESTART}


def check_faults(graph: Graph, file: str) -> None:
    """What only the whole graph can tell of them.

    Raises
    ------
    ScenarioError
        If a module has a fault that goes by what is acknowledged, or that somebody else plays.
    """
    for fault in graph.faults:
        where = f"{file}: {EVERYWHERE}.faults.{fault.name}.node"
        if fault.node in graph.external:
            raise ScenarioError(where, f"{fault.node} is played by a foreign node", "a node that etac_ros starts")
        if fault.node in graph.told:
            raise ScenarioError(
                where,
                f"{fault.node} waits for acknowledgements, which would come while it is down",
                "a sender that does not",
                "compares_with: sent, in the key 'acknowledged' of its links",
            )


def _fault(
    name: str, section: FaultSection, run: RunSection, modules: Mapping[str, Module], end_tick: int, where: str
) -> Fault:
    node = "/" + section.node.strip("/")
    able = [one for one, module in modules.items() if not isinstance(module, PlantModule)]
    if node not in modules:
        raise ScenarioError(f"{where}.node", f"there is no node '{node}'", choice(node, able))
    module = modules[node]
    if isinstance(module, PlantModule):
        raise ScenarioError(
            f"{where}.node", f"{node} is a plant, and physics does not stop", f"one of: {', '.join(able)}"
        )
    reason = _why_not(module, section.do)
    if reason:
        raise ScenarioError(f"{where}.do", f"{section.do.value} {node}: {reason}", "another node, or another fault")
    start = _ticks(section.at_s, run, f"{where}.at_s")
    if start >= end_tick:
        raise ScenarioError(f"{where}.at_s", f"found {section.at_s:g}, and the run ends at {run.duration_s:g} s")
    until = end_tick
    if section.for_s is not None:
        until = start + _ticks(section.for_s, run, f"{where}.for_s")
        if until >= end_tick:
            raise ScenarioError(
                f"{where}.for_s",
                f"it would go on at {_s(until, run):g} s, and the run ends at {run.duration_s:g} s",
                "a shorter time, or do: kill",
            )
    return Fault(name, node, section.do, start, until)


def _why_not(module: Module, kind: FaultKind) -> str:
    """Why a module cannot have a fault; empty if it can.

    Reports make the memory of a law with memory anew from the samples, which is one memory for the whole run.
    """
    if isinstance(module, SensingController) and kind is FaultKind.RESTART:
        return "the memory of its law needs every sample from the start on"
    return ""


def _ticks(time_s: float, run: RunSection, where: str) -> int:
    if time_s == 0.0:
        return 0
    try:
        return whole_ticks(time_s, run.ticks_per_second)
    except ValueError as error:
        raise ScenarioError(where, str(error), f"a whole number of ticks of 1/{run.ticks_per_second} s") from None


def _s(tick: int, run: RunSection) -> float:
    return tick / run.ticks_per_second
