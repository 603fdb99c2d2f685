"""A module together with the window it looks at: what both engines need alike, and the checks of a module's word.

All that a module is told and all that it says passes here, in both engines. So this is where its promises are checked
and where its values are rounded to the wire.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from etac_ros.errors import ProtocolError
from etac_ros.graph.faults import FaultKind
from etac_ros.graph.graph import Graph, Link
from etac_ros.graph.module import Arrival, Module, Window
from etac_ros.graph.promises import Component, are_finite, shown
from etac_ros.maths.finite import all_finite
from etac_ros.parameters import FloatArray

Sent = list[tuple[Link, FloatArray]]
_FLOAT64 = np.dtype(np.float64)


class Driver:
    """Drives one module through windows and ticks.

    Parameters
    ----------
    graph
        The graph that the module stands in.
    name
        The module's full name.
    """

    def __init__(self, graph: Graph, name: str) -> None:
        self.name = name
        self.module: Module = graph.modules[name]
        self.window: Window | None = None
        self._links = graph.sends[name]
        self._connected = {link.port for link in self._links}
        self._senders = {link.name: link.sender for link in graph.hears[name]}
        self._component = Component(name, self.module)
        # Where a class of somebody else may work in place, everybody gets arrays of his own.
        self._shares = graph.all_own
        self._take_ports()
        self._advanced = -1
        self._faults = graph.faults_of(name)
        # Whoever takes its place after a restart, and from which tick on.
        self._spares = deque(
            (fault.until_tick, graph.spares[fault.name]) for fault in self._faults if fault.kind is FaultKind.RESTART
        )

    def see(self, window: Window) -> None:
        """Take a new window; everything before its start is committed."""
        if self.window is not None or self._spares:
            self._advance(window.start - 1)
        if self._shares:
            self.window = window
        else:
            self.window = Window(window.plant, window.epoch, window.start, window.samples.copy())

    def pass_over(self, tick: int) -> None:
        """Commit memory up to a tick at which nothing is done: in real time it may be too late to act."""
        self._advance(tick)

    def look(self, after: int) -> int | None:
        """First tick after ``after`` at which the module acts by itself."""
        if not self._faults:
            return self._scan(self._component, self.window, after)
        self._replace(after + 1)
        component, window = self._component, self.window
        spares = dict(self._spares)
        for fault in self._faults:
            if fault.until_tick <= after + 1:
                continue
            if fault.from_tick > after + 1:
                found = self._scan(component, window, after)
                if found is not None and found < fault.from_tick:
                    return found
            if fault.kind is FaultKind.KILL or window is not None:
                return None  # for ever; or until the next window, since one ends where a module goes on
            after = fault.until_tick - 1
            if fault.until_tick in spares:
                component = Component(self.name, spares[fault.until_tick])
        return self._scan(component, window, after)

    def _scan(self, component: Component, window: Window | None, after: int) -> int | None:
        """What a module says, if it may say so."""
        found = component.call("scan", window, after)
        if found is None:
            return None
        last = None if window is None else window.start + len(window.samples) - 1
        if type(found) is int and found > after and (last is None or found <= last):
            return found
        whole = isinstance(found, int | np.integer) and not isinstance(found, bool)
        if not whole or found <= after or (last is not None and found > last):
            until = "" if last is None else f" and no later than {last}, the window's last"
            raise component.broken(
                "scan", f"returned {shown(found)}", f"a tick later than {after}{until}, as an int; or None"
            )
        return int(found)

    def fire(self, tick: int) -> Sent:
        """Let the module act by itself."""
        if self._spares:
            self._replace(tick)
        sample = self._sample(tick)
        self._advance(tick)
        outputs = self._component.call("fire", tick, sample)
        return self._sent("fire", outputs, (), sample, self._fires)

    def conclude(self, tick: int) -> Sent:
        """Let a module conclude that fired where nothing arrives."""
        return self._received(tick, (), self._concludes)

    def settle(self, tick: int, port: str, acknowledged: bool) -> None:
        """Tell the module what became of what it sent on a port: it knows this before what arrives at this tick."""
        self._sample(tick)
        self._advance(tick)
        self._component.call("settle", port, tick, acknowledged)

    def receive(self, tick: int | None, arrivals: tuple[Arrival, ...]) -> Sent:
        """Hand over all that arrives in one step."""
        return self._received(tick, arrivals, self._answers)

    def _received(self, tick: int | None, arrivals: tuple[Arrival, ...], expected: set[str] | None) -> Sent:
        sizes = self.module.inputs
        for arrival in arrivals:
            if arrival.value.shape != (sizes[arrival.port],):
                raise self._wrong_size(arrival)
        own = arrivals
        if not self._shares:  # a value goes to several receivers
            own = tuple([Arrival(port, link, value.copy()) for port, link, value in arrivals])
        sample = None
        if tick is not None and self._spares:
            self._replace(tick)
        if tick is not None and self.window is not None:
            sample = self._sample(tick)
            self._advance(tick)
        outputs = self._component.call("receive", tick, own, sample)
        return self._sent("receive", outputs, arrivals, sample, expected)

    def _replace(self, tick: int) -> None:
        """Put the module that was started anew in the place of the one that died, from its first tick on."""
        while self._spares and self._spares[0][0] <= tick:
            _, self.module = self._spares.popleft()
            self._component = Component(self.name, self.module)
            self._take_ports()

    def _take_ports(self) -> None:
        """Note what the module's ports and its role say: it is asked for with every message."""
        role = self.module.role
        self._wires = {port: self.module.wire(port) for port in self.module.outputs}
        self._sizes = {port: (size,) for port, size in self.module.outputs.items()}
        self._fires: set[str] | None = self._connected if role.every is not None else None
        self._concludes: set[str] | None = None
        if role.fires_on is not None:
            self._fires = self._connected.intersection(role.fires_on)
            self._concludes = self._connected.intersection((role.triggers,))
        self._answers = self._connected if self.module.answers else None
        self._only: tuple[Link, str, tuple[int], Callable[[FloatArray], FloatArray]] | None = None
        if len(self._links) == 1:
            (link,) = self._links
            self._only = link, link.port, self._sizes[link.port], self._wires[link.port].rounded

    def _advance(self, tick: int) -> None:
        if self._spares:
            self._replace(tick)
        if self.window is not None and tick > self._advanced:
            self._component.call("advance", tick, self.window)
            self._advanced = tick

    def _sample(self, tick: int) -> FloatArray | None:
        window = self.window
        if window is None:
            return None
        place = tick - window.start
        if not 0 <= place < len(window.samples):
            raise ProtocolError(
                f"node {self.name}",
                f"is to act at tick {tick}, whose sample is not in its window of {window.plant}",
                f"a tick from {window.start} to {window.last}",
            )
        return window.samples[place]  # type: ignore[no-any-return]

    def _wrong_size(self, arrival: Arrival) -> ProtocolError:
        """Refuse a message of another size; only a foreign node can send one."""
        return ProtocolError(
            f"node {self._senders[arrival.link]}",
            f"has sent {arrival.value.size} components to {self.name}:{arrival.port}, on link {arrival.link}",
            f"{self.module.inputs[arrival.port]} components",
        )

    def _sent(
        self,
        method: str,
        outputs: Any,
        arrivals: Sequence[Arrival],
        sample: FloatArray | None,
        expected: set[str] | None,
    ) -> Sent:
        """What goes out on each link: checked, and rounded to the wire.

        Parameters
        ----------
        method
            That has returned it.
        outputs
            What it has returned.
        arrivals, sample
            What it was given: out of what is no number may come what is no number.
        expected
            The connected ports on which the role has promised a message, and no others; None for no such promise.
        """
        only = self._only
        if only is not None and type(outputs) is dict and len(outputs) == 1 and self.module.halt == "":
            # As mostly: all that is checked below, of one value on the one link that there is.
            link, port, only_size, rounded_to_wire = only
            value = outputs.get(port)
            if type(value) is np.ndarray and value.dtype is _FLOAT64 and value.shape == only_size:
                on_wire = rounded_to_wire(value)
                if all_finite(on_wire) and (expected is None or expected == self._connected):
                    return [(link, on_wire)]
        elif type(outputs) is dict and not outputs and not expected and self.module.halt == "":
            return []
        if type(outputs) is not dict and not isinstance(outputs, Mapping):
            raise self._component.broken(
                method, f"returned {shown(outputs)}", "a dict of arrays by output port; an empty one sends nothing"
            )
        if not isinstance(self.module.halt, str):
            raise self._component.broken(method, f"has set halt to {shown(self.module.halt)}", "a text, or ''")
        if not outputs and not expected:
            return []
        rounded: dict[str, FloatArray] = {}
        for port, value in outputs.items():
            size = self._sizes.get(port)
            if size is None:
                ports = ", ".join(map(repr, self.module.outputs)) or "none: it has no output port"
                raise self._component.broken(method, f"names the port {port!r}", f"one of {ports}")
            if type(value) is not np.ndarray or value.dtype is not _FLOAT64 or value.shape != size:
                value = self._component.array(size, f"{method}, port '{port}',", value)
            rounded[port] = on_wire = self._wires[port].rounded(value)
            if not all_finite(on_wire) and are_finite([*(arrival.value for arrival in arrivals), sample]):
                raise self._component.broken(
                    f"{method}, port '{port}',", f"sends {value.tolist()}", "finite numbers on the wire"
                )
        if (
            expected is not None
            and not self.module.halt
            and rounded.keys() != expected
            and self._connected.intersection(rounded) != expected
        ):
            names = ", ".join(sorted(map(repr, rounded))) or "nothing"
            raise self._component.broken(
                method, f"sends {names}", f"a message on {', '.join(sorted(map(repr, expected)))}, by its role"
            )
        return [(link, rounded[link.port]) for link in self._links if link.port in rounded]
