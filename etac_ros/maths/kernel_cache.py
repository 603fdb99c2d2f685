"""Machine code of kernels on disk: a file for each, whose name says everything that the code depends on.

Numba numbers its files and keeps an index of them, which it writes first. Two processes that compile at the same time
then get each other's code, and so does every later one if a process is killed between the two: a wrong result, without
a word. Here nothing refers to a file but its name, so that whoever finds one has the right code, whatever others do.
"""

from __future__ import annotations

import contextlib
import glob
import hashlib
import importlib
import pickle
from pathlib import Path
from typing import Any

from etac_ros.maths.fingerprint import fingerprint
from etac_ros.whole_files import write_at_once

_CHECKED = hashlib.sha256
_CHECK_BYTES = _CHECKED().digest_size
_LONGEST = 120
_MOST = 32
"""How many files a function may have: of its versions, and of values that it has closed over."""


class KernelFiles:
    """The files of one function, in the place of numba's index and its numbered files.

    Parameters
    ----------
    folder
        Where they are kept.
    function
        Name of the function, as a part of file names.
    version
        What the code depends on besides the key.
    """

    def __init__(self, folder: Path, function: str, version: str) -> None:
        self._folder = folder
        self._function = function
        if len(function) > _LONGEST:  # file names end at 255 bytes, and names of kernels name all their parts
            self._function = f"{function[:_LONGEST]}.{hashlib.sha256(function.encode()).hexdigest()[:16]}"
        self._version = version

    def path(self, key: Any) -> Path:
        """Where the code for a signature and a processor is kept."""
        digest = hashlib.sha256(repr((self._version, key)).encode()).hexdigest()[:32]
        return self._folder / f"{self._function}.{digest}.nbc"

    def load(self, key: Any) -> Any:
        """What was kept; None if nothing was, or not all of it is there any more."""
        path = self.path(key)
        try:
            kept = path.read_bytes()
            path.touch()  # it is in use
        except OSError:
            return None
        check, content = kept[:_CHECK_BYTES], kept[_CHECK_BYTES:]
        return pickle.loads(content) if _CHECKED(content).digest() == check else None

    def save(self, key: Any, data: Any) -> None:
        """Keep machine code. Where that cannot be done (a full disk) it is compiled anew the next time."""
        content = importlib.import_module("numba.core.serialize").dumps(data)
        with contextlib.suppress(OSError):
            write_at_once(self.path(key), _CHECKED(content).digest() + content)
            self._forget_older()

    def _forget_older(self) -> None:
        """Remove what has not been used for longest, as of earlier versions. Who wants it then compiles."""
        files = list(self._folder.glob(f"{glob.escape(self._function)}.*.nbc*"))  # and of who was killed
        if len(files) > _MOST:
            for path in sorted(files, key=lambda path: path.stat().st_mtime_ns)[: len(files) - _MOST]:
                path.unlink(missing_ok=True)


def keep_in_files(made: Any) -> None:
    """Have the machine code of a function that numba is to cache kept in :class:`KernelFiles`.

    And have it loaded without what only compiling needs: numba readies its compiler first, all that it knows of numpy,
    and scipy for the sake of BLAS, which is three quarters of what a command spends on kernels. Machine code needs the
    runtime alone, and where none is kept the compiler is readied as ever.

    This goes by names that numba does not publish. Where they are no more, nothing is cached, since what numba would
    do may be wrong; compiling takes seconds then. Nor is what uses something of which no fingerprint tells all.
    """
    try:
        base: Any = importlib.import_module("numba.core.caching").FunctionCache
        runtime: Any = importlib.import_module("numba.core.runtime").rtsys
        versions = [importlib.import_module(name).__version__ for name in ("numba", "llvmlite", "numpy")]
        find = base._load_overload
        known = fingerprint(made.py_func)

        class Cache(base):  # type: ignore[misc]  # of a module without types
            def __init__(self, function: Any) -> None:
                super().__init__(function)
                folder = Path(self._impl.locator.get_cache_path())
                self._cache_file = KernelFiles(folder, self._impl.filename_base, f"{versions} {known}")

            def _index_key(self, signature: Any, generator: Any) -> Any:
                return signature, generator.magic_tuple()

            def load_overload(self, signature: Any, target: Any) -> Any:
                runtime.initialize(target)
                return find(self, signature, target)

        if known is None:
            made._cache = importlib.import_module("numba.core.caching").NullCache()
        else:
            made._cache = Cache(made.py_func)
    except (ImportError, AttributeError):
        made._cache = importlib.import_module("numba.core.caching").NullCache()
