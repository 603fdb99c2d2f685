"""What the machine code of a function depends on, as one digest: itself, whatever it calls, and the constants they use.

Compiled, a function has the functions that it calls and the values of global names built in. Numba looks at the file
of the function alone; a helper or a constant that another file has would be out of date in machine code from a cache.
Of what is not known here no digest tells enough, and so there is none: then nothing is to be kept.
"""

from __future__ import annotations

import hashlib
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from enum import Enum, EnumMeta
from functools import lru_cache
from types import BuiltinFunctionType, CodeType, EllipsisType, FunctionType, GenericAlias, ModuleType, NoneType
from typing import Any

import numpy as np

_OF_VERSIONS = ("builtins", "cmath", "llvmlite", "math", "numba", "numpy", "scipy")
"""Packages that are what their version says."""
_OF_TYPES = ("types", "typing")
"""Whose values say what a type checker wants to know."""
_PLAIN = (NoneType, bool, int, float, complex, str, bytes, EllipsisType, np.generic, np.dtype)
"""What its text says all of."""
_ADDRESS = re.compile(r" at 0x[0-9a-f]+")
_Inner = tuple[FunctionType, Any]
"""What numba has compiled, and how it is to be compiled."""


class _Unknown(Exception):
    """Something is used of which nothing here tells all."""


def fingerprint(function: Callable[..., Any]) -> str | None:
    """Digest of all that the machine code of a function is made of, but for the types of arguments.

    Parameters
    ----------
    function
        A Python function.

    Returns
    -------
    str or None
        The same in every process in which the function would be compiled to the same code. None where something is
        used of which that cannot be told, as an object of somebody else's class.
    """
    walk = _Walk()
    try:
        walk.value(function, ())
    except (_Unknown, RecursionError):
        return None
    return walk.digest.hexdigest()


class _Walk:
    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self._seen: dict[tuple[int, tuple[str, ...]], int] = {}
        self._kept: list[Any] = []
        """Those whose addresses stand for them: they must live until all have been seen."""
        self._overloads = _overloads(_count_of_overloads())

    def value(self, value: Any, names: tuple[str, ...]) -> None:
        """Take in what a name stands for; of a module, those of the names that it has."""
        if isinstance(value, FunctionType):
            self._function(value)
        elif (inner := _compiled(value)) is not None:
            self._say(type(value).__qualname__, _ADDRESS.sub("", repr(inner[1])))
            self._function(inner[0])
        elif isinstance(value, ModuleType):
            self._module(value, names)
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
            self._say(repr(value.dtype), value.shape, value.tobytes())
        elif isinstance(value, tuple | list):
            self._say(type(value).__name__, getattr(value, "_fields", ()), len(value))
            for element in value:
                self.value(element, names)
        elif isinstance(value, set | frozenset) and all(isinstance(one, _PLAIN) for one in value):
            self._say(type(value).__name__, sorted(map(repr, value)))
        elif isinstance(value, dict):
            self._say("dict", len(value))
            for pair in value.items():
                self.value(pair, names)
        elif isinstance(value, Enum):
            self._say(value.__class__.__qualname__, value.name)
            self.value(value.value, names)
        elif isinstance(value, type):
            self._class(value, names)
        elif isinstance(value, _PLAIN):
            self._say(type(value).__qualname__, repr(value))
        else:
            self._say(*_words(value))

    def _class(self, value: type, names: tuple[str, ...]) -> None:
        self._say(value.__module__, value.__qualname__)
        if isinstance(value, EnumMeta):
            members: Mapping[str, Any] = value.__members__
            self.value({name: member.value for name, member in members.items()}, names)
        elif issubclass(value, tuple):
            self._say(getattr(value, "_fields", ()))
        elif not (_is_of_a_version(value.__module__) or issubclass(value, BaseException)):
            raise _Unknown(value)

    def _function(self, function: FunctionType) -> None:
        module = function.__globals__.get("__name__")  # what stands in __module__ may be another's
        self._say(module, function.__qualname__)
        if _is_of_a_version(module) or self._was_seen(function, ()):
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
        for stands_in in self._overloads.get(id(function), ()):
            self._function(stands_in)

    def _code(self, code: CodeType) -> None:
        self._say(code.co_code, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars, code.co_flags)
        self._say(code.co_argcount, code.co_kwonlyargcount, code.co_posonlyargcount, code.co_exceptiontable)
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
        """Whether it has been taken in before: then its number says which it is, as names may be shared."""
        key = (id(value), names)
        seen = key in self._seen
        self._say(self._seen.setdefault(key, len(self._seen)))
        self._kept.append(value)
        return seen

    def _say(self, *words: Any) -> None:
        self.digest.update(repr(words).encode())


def _compiled(value: Any) -> _Inner | None:
    """What stands behind an object that numba has made of a Python function."""
    if not _is_of_a_version(type(value).__module__):
        return None
    for holder in (value, getattr(value, "_dispatcher", None), getattr(value, "gufunc_builder", None)):
        if isinstance(inner := getattr(holder, "py_func", None), FunctionType):
            how = dict(getattr(holder, "targetoptions", {})), getattr(holder, "locals", {})
            return inner, (how, getattr(value, "signature", "") if holder is not value else "")
    for name in ("_pyfunc", "_defn"):  # of cfunc, and of an intrinsic
        if isinstance(inner := vars(value).get(name) if hasattr(value, "__dict__") else None, FunctionType):
            return inner, name
    return None


def _words(value: Any) -> tuple[str, ...]:
    """What says all of something that belongs to a package of which the version says all."""
    kind = type(value).__module__
    if isinstance(value, BuiltinFunctionType):
        owner = value.__self__
        if (owner is None or isinstance(owner, ModuleType | type)) and _is_of_a_version(value.__module__):
            return str(value.__module__), value.__qualname__
        raise _Unknown(value)
    known = isinstance(value, GenericAlias) or kind in _OF_TYPES or (_is_of_a_version(kind) and kind != "builtins")
    if not known or isinstance(value, np.ndarray):
        raise _Unknown(value)
    return kind, _ADDRESS.sub("", repr(value))


def _count_of_overloads() -> int:
    templates = sys.modules.get("numba.core.typing.templates")
    return 0 if templates is None else len(templates.builtin_registry.globals)


@lru_cache(maxsize=1)
def _overloads(count: int) -> Mapping[int, list[FunctionType]]:
    """By address of a Python function: what numba has been told to compile in its place; so many things it was told."""
    found: dict[int, list[FunctionType]] = {}
    registered = sys.modules["numba.core.typing.templates"].builtin_registry.globals if count else ()
    for value, kind in registered:  # which keeps them alive
        if isinstance(value, FunctionType):
            for template in getattr(kind, "templates", ()):
                if isinstance(stands_in := getattr(template, "_overload_func", None), FunctionType):
                    found.setdefault(id(value), []).append(stands_in)
    return found


def _is_of_a_version(module: str | None) -> bool:
    return (module or "").partition(".")[0] in _OF_VERSIONS


def _names(code: CodeType) -> Iterable[str]:
    """All names in a function and those within it that may be global or an attribute, once each, in order."""
    found = dict.fromkeys(code.co_names)
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            found.update(dict.fromkeys(_names(constant)))
    return found
