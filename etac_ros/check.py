"""Whether the classes of a scenario keep what both engines rely on: no hidden state, and no bit depends on windows.

The scenario runs by calls in short and long windows, and all that came of it is compared. In one of the runs each call
of a class that the scenario names is made twice, and again row by row, so that the class is named and not just the run.
"""

from __future__ import annotations

import hashlib
import inspect
from collections import Counter
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from etac_ros.engines.inprocess import InProcess
from etac_ros.errors import BrokenPromise, EtacError
from etac_ros.graph.graph import Graph
from etac_ros.graph.promises import Component, probing
from etac_ros.graph.recording import Recording
from etac_ros.scenario.load import Scenario
from etac_ros.timing.windows import WindowPolicy

LENGTHS = (1, 7, 64)
"""Samples in the windows of the runs that are compared."""
MOST_TICKS = 4000
"""How far a scenario is run, unless told otherwise."""
_CALLS = 200
"""Calls of each method of each class that are looked at closely; what depends on windows shows soon."""
_OF_MODULES = "scan"
_AGAIN = 2
"""How often a call is repeated: what changes at every other call would not be seen at once."""
_PURE = ("propagate", "measured", "evaluate", "sent", "broadcast", "watched", "watches", "first", "fold", _OF_MODULES)
"""Methods that give the same whenever they are asked the same. A law's ``command`` is asked once a message."""


@dataclass(frozen=True)
class CheckedRun:
    """What came of a run.

    Attributes
    ----------
    length
        Samples in its windows.
    triggers, messages
        How many.
    digest
        Of all messages with their places in time, and all committed samples.
    """

    length: int
    triggers: int
    messages: int
    digest: str


@dataclass(frozen=True)
class Checked:
    """The outcome of a check.

    Attributes
    ----------
    ticks
        How far the scenario was run.
    runs
        One for each length of windows.
    faults
        Who does not keep what is relied on; empty if all is well.
    """

    ticks: int
    runs: tuple[CheckedRun, ...]
    faults: tuple[EtacError, ...]


def check(scenario: Scenario, most_ticks: int = MOST_TICKS) -> Checked:
    """Run a scenario in windows of several lengths, and compare.

    Raises
    ------
    EtacError
        If it cannot be built, or a class breaks a promise that every run checks.
    """
    graph = scenario.build()
    ticks = min(graph.end_tick, most_ticks)
    prober = _Prober()
    with probing(prober):
        InProcess(replace(graph, end_tick=ticks), WindowPolicy(LENGTHS[-1], LENGTHS[-1])).run()
    runs, recordings = [], []
    for length in LENGTHS:
        engine = InProcess(replace(scenario.build(), end_tick=ticks), WindowPolicy(length, length))
        recording = engine.run()
        recordings.append(recording)
        messages = sum(map(len, recording.messages.values()))
        triggers = sum(engine.master.fired.values())
        runs.append(CheckedRun(length, triggers, messages, _digest(recording, engine.master.halted)))
    faults = prober.named()
    if not faults and len({run.digest for run in runs}) > 1:
        faults.append(_first_difference(graph, recordings))
    return Checked(ticks, tuple(runs), tuple(faults))


class _Prober:
    """Makes each call of a pure method several times, and row by row, and notes who gives something else then."""

    def __init__(self) -> None:
        self.faults: dict[tuple[str, str, str], EtacError] = {}
        self._seen: Counter[tuple[str, str, str]] = Counter()

    def __call__(self, component: Component, method: str, arguments: tuple[Any, ...], named: Mapping[str, Any]) -> Any:
        key = (component.node, component.name, method)
        self._seen[key] += 1
        if method not in _PURE or self._seen[key] > _CALLS or key in self.faults:
            return component.plain_call(method, arguments, named)
        before = deepcopy(_arrays(arguments))
        found = component.plain_call(method, arguments, named)
        kept = deepcopy(found)
        after = _arrays(arguments)
        if not _same(before, after):
            self._note(key, "changes an argument that it is given", "a copy of its own, where it works in place")
            return found
        again = [component.plain_call(method, arguments, named) for _ in range(_AGAIN)]
        if not all(_same(kept, other) for other in again):
            self._note(
                key,
                "gives something else when it is asked the same again: it keeps a state that nobody sees",
                "a pure method: the state is handed in and out, or belongs to a module, which commits it in advance()",
            )
            return kept
        if not _same(kept, _row_by_row(component, method, arguments, kept)):
            self._note(
                key,
                "gives other bits for samples one by one than for all of a window",
                "the same formula for one row and for many: numpy's einsum or a loop instead of a matrix product, "
                "whose result BLAS lets depend on the number of rows",
            )
        return kept

    def named(self) -> list[EtacError]:
        """The faults; a module is not blamed for what a class inside it does."""
        inside = {node for node, _, method in self.faults if method != _OF_MODULES}
        return [
            fault for (node, _, method), fault in self.faults.items() if method != _OF_MODULES or node not in inside
        ]

    def _note(self, key: tuple[str, str, str], found: str, expected: str) -> None:
        node, kind, method = key
        self.faults[key] = BrokenPromise(node, f"{kind}.{method} {found}", expected)


def _arrays(arguments: Sequence[Any]) -> list[Any]:
    return [
        argument if isinstance(argument, np.ndarray) else getattr(argument, "samples", None) for argument in arguments
    ]


def _same(one: Any, other: Any) -> bool:
    """Whether two results are the same to the bit."""
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.shape == other.shape and one.dtype == other.dtype and one.tobytes() == other.tobytes()
    if isinstance(one, list | tuple) and isinstance(other, list | tuple):
        return len(one) == len(other) and all(map(_same, one, other))
    if hasattr(one, "__dataclass_fields__") and type(one) is type(other):
        return all(_same(getattr(one, name), getattr(other, name)) for name in one.__dataclass_fields__)
    return bool(one == other) or (one != one and other != other)


def _row_by_row(component: Component, method: str, arguments: tuple[Any, ...], whole: Any) -> Any:
    """The result for a window, put together from calls for single samples; the whole where that means nothing."""

    def called(*some: Any) -> Any:
        return component.plain_call(method, some, {})

    match method:
        case "propagate":
            state, tick, count, held = arguments
            rows = []
            for i in range(count):
                state = np.array(called(state, tick + i, 1, held)[0])
                rows.append(state)
            return np.array(rows)
        case "evaluate" | "sent" | "measured" | "broadcast" | "watched" if isinstance(whole, np.ndarray):
            parts = [called(*_row(component, method, arguments, i)) for i in range(len(whole))]
            return np.concatenate(parts) if parts else whole
        case "first":
            for i in range(len(arguments[0])):
                if called(*_row(component, method, arguments, i)) != -1:
                    return i
            return -1
        case "fold":
            memory, parts = arguments[-1], []
            for i in range(len(arguments[0])):
                *some, _ = _row(component, method, arguments, i)
                parts.append(called(*some, memory))
                memory = np.array(parts[-1][1][-1])
            return tuple(np.concatenate([part[k] for part in parts]) for k in (0, 1)) if parts else whole
    return whole


def _row(component: Component, method: str, arguments: tuple[Any, ...], i: int) -> tuple[Any, ...]:
    """The arguments for the i-th sample alone."""
    names = list(inspect.signature(getattr(component.owner, method)).parameters)
    first, *others = arguments
    told: list[Any] = [np.ascontiguousarray(first[i : i + 1])]
    for name, value in zip(names[1:], others, strict=False):
        if name == "tick":
            told.append(value + i)
        elif name in ("ticks", "errors", "torque"):  # one for each row
            told.append(np.ascontiguousarray(value[i : i + 1]))
        else:
            told.append(value)
    return tuple(told)


def _digest(recording: Recording, halted: str) -> str:
    digest = hashlib.sha256(halted.encode())
    for link, messages in recording.messages.items():
        for message in messages:
            digest.update(f"{link} {message.tick} {message.step}".encode())
            digest.update(message.value.tobytes())
    for plant in recording.truth:
        digest.update(recording.samples(plant)[1].tobytes())
    return digest.hexdigest()[:12]


def _first_difference(graph: Graph, recordings: Sequence[Recording]) -> EtacError:
    """Who was the first to do something else in other windows."""
    one, *others = recordings
    found: list[tuple[int, int, str, str]] = []
    for other in others:
        for link, messages in one.messages.items():
            theirs = other.messages[link]
            for place in range(max(len(messages), len(theirs))):
                pair = [some[place] if place < len(some) else None for some in (messages, theirs)]
                mine, their = pair
                if mine is None or their is None or not _same(tuple(mine), tuple(their)):
                    when = min((some.tick, some.step) for some in pair if some is not None)
                    found.append((*when, graph.links[link].sender, f"sends something else on link {link}"))
                    break
        for plant in one.truth:
            (_, mine_states), (_, their_states) = one.samples(plant), other.samples(plant)
            count = min(len(mine_states), len(their_states))
            rows = np.flatnonzero((mine_states[:count] != their_states[:count]).any(axis=1))
            if rows.size:
                found.append((int(rows[0]), 0, plant, "has another state"))
    tick, _, node, what = min(found)
    return BrokenPromise(
        node,
        f"{type(graph.modules[node]).__name__} {what} at tick {tick} in windows of other lengths",
        "the same bits whatever the windows are: scan() is pure, and what it keeps is committed in advance()",
    )
