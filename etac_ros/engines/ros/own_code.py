"""Which code of etac_ros a process runs: that of nodes that are started by hand, on several machines, has to agree."""

from __future__ import annotations

import hashlib
from functools import cache
from pathlib import Path

import etac_ros


@cache
def own_code() -> str:
    """The version, and a digest of all source files: working copies of one version may differ."""
    package = Path(etac_ros.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        if path.stem.isidentifier():  # editors keep files of theirs beside one that is open, some of them dead links
            source = path.read_bytes().replace(b"\r\n", b"\n")
            digest.update(path.relative_to(package).as_posix().encode() + b"\0" + source + b"\0")
    return f"{etac_ros.__version__}, {digest.hexdigest()[:8]}"
