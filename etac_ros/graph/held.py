"""What a plant holds at its inputs: a zero-order hold for each link, summed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from etac_ros.graph.module import Arrivals
from etac_ros.parameters import FloatArray


class HeldInputs:
    """The zero-order holds at the input ports of a plant, one for each link.

    A link holds its newest value until its next one. Where several links lead to one port, as from two sets of
    actuators, the port's input is the sum of what each of them holds, added in the order of the links. A link that
    has not delivered yet adds nothing.

    Parameters
    ----------
    sizes
        Components of each port; the held input is their concatenation in this order.
    links
        Names of the links that lead to the ports, in the order of the graph.
    """

    def __init__(self, sizes: Mapping[str, int], links: Sequence[str] = ()) -> None:
        self._places: dict[str, slice] = {}
        offset = 0
        for port, size in sizes.items():
            self._places[port] = slice(offset, offset + size)
            offset += size
        self._size = offset
        self._order = {link: place for place, link in enumerate(links)}
        self._held: dict[str, dict[str, FloatArray]] = {port: {} for port in sizes}

    def take(self, arrivals: Arrivals) -> FloatArray:
        """Hold what arrives in one step; of several values of one link the newest counts.

        Returns
        -------
        ndarray
            The input held from now on: a new array each time.
        """
        for arrival in arrivals:
            of_port = self._held[arrival.port]
            self._order.setdefault(arrival.link, len(self._order))
            of_port[arrival.link] = arrival.value
        return self.total()

    def total(self) -> FloatArray:
        """The input that is held now: a new array each time."""
        if len(self._places) == 1:
            (of_port,) = self._held.values()
            if len(of_port) == 1:  # as mostly
                (value,) = of_port.values()
                return value.copy()
        total = np.zeros(self._size)
        for port, place in self._places.items():
            in_order = sorted(self._held[port].items(), key=lambda item: self._order[item[0]])
            values = [value for _, value in in_order]
            for number, value in enumerate(values):
                total[place] = value if number == 0 else total[place] + value
        return total
