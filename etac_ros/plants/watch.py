"""Quantities that are reported, and that end a run where they leave their bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from etac_ros.maths.ticks import seconds
from etac_ros.parameters import FloatArray


@dataclass(frozen=True)
class Watch:
    """A quantity that is reported, and that ends the run when it leaves its bound.

    Attributes
    ----------
    name, unit
        What it is, and its unit.
    values
        The quantity at each state, shape (n, m); its magnitude counts.
    axes
        Name of each of the m columns.
    bound
        Reaching it ends the run; None only reports.
    notice
        A smaller bound that is reported beside the largest value; None is none.
    """

    name: str
    unit: str
    values: FloatArray
    axes: tuple[str, ...]
    bound: float | None
    notice: float | None = None

    @property
    def left(self) -> npt.NDArray[np.bool_]:
        """Where the bound is reached, shape (n, m). Nobody keeps a bound with what is no number."""
        if self.bound is None:
            return np.zeros(self.values.shape, dtype=np.bool_)
        return np.asarray(~(np.abs(self.values) < self.bound))


def rows_left(watches: Sequence[Watch]) -> npt.NDArray[np.intp]:
    """Rows at which any of the quantities has left its bound, ascending."""
    if not watches:
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(np.any([watch.left.any(axis=1) for watch in watches], axis=0))


def words(watches: Sequence[Watch], row: int, tick: int, ticks_per_second: int, state: FloatArray) -> str:
    """What has left which bound at a row, for the message that ends a run.

    Parameters
    ----------
    watches, row
        From :func:`rows_left`.
    tick
        Tick of the row.
    ticks_per_second
        Rate of the tick grid [1/s].
    state
        The plant's state at the row.
    """
    found = []
    for watch in watches:
        if not watch.left[row].any():
            continue
        column = int(np.argmax(np.abs(watch.values[row])))
        value, bound = (f"{number:.6g} {watch.unit}".rstrip() for number in (watch.values[row, column], watch.bound))
        found.append(
            f"{watch.name} about {watch.axes[column]} is {value} at {seconds(tick, ticks_per_second):.6g} s "
            f"(tick {tick}), outside +-{bound}"
        )
    return f"{'; '.join(found)}; state [{', '.join(f'{number:.6g}' for number in state)}]"
