"""What of a scenario has published figures."""

from __future__ import annotations

from etac_ros.errors import ScenarioError
from etac_ros.scenario.load import Scenario, load


def published_variants(name: str) -> list[Scenario]:
    """The variants of a scenario with published figures; of those that change nothing, the file as it stands."""
    base = load(name)
    found = [base] if base.published else []
    for variant in base.variants:
        try:
            scenario = load(name, variant)
        except ScenarioError:
            continue  # refused for a reason of its own: there is nothing to measure
        if scenario.published and scenario.digest != base.digest:
            found.append(scenario)
    return found


def title_of(scenario: Scenario) -> str:
    """What is run, in words."""
    return f"{scenario.name} {scenario.variant or ''}".strip()
