"""Sensor, law and trigger rule in one module: what crosses the network is the torque, at triggering instants.

So it is where the trigger rule compares the law's torque of every sample with the torque that is held (shi2022 fig. 4
and eq. 21): the way from sensor to controller is inside the module, the network begins behind it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from etac_ros.graph.module import Context, Module, Outputs, Window
from etac_ros.graph.promises import Component, check_state_size, first_broken, shown
from etac_ros.graph.role import Role
from etac_ros.laws.law import LawOfEvents, LawWithMemory
from etac_ros.maths.finite import all_finite
from etac_ros.modules.hold import Hold
from etac_ros.modules.triggering import NOTHING, Heard
from etac_ros.parameters import FloatArray, Parameters
from etac_ros.plants.watch import Watch, rows_left, words
from etac_ros.triggers.rule import AnyRule, PartialRule

_AT_ONCE = 256
"""Samples that are folded at once in a replay: a triggering instant discards what lies behind it."""


class SensingControllerParameters(Parameters):
    """A sensing controller has no parameters beside its law's and its trigger rule's."""


@dataclass(frozen=True)
class _Committed:
    """What is final: the command of the last committed tick, the memory after it, and a bound that was left at it."""

    tick: int
    command: FloatArray
    memory: FloatArray
    left: str = ""


@dataclass(frozen=True)
class _Ahead:
    """What follows from the committed memory over the rest of a window, at ticks ``first, first + 1, ...``."""

    window: Window
    first: int
    commands: FloatArray
    memories: FloatArray
    outside: list[int]
    """Rows at which the law leaves a bound, in order."""


class SensingController(Module):
    """Measures, computes the command, and transmits it when its trigger rule says so.

    Parameters
    ----------
    context
        Its plant and the wire format of the port ``command``.
    parameters
        None: they are the law's and the trigger rule's.
    law
        Command of each sample; it may have memory.
    trigger
        When the command is transmitted; the first sample's always is.

    Raises
    ------
    ValueError
        If there is no plant, or the law refuses its start.
    """

    Parameters = SensingControllerParameters
    components = ("law", "trigger")
    role = Role(triggers="command", senses=True)
    hears_acknowledgements = True

    def __init__(
        self, context: Context, parameters: SensingControllerParameters, law: LawWithMemory, trigger: AnyRule
    ) -> None:
        super().__init__(context)
        if context.plant is None:
            raise ValueError("a sensing controller needs a plant, named by the key 'reads'")
        check_state_size(law, context.plant)
        self.outputs = {"command": law.command_size}
        self.law = law
        self.trigger = trigger
        self._component = Component(context.name, law)
        self.events: frozenset[int] | None = None
        """Triggering instants of the run that is replayed, where its samples alone do not tell them."""
        self.hold = Hold(self, "command", trigger)
        memory = law.initial_memory(context.plant.initial_state())
        self._committed = _Committed(-1, np.zeros(law.command_size), memory)
        self._ahead: _Ahead | None = None

    def scan(self, window: Window | None, after: int) -> int | None:
        """First tick at which the trigger rule holds or the law leaves a bound."""
        assert window is not None
        ahead = self._look(window)
        offset = max(after + 1 - ahead.first, 0)
        if offset >= ahead.commands.shape[0]:
            return None
        due = [ahead.first + row for row in ahead.outside if row >= offset][:1]
        rows = ahead.commands[offset:]
        fires = self.hold.first(rows, ahead.first + offset)
        broken = first_broken(rows, window.samples[ahead.first + offset - window.start :])
        due += [] if fires is None else [fires]
        due += [] if broken is None else [ahead.first + offset + broken]
        return min(due, default=None)

    def advance(self, tick: int, window: Window) -> None:
        """Keep the command of this tick, and the law's memory after it."""
        if tick <= self._committed.tick:
            return
        ahead = self._look(window)
        row = tick - ahead.first
        seen = self._committed.tick + 1 - ahead.first
        self.hold.advance(ahead.commands[seen : row + 1], ahead.first + seen)
        left = ""
        if row in ahead.outside:
            state = np.ascontiguousarray(window.at(tick))
            watches = self.law.watches(state[np.newaxis, :], tick, self._committed.memory)
            left = words(watches, 0, tick, self.context.ticks_per_second, state)
        self._committed = _Committed(tick, ahead.commands[row].copy(), ahead.memories[row].copy(), left)

    def fire(self, tick: int, sample: FloatArray | None) -> Outputs:
        """Transmit the command of this tick; or end the run if a bound is left."""
        committed = self._committed
        assert committed.tick == tick
        assert sample is not None
        if committed.left:
            self.halt = committed.left
            return {}
        if not all_finite(committed.command) and all_finite(sample):
            found = f"gives {committed.command.tolist()} at tick {tick} for a state of finite numbers"
            raise self._component.broken("fold", found, "finite numbers")
        sent = self._send(self.hold, committed.command, tick)
        if isinstance(self.law, LawOfEvents):
            memory = self.law.after_event(np.ascontiguousarray(sample), tick, committed.memory)
            self._committed = replace(committed, memory=memory)
            self._ahead = None  # what was seen ahead followed from the memory before
        return {"command": sent}

    def settle(self, port: str, tick: int, acknowledged: bool) -> None:
        """Go by what was acknowledged."""
        self.hold.settle(tick, acknowledged)

    @property
    def watched_label(self) -> str:
        """Symbol of the law's command."""
        return self.law.label

    @property
    def watched_unit(self) -> str:
        """Unit of the law's command."""
        return self.law.unit

    def watched(self, window: Window | None, heard: Heard = NOTHING) -> FloatArray:
        """The command at each sample: what the trigger rule is shown.

        Raises
        ------
        ValueError
            If samples of the window are committed: the memory before them is gone.
        """
        assert window is not None
        ahead = self._look(window)
        if ahead.first != window.start:
            raise ValueError(f"the law's memory is that after tick {self._committed.tick}; it does not go back")
        return self._replayed(window.samples, window.start)[0] if isinstance(self.law, LawOfEvents) else ahead.commands

    def watches(self, window: Window) -> tuple[Watch, ...]:
        """Quantities of the law at each sample, which have to stay within bounds."""
        return self.law.watches(window.samples, window.start, self._committed.memory)

    def held_by(self, value: FloatArray, tick: int) -> FloatArray:
        """What the trigger rule compares with after a message: its value."""
        return value

    def _send(self, hold: Hold, command: FloatArray, tick: int) -> FloatArray:
        """Take a command for sent at a triggering instant: all of it, or the part that the rule renews."""
        rule = getattr(self.trigger, "rule", self.trigger)  # times around a rule decide nothing about parts
        if hold.sent is not None and isinstance(rule, PartialRule):
            command = rule.renewed(command, tick, hold.sent)
        return hold.send(command, tick)

    def memories(self, samples: FloatArray, first: int) -> FloatArray:
        """The law's memory before each of all samples of a run from its first on, shape (n, memory_size).

        Asked on a fresh graph, which no engine has run.
        """
        return self._replayed(samples, first)[1]

    def _replayed(self, all_samples: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
        """The command at each sample, and the memory before it, with the triggering instants in between made anew.

        Raises
        ------
        ValueError
            If they cannot be, and are not known: what was acknowledged decides about them.
        """
        if self.events is None and self.context.acknowledged:
            raise ValueError("triggers that wait for acknowledgements are not made anew: give the events")
        memory, hold = self._committed.memory, Hold(self, "command", self.trigger)
        parts, before, row = [], [], 0
        while row < len(all_samples):
            tick = first + row
            edges = [edge - tick for fault in self.context.down for edge in fault if edge > tick]
            samples = np.ascontiguousarray(all_samples[row : row + min([_AT_ONCE, *edges])])
            commands, memories = self.law.fold(samples, tick, memory)
            is_down = any(start <= tick < until for start, until in self.context.down)
            if self.events is not None:
                fires = self._next_event(tick, len(samples))
            else:
                fires = None if is_down else hold.first(commands, tick)
            last = len(samples) - 1 if fires is None else fires - tick
            parts.append(commands[: last + 1])
            before += [memory[np.newaxis], memories[:last]]
            memory = memories[last]
            if self.events is None:
                hold.advance(commands[: last + 1], tick)
            if fires is not None:
                if self.events is None:
                    self._send(hold, commands[last], fires)
                if isinstance(self.law, LawOfEvents):
                    memory = self.law.after_event(samples[last], fires, memory)
            row += last + 1
        return np.concatenate(parts), np.concatenate(before)

    def _next_event(self, tick: int, count: int) -> int | None:
        assert self.events is not None
        return next((event for event in range(tick, tick + count) if event in self.events), None)

    def _look(self, window: Window) -> _Ahead:
        """Fold the law over a copy of its memory, through the samples that are not committed."""
        if self._ahead is not None and self._ahead.window is window:
            return self._ahead
        first = max(window.start, self._committed.tick + 1)
        if window.start > self._committed.tick + 1:
            raise ValueError(
                f"the law needs every sample: the last was that of tick {self._committed.tick}, "
                f"the window begins at {window.start}"
            )
        samples = window.samples[first - window.start :]
        commands, memories = self._fold(samples, first)
        watches = self._component.call("watches", samples, first, self._committed.memory)
        outside = rows_left(watches).tolist()
        self._ahead = _Ahead(window, first, commands, memories, outside)
        return self._ahead

    def _fold(self, samples: FloatArray, first: int) -> tuple[FloatArray, FloatArray]:
        found = self._component.call("fold", samples, first, self._committed.memory)
        if not isinstance(found, tuple) or len(found) != 2:
            raise self._component.broken(
                "fold", f"returned {shown(found)}", "(command at each sample, memory after it)"
            )
        commands, memories = found
        count, part = samples.shape[0], "fold, the {} part of what it"
        return (
            self._component.array((count, self.law.command_size), part.format("first"), commands),
            self._component.array((count, self._committed.memory.size), part.format("second"), memories),
        )
