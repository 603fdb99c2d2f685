"""How kernels are compiled: numba, one scalar formula for windows and single samples, cached on disk.

Numba is imported when the first kernel is called: its import takes longer than most commands, which call none.

No fastmath and no parallel loops: both change bits, and the engines have to agree to the last one.

The cache folder carries a digest of the package's numerical sources, so that what earlier versions left can be removed.
"""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from etac_ros.maths.kernel_cache import keep_in_files
from etac_ros.source_digest import digest_of_sources

_ROOMS = ("maths", "plants", "laws", "triggers")
_KEPT_CACHES = 4


def _package_digest() -> str:
    import numba

    package = Path(__file__).resolve().parent.parent
    sources = digest_of_sources(package / room for room in _ROOMS)
    return hashlib.sha256(f"{numba.__version__} {sources}".encode()).hexdigest()[:16]


@functools.cache
def _use_cache_folder() -> None:
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    home = os.environ.get("XDG_CACHE_HOME")
    try:
        base = (Path(home) if home else Path.home() / ".cache") / "etac_ros" / "kernels"
        folder = base / _package_digest()
        folder.mkdir(parents=True, exist_ok=True)
        folder.touch()
        older = sorted(base.iterdir(), key=lambda path: path.stat().st_mtime, reverse=True)[_KEPT_CACHES:]
        for path in older:
            shutil.rmtree(path, ignore_errors=True)
    except (OSError, RuntimeError):  # the latter: a user without a home
        folder = Path(tempfile.gettempdir()) / f"etac_ros_kernels_{os.getuid()}" / _package_digest()
    from numba.core import config

    config.CACHE_DIR = str(folder)  # type: ignore[attr-defined]  # made at import, from the environment


_waiting: list[Callable[[], None]] = []
"""What numba is still to be told: of functions that kernels call, a call each."""


def tell_numba() -> None:
    """Tell numba, if it is there, of all functions that kernels may call. A second call costs nothing.

    Kernels do so by themselves, and so does whoever imports the classes that a scenario names: a user's class may
    compile with numba directly, and call functions of ours.
    """
    if "numba" not in sys.modules or not _waiting:
        return
    while _waiting:
        _waiting.pop()()


def once_numba_is_there(tell: Callable[[], None]) -> None:
    """Call this as soon as numba has been imported: it tells numba of something that kernels may call."""
    _waiting.append(tell)
    tell_numba()


def import_numba() -> None:
    """Import numba here, so that no module that first calls a kernel is blamed where that fails.

    Where coverage is installed numba loads it, a sixth of its import, to tell it of lines that it compiles. Of a
    process in which nobody measures coverage there is nothing to tell.
    """
    absent: Any = None
    hidden = "numba" not in sys.modules and "coverage" not in sys.modules
    if hidden:
        sys.modules["coverage"] = absent
    try:
        import numba  # noqa: F401
    finally:
        if hidden:
            del sys.modules["coverage"]


def kernel(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator of a compiled entry point. Called from Python with contiguous float64 arrays and integers only."""
    compiled: Callable[..., Any] | None = None

    @functools.wraps(function)
    def call(*arguments: Any) -> Any:
        nonlocal compiled
        if compiled is None:
            compiled = _compiled(function)
        return compiled(*arguments)

    return call


def inlined(function: Callable[..., Any]) -> Callable[..., Any]:
    """Decorator of a function that kernels call. It stays an ordinary Python function as well."""

    def tell() -> None:
        from numba.extending import register_jitable

        register_jitable(function)

    once_numba_is_there(tell)
    return function


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    import_numba()
    import numba

    _use_cache_folder()
    tell_numba()
    made: Any = numba.njit(cache=True, error_model="numpy")(function)
    keep_in_files(made)
    kernel: Callable[..., Any] = made
    return kernel
