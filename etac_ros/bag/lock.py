"""Who has a bag open: its writer holds a lock on the file, which its end releases, however it ends."""

from __future__ import annotations

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from etac_ros.errors import BagError


def take(file: BinaryIO) -> None:
    """Take the lock of a file that was just made, until :func:`give_back` or the end of the process."""
    with suppress(OSError):  # a file system without locks
        fcntl.flock(file, fcntl.LOCK_EX)  # nobody holds it longer than a look takes


def give_back(file: BinaryIO) -> None:
    """Release the lock, also where a child of this process has inherited the open file."""
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_UN)


def _is_free(file: BinaryIO, kind: int) -> bool:
    """Take a lock if nobody is in its way; true also where the file system has none: nothing is known then."""
    try:
        fcntl.flock(file, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:
        return True
    return True


def is_being_written(path: Path) -> bool:
    """Whether a process that lives still writes this file."""
    try:
        with path.open("rb") as file:
            return not _is_free(file, fcntl.LOCK_SH)  # any number may look at the same time
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
        if not _is_free(file, fcntl.LOCK_EX):
            raise BagError(
                str(path.parent),
                "another process still writes it",
                "a bag that nobody has open",
                "wait until its run has ended, or end it",
            )
        yield
