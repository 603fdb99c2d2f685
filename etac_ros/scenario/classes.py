"""Classes named in a scenario as ``package.module:Class``, and their validated parameters."""

from __future__ import annotations

import importlib
import inspect
import json
from collections.abc import Callable
from functools import cache
from typing import Any, Generic, Protocol, TypeVar, get_type_hints

from pydantic import BaseModel, ValidationError

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import choice
from etac_ros.scenario.faults import faults_of
from etac_ros.scenario.trust import is_own, may_import

Model = TypeVar("Model", bound=BaseModel)


class ForeignClassError(ScenarioError):
    """A file names a class that is not of etac_ros, where nobody said that it may be imported."""


def import_class(path: str, where: str) -> type:
    """The class behind ``package.module:Class``.

    Raises
    ------
    ScenarioError
        If the module cannot be imported or has no such class.
    """
    module_name, colon, class_name = path.partition(":")
    if not colon or not module_name or not class_name:
        raise ScenarioError(where, f"found '{path}'", "a class as package.module:Class")
    if not may_import(path):
        raise ForeignClassError(where, f"'{path}' is no class of etac_ros", "", "import it only if you trust it")
    try:
        module = importlib.import_module(module_name)
    except (Exception, SystemExit) as error:  # a user's module can fail in any way at import, or end the process
        raise ScenarioError(
            where, f"'{module_name}' cannot be imported ({type(error).__name__}: {error})", "",
            "is its package installed in this environment, or its folder on PYTHONPATH?",
        ) from None  # fmt: skip
    found = getattr(module, class_name, None)
    if isinstance(found, type) and is_own(path) and found.__module__ != module_name:
        found = None  # it has only been imported there
    if not isinstance(found, type):
        names = [name for name, value in vars(module).items() if _is_of(value, module_name)]
        raise ScenarioError(where, f"'{module_name}' has no class '{class_name}'", choice(class_name, sorted(names)))
    return found


def _is_of(value: Any, module: str) -> bool:
    """Whether a value is a class of its module that a scenario may name."""
    return isinstance(value, type) and value.__module__ == module and not issubclass(value, BaseModel)


def validated(model: type[Model], values: Any, where: str) -> Model:
    """Check values against a parameter class; every fault is reported, each with its key.

    Parameters
    ----------
    model
        The parameter class.
    values
        What stands in the file.
    where
        File and key of ``values``, to begin the messages with.

    Raises
    ------
    ScenarioError
        With one line a fault: key, what was found, what was expected, and the nearest valid name.
    """
    try:
        # JSON mode is strict about types, yet takes lists for tuples and texts for enumerations.
        return model.model_validate_json(json.dumps(values, default=str), strict=True)
    except ValidationError as error:
        faults = faults_of(model, values, error.errors(), where)
    except (TypeError, ValueError) as error:
        faults = [ScenarioError(where, str(error))]
    if len(faults) == 1:
        raise faults[0]
    raise ScenarioError(where, f"{len(faults)} faults\n" + "\n".join(str(fault) for fault in faults))


def with_parameters(kind: type, where: str) -> Any:
    """The class, if it has a parameter class.

    Raises
    ------
    ScenarioError
        If it has none.
    """
    model = getattr(kind, "Parameters", None)
    if not isinstance(model, type) or not issubclass(model, BaseModel):
        raise ScenarioError(
            where,
            f"{kind.__name__} has no 'Parameters'",
            "a class attribute of this name: a subclass of etac_ros.parameters.Parameters",
        )
    return kind


def made(kind: type, where: str, *arguments: Any, **components: Any) -> Any:
    """An object of a class that a scenario names.

    Raises
    ------
    ScenarioError
        If the constructor does not take these arguments, or refuses them.
    """
    try:
        return kind(*arguments, **components)
    except ValueError as error:
        raise ScenarioError(where, str(error)) from None
    except TypeError:
        _check_signature(kind, where, arguments, components)
        raise  # the fault is not in how it was called


def _check_signature(kind: type, where: str, arguments: tuple[Any, ...], components: dict[str, Any]) -> None:
    try:
        inspect.signature(kind).bind(*arguments, **components)
    except TypeError as error:
        wanted = [type(argument).__name__ for argument in arguments] + list(components)
        raise ScenarioError(
            where,
            f"{kind.__name__}() does not take what it is given ({error})",
            f"arguments {', '.join(wanted)}",
        ) from None


def interface(kind: type, component: str) -> type | None:
    """The protocol that a module class asks of one of its components: its constructor's annotation."""
    found = _hints(kind.__init__).get(component)  # type: ignore[misc]
    return found if getattr(found, "_is_protocol", False) else None


@cache  # a sweep builds thousands of graphs, and annotations do not change
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    try:
        return get_type_hints(function)
    except NameError:  # a user's annotation that only type checkers can see
        return {}


def check_methods(kind: type, wanted: type | None, where: str) -> None:
    """Refuse a class that lacks methods of a protocol."""
    members = {name for base in _bases(wanted) for name, value in vars(base).items() if callable(value)}
    _refuse_if_lacking(kind, kind.__name__, members, wanted, where)


def check_attributes(built: Any, wanted: type | None, where: str) -> None:
    """Refuse an object that lacks attributes of a protocol; its constructor may have set them."""
    members = {name for base in _bases(wanted) for name in base.__annotations__}
    _refuse_if_lacking(built, type(built).__name__, members, wanted, where)


def _bases(wanted: type | None) -> list[type]:
    return [] if wanted is None else [base for base in wanted.__mro__ if base not in (Protocol, Generic, object)]


def _refuse_if_lacking(found: Any, name: str, members: set[str], wanted: type | None, where: str) -> None:
    lacking = [f"'{name}'" for name in sorted(members) if not name.startswith("_") and not hasattr(found, name)]
    if wanted is not None and lacking:
        raise ScenarioError(
            where,
            f"{name} has no {', '.join(lacking)}",
            f"a class like {wanted.__module__}:{wanted.__name__}",
        )
