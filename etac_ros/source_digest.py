"""Digests of Python sources, the same on machines whose line ends or editors differ."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

_OF_EDITORS = (".", "#")
"""How the names of files begin that editors keep beside one that is open; some are dead links."""


def source_of(file: Path) -> bytes | None:
    """What stands in a source file; None of what cannot be read."""
    try:
        return file.read_bytes().replace(b"\r\n", b"\n")
    except OSError:
        return None


def digest_of_sources(folders: Iterable[Path]) -> str:
    """Of all source files in and below the folders, and their names."""
    digest = hashlib.sha256()
    for folder in folders:
        for path in sorted(folder.rglob("*.py")):
            if not path.name.startswith(_OF_EDITORS):
                digest.update(path.relative_to(folder).as_posix().encode() + b"\0" + (source_of(path) or b"") + b"\0")
    return digest.hexdigest()
