"""A run in real time beside simulated ones: with how many ticks of delay the simulation agrees best."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from etac_ros.graph.graph import Graph, LinkKind
from etac_ros.graph.recording import Recording


def with_delayed_torques(graph: Graph, ticks: int) -> Graph:
    """A graph whose plants feel what is sent to them so many ticks later: what real time does to a loop, at the least.

    Parameters
    ----------
    graph
        Freshly built.
    ticks
        Added to the delay of each physical link.
    """
    links = {
        name: replace(link, channel=replace(link.channel, delay_ticks=link.channel.delay_ticks + ticks))
        if link.kind is LinkKind.PHYSICAL and ticks
        else link
        for name, link in graph.links.items()
    }
    return replace(graph, links=links)


def states_apart(graph: Graph, one: Recording, other: Recording) -> float:
    """How far the states of two runs are apart, relative to how much they move.

    The root mean square of their difference over all ticks that both have and all states, each in units of its own
    standard deviation in the second run; states that do not move are left out.
    """
    parts = []
    for plant in graph.plants:
        (_, left), (_, right) = one.samples(plant), other.samples(plant)
        count = min(len(left), len(right))
        spread = right[:count].std(axis=0)
        moves = spread > 0.0
        parts.append((((left[:count] - right[:count])[:, moves] / spread[moves]) ** 2).ravel())
    squares = np.concatenate(parts) if parts else np.zeros(0)
    return float(np.sqrt(squares.mean())) if squares.size else 0.0


@dataclass(frozen=True)
class Agreement:
    """How well simulated runs with delays agree with one in real time.

    Attributes
    ----------
    apart
        By delay in ticks, from 0 on: :func:`states_apart`.
    """

    apart: Sequence[float]

    @property
    def best(self) -> int:
        """The delay that agrees best [ticks]; the smaller of two that do equally."""
        return int(np.argmin(self.apart))
