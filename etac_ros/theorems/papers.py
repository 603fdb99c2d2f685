"""The theorems of each paper, by the name of its scenario."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from etac_ros.graph.recording import Recording
from etac_ros.scenario.load import Scenario
from etac_ros.theorems import flexible, qi2022, shi2022, wu2018, xie2021
from etac_ros.theorems.bound import Theorems
from etac_ros.theorems.evidence import Evidence, NotApplicable


@dataclass(frozen=True)
class Paper:
    """The theorems of a paper, and the classes of the loop that they are about."""

    theorems: Callable[[Evidence], Theorems]
    about: frozenset[str]


_RELATIVE = "etac_ros.triggers.relative:RelativeThreshold"
_PROPORTIONAL = "etac_ros.laws.wu2018:Proportional"

PAPERS: Mapping[str, Paper] = {
    "wu2018": Paper(wu2018.theorems, frozenset({_RELATIVE, _PROPORTIONAL, "etac_ros.laws.wu2018:FilteredError"})),
    "qi2022": Paper(
        qi2022.theorems,
        frozenset({"etac_ros.triggers.state_relative:StateRelativeThreshold", "etac_ros.laws.qi2022:SmLfpd"}),
    ),
    "flexible": Paper(
        flexible.theorems, frozenset({_RELATIVE, _PROPORTIONAL, "etac_ros.laws.flexible:FeedbackVector"})
    ),
    "shi2022": Paper(
        shi2022.theorems,
        frozenset(
            {
                "etac_ros.triggers.componentwise:ComponentThreshold",
                "etac_ros.laws.shi2022:AdaptivePrescribedPerformance",
            }
        ),
    ),
    "xie2021": Paper(
        xie2021.theorems,
        frozenset({"etac_ros.triggers.split_norm:SplitNormThreshold", "etac_ros.laws.xie2021:CoordinationTorque"}),
    ),
}


def theorems_of(scenario: Scenario, recording: Recording) -> Theorems | None:
    """What the scenario's paper proves, beside a run of it.

    Returns
    -------
    Theorems or None
        None where the scenario is of no paper whose theorems are known here, or of another loop than they are about: a
        time-triggered one, another law, the trigger in another place.
    """
    paper = PAPERS.get(scenario.name)
    if paper is None or not paper.about <= _classes(scenario):
        return None
    try:
        return paper.theorems(Evidence(scenario, scenario.build(), recording))
    except NotApplicable:
        return None


def _classes(scenario: Scenario) -> set[str]:
    """Classes of all components of all nodes."""
    components = [part for node in scenario.nodes.values() for part in node.values() if isinstance(part, dict)]
    return {str(component["class"]) for component in components if "class" in component}
