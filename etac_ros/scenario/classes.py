"""Classes named in a scenario as ``package.module:Class``, and their validated parameters."""

from __future__ import annotations

import importlib
import inspect
import json
import traceback
from collections.abc import Callable
from functools import cache, lru_cache
from types import UnionType
from typing import Any, Generic, Protocol, TypeVar, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, ValidationError, create_model

from etac_ros.errors import EtacError, ScenarioError
from etac_ros.graph.module import Module
from etac_ros.graph.promises import failed_in_etac_ros, failure, users_traceback
from etac_ros.graph.role import Role
from etac_ros.maths.compiled import tell_numba
from etac_ros.parameters import Parameters
from etac_ros.scenario.document import choice
from etac_ros.scenario.faults import faults_of
from etac_ros.scenario.trust import is_own, may_import
from etac_ros.triggers.rule import AnyRule
from etac_ros.triggers.timing import RuleTiming, timed

Model = TypeVar("Model", bound=BaseModel)
_OURS = "etac_ros."
_MOST_FAULTS = 30
"""Faults that are listed; a file of millions has as many."""


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
        tell_numba()
    except (Exception, SystemExit) as error:  # a user's module can fail in any way at import
        missing = isinstance(error, ImportError)
        raise ScenarioError(
            where, f"'{module_name}' cannot be imported ({type(error).__name__}: {error})", "",
            "is its package installed in this environment, or its folder on PYTHONPATH?" if missing else "",
            "" if missing else users_traceback(error),
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
        if issubclass(model, Parameters) and model.__module__.startswith(_OURS):
            found: Model = _own_parameters(model, json.dumps(values))
            return found
        return model.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        faults = faults_of(model, values, error.errors()[:_MOST_FAULTS], where)
        more = error.error_count() - _MOST_FAULTS
    except (TypeError, ValueError) as error:
        faults, more = [ScenarioError(where, str(error))], 0
    if len(faults) == 1:
        raise faults[0]
    counted = f"{len(faults)} faults" if more <= 0 else f"{len(faults)} faults and {more:,} more"
    raise ScenarioError(where, f"{counted}\n" + "\n".join(str(fault) for fault in faults))


@lru_cache(maxsize=512)  # a sweep builds thousands of graphs, in which few parameters differ
def _own_parameters(model: type[Model], text: str) -> Model:
    """Parameters of a class of ours: nobody can change them, so whoever asks for the same may have the same."""
    return model.model_validate_json(text, strict=True)


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
        If the constructor does not take these arguments, refuses them, or raises an exception, whose traceback stands
        below then.
    """
    try:
        return kind(*arguments, **components)
    except EtacError:
        raise
    except (Exception, SystemExit) as error:
        if isinstance(error, TypeError):
            _check_signature(kind, where, arguments, components)
        if isinstance(error, ValueError) and _raised_by_constructor(error):
            raise ScenarioError(where, str(error)) from None
        raise failure(where, f"{kind.__name__}.__init__", error, ScenarioError) from error


def _raised_by_constructor(error: BaseException) -> bool:
    """Whether a constructor itself refuses what it is given; else something that it calls has failed."""
    frames = [frame for frame, _ in traceback.walk_tb(error.__traceback__)]
    return not frames or len(frames) == 2 or failed_in_etac_ros(error)


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


Interface = tuple[type, ...]
"""The protocols of which a class has to keep one; none where nothing is asked."""


def interface(kind: type, component: str) -> Interface:
    """What a module class asks of one of its components: its constructor's annotation, a protocol or several."""
    return _protocols(_hints(kind.__init__).get(component))  # type: ignore[misc]


def _protocols(annotation: Any) -> Interface:
    alternatives = get_args(annotation) if get_origin(annotation) in (UnionType, Union) else (annotation,)
    return tuple(found for found in alternatives if getattr(found, "_is_protocol", False))


_RULES = _protocols(AnyRule)


def parameters_of(kind: type, wanted: Interface) -> type[BaseModel]:
    """The parameter class of a component: its own, and that of the times around it where it is a trigger rule."""
    own: type[BaseModel] = kind.Parameters  # type: ignore[attr-defined]  # with_parameters() has seen to that
    return own if wanted != _RULES else _with_timing(own)


@cache
def _with_timing(own: type[BaseModel]) -> type[BaseModel]:
    shared = [name for name in RuleTiming.model_fields if name in own.model_fields]
    if shared:  # the rule has its own idea of them
        return own
    bases = (own,) if issubclass(RuleTiming, own) else (own, RuleTiming)
    if issubclass(RuleTiming, own):
        return RuleTiming
    return create_model(own.__name__, __base__=bases, __module__=own.__module__, __doc__=own.__doc__)


def component(kind: type, wanted: Interface, parameters: BaseModel, ticks_per_second: int, where: str) -> Any:
    """The object of a component, with the times around it where it is a trigger rule.

    Raises
    ------
    ScenarioError
        If it cannot be made, or lacks attributes that its module asks for.
    """
    built = made(kind, where, parameters, ticks_per_second)
    check_attributes(built, wanted, f"{where}.class")
    if isinstance(parameters, RuleTiming):
        return made(timed, where, built, parameters, ticks_per_second)  # type: ignore[arg-type]  # it makes an object
    return built


@cache  # a sweep builds thousands of graphs, and annotations do not change
def _hints(function: Callable[..., Any]) -> dict[str, Any]:
    try:
        return get_type_hints(function)
    except NameError:  # a user's annotation that only type checkers can see
        return {}


def check_module(module: Module, where: str) -> None:
    """Refuse a module whose ports and role make no sense, as soon as it is built."""
    name = type(module).__name__
    for direction in ("inputs", "outputs"):
        ports = getattr(module, direction, None)
        if not isinstance(ports, dict):
            remedy = "call super().__init__(context) first" if ports is None else ""
            raise ScenarioError(where, f"{name} has no dict '{direction}'", "a size for each port", remedy)
        for port, size in ports.items():
            if isinstance(size, bool) or not isinstance(size, int) or size < 1:
                raise ScenarioError(where, f"{name}.{direction}[{port!r}] is {size!r}", "components: an int from 1 on")
    if not isinstance(module.role, Role):
        raise ScenarioError(where, f"{name}.role is {module.role!r}", "a Role of etac_ros.graph.role")
    try:
        module.role.check_ports(module.inputs, module.outputs)
    except ValueError as error:
        raise ScenarioError(where, f"the role of {name}: {error}") from None


def check_methods(kind: type, wanted: Interface, where: str) -> None:
    """Refuse a class that lacks methods of a protocol."""

    def members(base: type) -> set[str]:
        return {name for name, value in vars(base).items() if callable(value)}

    _refuse_if_lacking(kind, kind.__name__, wanted, members, where)


def check_attributes(built: Any, wanted: Interface, where: str) -> None:
    """Refuse an object that lacks attributes of a protocol; its constructor may have set them."""

    def members(base: type) -> set[str]:
        return set(base.__annotations__)

    _refuse_if_lacking(built, type(built).__name__, wanted, members, where)


def _bases(wanted: type) -> list[type]:
    return [base for base in wanted.__mro__ if base not in (Protocol, Generic, object)]


def _refuse_if_lacking(
    found: Any, name: str, wanted: Interface, members: Callable[[type], set[str]], where: str
) -> None:
    """Refuse what has not all the members of any one protocol; the one that it comes nearest to is shown."""
    lacking = {
        protocol: sorted(
            member
            for base in _bases(protocol)
            for member in members(base)
            if not member.startswith("_") and not hasattr(found, member)
        )
        for protocol in wanted
    }
    if not lacking or not all(lacking.values()):
        return
    nearest = min(lacking, key=lambda protocol: len(lacking[protocol]))
    raise ScenarioError(
        where,
        f"{name} has no {', '.join(map(repr, lacking[nearest]))}",
        f"a class like {nearest.__module__}:{nearest.__name__}",
    )
