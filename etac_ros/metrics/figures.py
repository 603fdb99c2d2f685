"""The figures of a run: what identifies one, what it is called, and which of them a formation has alike."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from typing import NamedTuple

_LABELS = {
    "triggers": "triggering instants",
    "min_interval_s": "shortest interval [s]",
    "mean_interval_s": "mean interval [s]",
    "steady_mean_interval_s": "mean interval, steady [s]",
    "max_interval_s": "longest interval [s]",
    "network_messages": "network messages",
    "network_deliveries": "network deliveries",
    "network_payload_bytes": "network payload [bytes]",
    "baseline_messages": "baseline's network messages",
    "baseline_payload_bytes": "baseline's payload [bytes]",
    "message_reduction_percent": "fewer messages [%]",
    "reduction_percent": "fewer bytes as sent [%]",
    "equal_content_reduction_percent": "fewer bytes at equal content [%]",
    "energy_n2m2s": "energy [N²m²s]",
    "energy_reduction_percent": "less energy [%]",
    "trigger_reduction_percent": "fewer triggers [%]",
    "sent_reduction_percent": "smaller sum of |u(t_k)| [%]",
    "attitude_error_deg": "error at the end [deg]",
    "max_attitude_error_deg": "steady error [deg]",
    "max_rate_deg_s": "steady rate [deg/s]",
    "baseline_more_triggers": "baseline's triggers beyond these",
    "baseline_more_energy_n2m2s": "baseline's energy beyond this [N²m²s]",
}
INTERVALS = ("min_interval_s", "mean_interval_s", "steady_mean_interval_s", "max_interval_s")
OF_SENSORS = frozenset({"triggers", *INTERVALS, "trigger_reduction_percent", "sent_reduction_percent"})
"""Figures that every module has which triggers."""
_STAND_ALONE = frozenset(
    {
        "triggers",
        "max_interval_s",
        "network_messages",
        "network_payload_bytes",
        "baseline_messages",
        "baseline_payload_bytes",
        "message_reduction_percent",
        "reduction_percent",
        "equal_content_reduction_percent",
    }
)
"""Figures of every run that a table shows although nothing published stands beside them."""


class FigureKey(NamedTuple):
    """What identifies a figure of a run.

    Attributes
    ----------
    name
        Which figure.
    node
        Full name of the node whose figure it is; None for a figure of the whole run, and for one of the only sensor or
        the only plant.
    """

    name: str
    node: str | None = None

    def __str__(self) -> str:
        """As a column of a table is called: ``triggers``, ``triggers /sc1/sensor``. No two keys have the same."""
        return self.name if self.node is None else f"{self.name} {self.node}"

    @classmethod
    def parse(cls, text: str) -> FigureKey:
        """The inverse of ``str``."""
        name, space, node = text.rpartition(" ")
        return cls(name, node) if space and node.startswith("/") else cls(text)


def key_of(name: str, node: str | None, nodes: Collection[str]) -> FigureKey:
    """The key of a node's figure among all nodes that have it: the only one is not named."""
    return FigureKey(name, None if tuple(nodes) == (node,) else node)


def label(key: FigureKey, own: str = "") -> str:
    """What a figure is called in a table.

    Parameters
    ----------
    key
        The figure.
    own
        What the scenario calls it; empty where it has no words of its own.
    """
    words = own or _LABELS.get(key.name, key.name.replace("_", " "))
    return words if key.node is None else f"{words}, {key.node}"


def stands_alone(key: FigureKey, own: Collection[FigureKey] = ()) -> bool:
    """Whether a table shows a figure although nothing published stands beside it; ``own`` ones it does."""
    return key.name in _STAND_ALONE or key in own


def families(keys: Iterable[FigureKey]) -> list[dict[str, FigureKey]]:
    """Figures that several nodes of a formation have alike, each by namespace.

    Alike are figures of one name whose nodes have the same name in different namespaces; only where at least two
    have it.
    """
    found: dict[tuple[str, str], dict[str, FigureKey]] = {}
    for key in keys:
        if key.node is not None:
            namespace, _, base = key.node.rpartition("/")
            found.setdefault((key.name, base), {})[namespace] = key
    return [members for members in found.values() if len(members) > 1]


def of_nodes(name: str, nodes: Sequence[str]) -> tuple[FigureKey, ...]:
    """The keys under which a figure of these nodes may stand, that of an only node among them."""
    return (FigureKey(name), *(FigureKey(name, node) for node in nodes))
