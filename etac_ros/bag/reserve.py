"""Names for bags, reserved: of any number of runs that start at once, each gets a directory of its own.

A reserved directory holds one file, the mark. Whoever removes the mark owns the directory; both making a directory
and removing a file succeed for one process only.
"""

from __future__ import annotations

import os
from itertools import count
from pathlib import Path

from etac_ros.errors import BagError

MARK = ".reserved"


def reserve(folder: Path, stem: str) -> Path:
    """Make a directory that nobody else has, and mark it.

    Parameters
    ----------
    folder
        Where; made if it is not there.
    stem
        The name that is wanted; where it is taken, a number follows it.

    Raises
    ------
    BagError
        If nothing can be made there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for number in count(1):
            directory = folder / (stem if number == 1 else f"{stem}_{number}")
            try:
                directory.mkdir()
            except FileExistsError:
                continue
            (directory / MARK).touch(exist_ok=False)
            return directory
    except OSError as error:
        wanted = "a folder that may be written to"
        raise BagError(str(folder / stem), f"cannot be made ({error.strerror})", wanted, "choose another") from None
    raise AssertionError("count never ends")


def is_reserved(directory: Path) -> bool:
    """Whether a directory is reserved, and no bag has been begun in it."""
    return os.path.lexists(directory / MARK)


def claim(directory: Path) -> None:
    """Make the directory of a bag, or take over one that was reserved for it.

    Raises
    ------
    FileExistsError
        If it is there and was not reserved, or somebody else took it over.
    OSError
        If it cannot be made.
    """
    try:
        directory.mkdir(parents=True)
    except FileExistsError:
        try:
            (directory / MARK).unlink()
        except (FileNotFoundError, NotADirectoryError):
            raise FileExistsError(str(directory)) from None


def release(directory: Path) -> bool:
    """Remove a directory that was reserved and is not needed; one in which a bag was begun is left alone.

    Returns
    -------
    bool
        Whether it was removed.
    """
    try:
        (directory / MARK).unlink()
        directory.rmdir()
    except OSError:
        return False
    return True
