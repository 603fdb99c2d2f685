"""What the shell offers when TAB is pressed: scenarios, and the variants of the one that stands there."""

from __future__ import annotations

import typer

from etac_ros.errors import EtacError


def scenarios(incomplete: str) -> list[str]:
    """Scenarios that are shipped; a path is the shell's own business."""
    from etac_ros.scenario.places import available

    return [name for name in available() if name.startswith(incomplete)]


def variants(context: typer.Context, incomplete: str) -> list[str]:
    """Variants of the scenario that was typed before."""
    from etac_ros.scenario.load import load

    for name in (context.params.get("scenario"), *context.args):  # what is typed first is not assigned yet
        if isinstance(name, str) and not name.startswith("-"):
            try:
                return [variant for variant in load(name).variants if variant.startswith(incomplete)]
            except EtacError:
                continue
    return []
