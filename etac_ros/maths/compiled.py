"""How kernels are compiled: numba, one scalar formula for windows and single samples, cached on disk.

No fastmath and no parallel loops: both change bits, and the engines have to agree to the last one.

Numba does not see that a kernel depends on functions of other files, so a changed helper would leave a stale
machine-code file in use. The cache folder therefore carries a digest of the package's numerical sources, and
:func:`source_digest` does the same for a user's own file.
"""

from __future__ import annotations

import hashlib
import inspect
import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.extending import register_jitable

_ROOMS = ("maths", "plants", "laws", "triggers")
_KEPT_CACHES = 4


def _package_digest() -> str:
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256(numba.__version__.encode())
    for room in _ROOMS:
        for path in sorted((package / room).glob("*.py")):
            digest.update(path.name.encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _use_cache_folder() -> None:
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    home = os.environ.get("XDG_CACHE_HOME")
    base = (Path(home) if home else Path.home() / ".cache") / "etac_ros" / "kernels"
    folder = base / _package_digest()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        older = sorted(base.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)[_KEPT_CACHES:]
        for path in older:
            shutil.rmtree(path, ignore_errors=True)
    except OSError:
        folder = Path(tempfile.gettempdir()) / f"etac_ros_kernels_{os.getuid()}" / _package_digest()
    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # made at import, from the environment


_use_cache_folder()

kernel: Callable[..., Any] = numba.njit(cache=True, error_model="numpy")
"""Decorator of a compiled entry point. Called from Python with contiguous float64 arrays and integers only."""

inlined: Callable[..., Any] = register_jitable
"""Decorator of a function that kernels call. It stays an ordinary Python function as well."""


def source_digest(*functions: Callable[..., Any]) -> str:
    """Digest of the files in which the functions stand, to be kept in a kernel's closure.

    Parameters
    ----------
    functions
        Functions that a kernel made by a factory calls.

    Returns
    -------
    str
        A digest that changes when one of those files changes.
    """
    digest = hashlib.sha256()
    for function in functions:
        digest.update(Path(inspect.getfile(function)).read_bytes())
    return digest.hexdigest()[:16]
