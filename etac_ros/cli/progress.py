"""Progress on standard error, so that it is seen where standard output goes to a file, and is in no one's way there."""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Iterator

from rich.console import Console

Say = Callable[[str], None]
EVERY_S = 5.0
"""Wall seconds between two lines of progress where standard error is no terminal."""


def progress_console(console: Console) -> Console:
    """Where the progress of a command goes whose results go to ``console``; nowhere if that one is quiet."""
    return Console(stderr=True, markup=False, emoji=False, quiet=console.quiet)


@contextlib.contextmanager
def steps(console: Console, begin: str) -> Iterator[Say]:
    """Show what is being done: one line that changes, or, where there is no terminal, a line now and then.

    Parameters
    ----------
    console
        Where the results go.
    begin
        The first step.

    Yields
    ------
    Say
        Told the next step.
    """
    shown = progress_console(console)
    if shown.is_terminal:
        with shown.status(f"{begin} ...") as status:
            yield lambda text: status.update(f"{text} ...")
        return
    yield lines_now_and_then(console.quiet)


def lines_now_and_then(quiet: bool, clock: Callable[[], float] = time.monotonic, every_s: float = EVERY_S) -> Say:
    """Who says on standard error what is being done, but not before a command has taken its time.

    Parameters
    ----------
    quiet
        Say nothing at all.
    clock
        Wall time [s].
    every_s
        Least wall time between two lines, and before the first.
    """
    told = clock()

    def say(text: str) -> None:
        nonlocal told
        now = clock()
        if not quiet and now - told >= every_s:
            told = now
            print(f"etac: {text} ...", file=sys.stderr, flush=True)

    return say
