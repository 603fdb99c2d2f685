"""Where a view of a run stands: in the terminal, drawn anew in its place, or as a line now and then elsewhere."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.live import Live
from rich.text import Text

from etac_ros.bag.monitor import Monitor, Picture
from etac_ros.cli.view import ASCII_BLOCKS, BLOCKS, View, lines, plain
from etac_ros.graph.graph import Graph

_LEAST_S, _MOST_S = 0.5, 4.0
"""A rate takes so much wall time to be known, and is the mean of so much."""


class Screen:
    """Shows a run as it happens.

    Parameters
    ----------
    console
        The terminal, or what stands for it.
    title, graph
        As for :class:`~etac_ros.cli.view.View`.
    say
        Told the view in one sentence, where there is no terminal.
    state
        What stands there until the first picture has come.
    """

    def __init__(
        self, console: Console, title: str, graph: Graph, say: Callable[[str], None], state: str = "joining"
    ) -> None:
        self._console = console
        self._title = title
        self._graph = graph
        self._say = say
        self._picture = Monitor(graph).picture
        self._state = state
        self._reached: deque[tuple[float, float]] = deque()
        """Of late: when pictures came [wall s], and what simulated time they showed [s]."""
        self._live: Live | None = None
        utf = "utf" in (console.encoding or "").lower()
        self._blocks = BLOCKS if utf else ASCII_BLOCKS

    def __enter__(self) -> Self:
        # No thread draws, since runs fork; and what others print is theirs, in their processes, too.
        if self._console.is_terminal and not self._console.quiet:
            self._live = Live(
                self._drawn(),
                console=self._console,
                auto_refresh=False,
                transient=True,
                redirect_stdout=False,
                redirect_stderr=False,
                vertical_overflow="crop",
            )
            self._live.start(refresh=True)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._live is not None:
            self._live.stop()

    def show(self, picture: Picture) -> None:
        """Show the newest picture."""
        self._state = ""
        self._picture = picture
        now = time.monotonic()
        self._reached.append((now, self.view.time_s))
        while len(self._reached) > 2 and now - self._reached[1][0] > _MOST_S:
            self._reached.popleft()
        self.refresh()

    def say_state(self, state: str) -> None:
        """Show what has become of the run."""
        self._state = state
        self.refresh()

    def refresh(self) -> None:
        """Draw anew: the terminal may have another size."""
        if self._live is not None:
            self._live.update(self._drawn(), refresh=True)
        elif not self._console.quiet:
            self._say(plain(self.view))

    @property
    def view(self) -> View:
        """What is shown."""
        rate = math.nan
        if self._reached and self._reached[-1][0] - self._reached[0][0] > _LEAST_S:
            (began_s, from_s), (now_s, to_s) = self._reached[0], self._reached[-1]
            rate = (to_s - from_s) / (now_s - began_s)
        return View(self._title, self._graph, self._picture, rate, self._state)

    def _drawn(self) -> Text:
        width, height = self._console.size
        # One column less: some terminals wrap a line that fills them.
        shown = lines(self.view, width - 1, height - 1, self._blocks)
        return Text("\n".join(shown), no_wrap=True, overflow="crop")
