"""Files that are there whole or not at all, whoever reads them meanwhile and whatever ends who writes them."""

from __future__ import annotations

import tempfile
from contextlib import suppress
from pathlib import Path


def write_at_once(path: Path, content: bytes) -> None:
    """Write a file.

    Raises
    ------
    OSError
        If it cannot be written; nothing is left then.
    """
    written: Path | None = None
    try:
        with tempfile.NamedTemporaryFile(dir=path.parent, prefix=path.name, delete=False) as file:
            written = Path(file.name)
            file.write(content)
        written.replace(path)
    except OSError:
        if written is not None:
            with suppress(OSError):
                written.unlink()
        raise
