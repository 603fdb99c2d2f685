"""Digest of the code of a user's classes: with a scenario's values it decides what a run does.

A sweep that goes on, and nodes that are started on several machines, have to be of the same code. Compared are source
files, of the class and of every module of the user's that it imports; packages that are installed are what their
version says.
"""

from __future__ import annotations

import ast
import hashlib
import sys
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.util import resolve_name
from pathlib import Path
from types import ModuleType

_INSTALLED = ("site-packages", "dist-packages")
_OWN = __name__.partition(".")[0]


def code_digests(classes: Sequence[str]) -> dict[str, str]:
    """Digest of the code of each class, as ``package.module:Class``, that has been imported and is no class of ours."""
    return {path: found for path in classes if (found := _code(path.partition(":")[0]))}


@cache
def _code(name: str) -> str:
    """As it was when it was first asked for: later a process does not import it anew."""
    digest = hashlib.sha256()
    pending, seen = [name], set()
    while pending:
        module = sys.modules.get(pending.pop(0))
        if module is None or module.__name__ in seen or (source := _source(module)) is None:
            continue
        seen.add(module.__name__)
        digest.update(module.__name__.encode() + b"\0" + source + b"\0")
        pending += _imports(module, source)
    return digest.hexdigest()[:16] if seen else ""


def _source(module: ModuleType) -> bytes | None:
    """What stands in the file of a module of the user's."""
    file = getattr(module, "__file__", None)
    if not file or module.__name__.partition(".")[0] in (*sys.stdlib_module_names, _OWN):
        return None
    path = Path(file)
    if any(part in _INSTALLED for part in path.parts):
        return None
    try:
        return path.read_bytes()
    except OSError:
        return None


def _imports(module: ModuleType, source: bytes) -> Iterator[str]:
    """Names of what a module may import, in its order; some are no modules."""
    try:
        statements = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError):  # edited since, or no Python source
        return
    for statement in statements:
        if isinstance(statement, ast.Import):
            for alias in statement.names:
                yield from _with_packages(alias.name)
        elif isinstance(statement, ast.ImportFrom):
            try:
                base = resolve_name("." * statement.level + (statement.module or ""), module.__package__)
            except (ImportError, ValueError):
                continue
            yield from _with_packages(base)
            for alias in statement.names:
                yield f"{base}.{alias.name}"


def _with_packages(name: str) -> Iterator[str]:
    parts = name.split(".")
    for count in range(1, len(parts) + 1):
        yield ".".join(parts[:count])
