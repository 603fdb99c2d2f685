"""A trigger rule together with the last-sent value: what every module that transmits on events keeps.

Two words that are easily mixed up: the *last-sent value* is what the trigger rule compares with, and is kept here; the
*ZOH input* is what the plant holds (:mod:`etac_ros.graph.held`), behind channel, law and actuator.

Where the messages of its port are acknowledged, the rule compares with the value that was acknowledged last; while an
acknowledgement is waited for, it is not asked.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from etac_ros.graph.module import Module
from etac_ros.graph.promises import Component, shown
from etac_ros.parameters import FloatArray
from etac_ros.triggers.rule import AnyRule


class Hold:
    """Asks a trigger rule, and keeps what it compares with.

    Parameters
    ----------
    module
        Whose rule it is.
    port
        Output port on which it sends; its size has to be known by now.
    rule
        With or without memory. A rule with memory is told every sample, by :meth:`advance`.
    """

    def __init__(self, module: Module, port: str, rule: AnyRule) -> None:
        self.sent: FloatArray | None = None
        """What the rule compares with: the value last sent, as it stood on the wire, unless told otherwise."""
        self.sent_tick: int | None = None
        """When it was sent."""
        self._wire = module.wire(port)
        self._awaits = not module.context.acknowledged.isdisjoint((port, ""))
        self._under_way: tuple[FloatArray, int] | None = None
        # The times around a rule are ours; it is the rule that gives its word.
        self._rule = Component(module.context.name, rule, getattr(rule, "rule", rule))
        self._memory: FloatArray | None = None
        self._before: tuple[int, FloatArray, FloatArray] | None = None
        if hasattr(rule, "fold"):
            initial = self._rule.call("initial_memory")
            shape = initial.shape if isinstance(initial, np.ndarray) and initial.ndim == 1 else (-1,)
            self._memory = self._rule.array(shape, "initial_memory", initial)

    @property
    def has_memory(self) -> bool:
        """Whether the rule is told of every sample."""
        return self._memory is not None

    @property
    def compared(self) -> FloatArray | None:
        """What the rule compares with, while it is asked about every sample; None while it is not, or goes by more."""
        return self.sent if self._memory is None and self._under_way is None else None

    def first(self, rows: FloatArray, tick: int) -> int | None:
        """First tick at which the rule holds, of the ticks of some rows; None if at none. Looking changes nothing.

        Parameters
        ----------
        rows
            What the rule watches, contiguous, shape (n, size), for ``tick, tick + 1, ...``. Of a rule with memory they
            begin with the tick after the last that :meth:`advance` was told of.
        """
        if not len(rows) or self._under_way is not None:
            return None
        if self.sent is None:
            return tick  # the first sample always is sent
        if self._memory is not None:
            fires, _ = self._fold(rows, tick, self._memory)
            return tick + int(np.argmax(fires)) if fires.any() else None
        index = self._index(len(rows), rows, tick)
        return None if index < 0 else tick + index

    def advance(self, rows: FloatArray, tick: int) -> None:
        """Commit the memory of the rule over rows that are final; a rule without one needs none of this."""
        if self._memory is None or not len(rows):
            return
        before = self._memory
        if self.sent is not None:
            memories = self._fold(rows, tick, self._memory)[1]
            before = memories[-2].copy() if len(rows) > 1 else self._memory
            self._memory = memories[-1].copy()
        self._before = tick + len(rows) - 1, rows[-1:].copy(), before

    def decides(self, row: FloatArray, tick: int) -> bool:
        """Whether something is to be sent for this one row: of a module that decides when something arrives.

        The row is final, and is told to a rule with memory.
        """
        fires = self.first(row, tick) == tick
        self.advance(row, tick)
        return fires

    def send(self, value: FloatArray, tick: int, compared: FloatArray | None = None) -> FloatArray:
        """Take a value for sent at a tick.

        Parameters
        ----------
        value
            What is sent.
        compared
            What the rule compares with from now on, where that is not the value itself.

        Returns
        -------
        ndarray
            The value as it comes off the wire.
        """
        rounded = self._wire.rounded(value)
        taken = rounded if compared is None else compared
        if self._awaits:
            self._under_way = taken, tick
        else:
            self._hold(taken, tick, tick)
        return rounded

    def settle(self, tick: int, acknowledged: bool) -> None:
        """Take note at a tick that what was sent last is held by the other side, or that it was given up.

        In both cases the rule is asked again, about the samples behind this tick.
        """
        assert self._under_way is not None
        value, sent_tick = self._under_way
        self._under_way = None
        if acknowledged:
            self._hold(value, sent_tick, tick)

    def _hold(self, value: FloatArray, sent_tick: int, tick: int) -> None:
        """Compare with a value from a tick on; a memory is folded over the sample of that tick with it."""
        self.sent, self.sent_tick = value, sent_tick
        if self._before is not None and self._before[0] == tick:
            _, row, before = self._before
            self._memory = self._fold(row, tick, before)[1][-1].copy()

    def _index(self, count: int, rows: FloatArray, tick: int) -> int:
        found = self._rule.call("first", rows, tick, self.sent, self.sent_tick)
        # Most rules return an int at once: what else there may be is looked at where it matters.
        if type(found) is int and -1 <= found < count:
            return found
        return self._rule.checked_index(count, "first", found)

    def _fold(self, rows: FloatArray, tick: int, memory: FloatArray) -> tuple[Any, FloatArray]:
        found = self._rule.call("fold", rows, tick, self.sent, self.sent_tick, memory.copy())
        named = self._rule
        if not isinstance(found, tuple) or len(found) != 2:
            raise named.broken("fold", f"returned {shown(found)}", "(whether each sample fires, the memory after each)")
        fires, memories = found
        count = len(rows)
        if not isinstance(fires, np.ndarray) or fires.dtype != np.bool_ or fires.shape != (count,):
            raise named.broken("fold", f"returned {shown(fires)} first", f"an array of bools of shape ({count},)")
        return fires, named.array((count, memory.size), "fold, the second part of what it", memories)
