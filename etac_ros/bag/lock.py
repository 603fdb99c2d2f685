"""Who has a bag open: its writer holds a lock on the file, which its end releases, however it ends."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from etac_ros.errors import BagError


def hold(file: BinaryIO) -> bool:
    """Take the lock of an open file until it is closed.

    Returns
    -------
    bool
        False if another process has it. True also where the file system has no locks: nothing is known then.
    """
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def is_being_written(path: Path) -> bool:
    """Whether a process that lives still writes this file."""
    try:
        with path.open("rb") as file:
            return not hold(file)
    except OSError:
        return False


@contextmanager
def alone_with(path: Path) -> Iterator[None]:
    """Keep everybody else from writing or repairing a bag meanwhile.

    Raises
    ------
    BagError
        If somebody has it open.
    """
    try:
        file = path.open("rb")
    except OSError as error:
        raise BagError(str(path), f"cannot be read: {error.strerror}") from None
    with file:
        if not hold(file):
            raise BagError(
                str(path.parent),
                "another process still writes it",
                "a bag that nobody has open",
                "wait until its run has ended, or end it",
            )
        yield
