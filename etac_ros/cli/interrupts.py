"""Ctrl-C says what is kept, in the words of the command that it ends."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator

NOTHING_KEPT = "nothing was written; the same command begins anew"


class Interrupted(KeyboardInterrupt):
    """An interrupt of a command that knows what is kept.

    Parameters
    ----------
    kept
        What is kept, and how to go on, in words.
    """

    def __init__(self, kept: str) -> None:
        super().__init__(kept)
        self.kept = kept


@contextlib.contextmanager
def keeping(kept: str | Callable[[], str]) -> Iterator[None]:
    """An interrupt in here says what is kept.

    Parameters
    ----------
    kept
        The words, or who finds them when it has come to that. Of several that are nested the innermost has the word.
    """
    try:
        yield
    except Interrupted:
        raise
    except KeyboardInterrupt:
        raise Interrupted(kept if isinstance(kept, str) else kept()) from None
