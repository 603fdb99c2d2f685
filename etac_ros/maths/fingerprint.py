"""What the machine code of a function depends on, as one digest: itself, whatever it calls, and the constants they use.

Compiled, a function has the functions that it calls and the values of global names built in. Numba looks at the file
of the function alone; a helper or a constant that another file has would be out of date in machine code from a cache.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterable
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

_OF_VERSIONS = ("builtins", "cmath", "llvmlite", "math", "numba", "numpy", "scipy")
"""Packages that are what their version says."""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")


def fingerprint(function: Callable[..., Any]) -> str:
    """Digest of all that the machine code of a function is made of, but for the types of arguments.

    Parameters
    ----------
    function
        A Python function.

    Returns
    -------
    str
        The same in every process in which the function would be compiled to the same code.
    """
    walk = _Walk()
    walk.value(function, ())
    return walk.digest.hexdigest()


class _Walk:
    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self._seen: set[tuple[int, tuple[str, ...]]] = set()
        self._kept: list[Any] = []
        """Those whose addresses stand for them: they must live until all have been seen."""

    def value(self, value: Any, names: tuple[str, ...]) -> None:
        """Take in what a name stands for; of a module, those of the names that it has."""
        if isinstance(value, FunctionType):
            self._function(value)
        elif isinstance(inner := getattr(value, "py_func", None), FunctionType):  # compiled by numba
            self._function(inner)
        elif isinstance(value, ModuleType):
            self._module(value, names)
        elif isinstance(value, np.ndarray):
            self._say(value.dtype.str, value.shape, value.tobytes())
        elif isinstance(value, tuple | list):
            self._say(type(value).__name__, len(value))
            for element in value:
                self.value(element, names)
        elif isinstance(value, set | frozenset):
            self._say(type(value).__name__, sorted(map(repr, value)))
        elif isinstance(value, type) or callable(value):
            self._say(getattr(value, "__module__", ""), getattr(value, "__qualname__", _ADDRESS.sub("", repr(value))))
        else:
            self._say(type(value).__qualname__, _ADDRESS.sub("", repr(value)))

    def _function(self, function: FunctionType) -> None:
        self._say(function.__module__, function.__qualname__)
        if _is_of_a_version(function.__module__) or self._was_seen(function, ()):
            return
        self._code(function.__code__)
        for default in (*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).items()):
            self.value(default, ())
        names = tuple(_names(function.__code__))
        for cell in function.__closure__ or ():
            try:
                self.value(cell.cell_contents, names)
            except ValueError:  # not filled yet
                self._say("empty")
        for name in names:
            if name in function.__globals__:
                self._say(name)
                self.value(function.__globals__[name], names)

    def _code(self, code: CodeType) -> None:
        self._say(code.co_code, code.co_names, code.co_varnames, code.co_freevars)
        for constant in code.co_consts:
            if isinstance(constant, CodeType):
                self._code(constant)
            else:
                self.value(constant, ())

    def _module(self, module: ModuleType, names: tuple[str, ...]) -> None:
        self._say(module.__name__)
        if _is_of_a_version(module.__name__) or self._was_seen(module, names):
            return
        for name in names:
            if name in vars(module):
                self._say(name)
                self.value(vars(module)[name], names)

    def _was_seen(self, value: Any, names: tuple[str, ...]) -> bool:
        key = (id(value), names)
        seen = key in self._seen
        self._seen.add(key)
        self._kept.append(value)
        return seen

    def _say(self, *words: Any) -> None:
        self.digest.update(repr(words).encode())


def _is_of_a_version(module: str | None) -> bool:
    return (module or "").partition(".")[0] in _OF_VERSIONS


def _names(code: CodeType) -> Iterable[str]:
    """All names in a function and those within it that may be global or an attribute, once each, in order."""
    found = dict.fromkeys(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found.update(dict.fromkeys(_names(constant)))
    return found
