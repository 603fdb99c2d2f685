"""Classes named in a scenario as ``package.module:Class``, and their validated parameters."""

from __future__ import annotations

import importlib
import json
from collections.abc import Mapping
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from etac_ros.errors import ScenarioError
from etac_ros.scenario.document import nearest


Model = TypeVar("Model", bound=BaseModel)


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
    try:
        module = importlib.import_module(module_name)
    except Exception as error:  # a user's module can fail in any way at import
        raise ScenarioError(
            where, f"'{module_name}' cannot be imported ({type(error).__name__}: {error})", "",
            "is its package installed in this environment, or its folder on PYTHONPATH?",
        ) from None  # fmt: skip
    found = getattr(module, class_name, None)
    if not isinstance(found, type):
        names = [name for name, value in vars(module).items() if isinstance(value, type)]
        raise ScenarioError(where, f"'{module_name}' has no class '{class_name}'", _did_you_mean(class_name, names))
    return found


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
        return model.model_validate_json(json.dumps(values), strict=True)
    except ValidationError as error:
        faults = [_fault(model, fault, where) for fault in error.errors()]
    except (TypeError, ValueError) as error:
        faults = [ScenarioError(where, str(error))]
    if len(faults) == 1:
        raise faults[0]
    raise ScenarioError(where, f"{len(faults)} faults\n" + "\n".join(str(fault) for fault in faults))


def _fault(model: type[BaseModel], fault: Mapping[str, Any], where: str) -> ScenarioError:
    path = [str(part) for part in fault["loc"]]
    key = ".".join([where, *path]) if path else where
    found = fault["input"]
    if fault["type"] == "extra_forbidden":
        names = _field_names(model, path[:-1])
        return ScenarioError(key, f"unknown key '{path[-1]}'", _did_you_mean(path[-1], names))
    if fault["type"] == "missing":
        return ScenarioError(key, "is missing", "a value: this key has no default")
    text = str(fault["msg"]).removeprefix("Value error, ")
    shown = json.dumps(found, default=str)
    return ScenarioError(key, f"found {shown if len(shown) < 90 else shown[:87] + '...'}", text)


def _field_names(model: type[BaseModel], path: list[str]) -> list[str]:
    current: Any = model
    for part in path:
        fields = getattr(current, "model_fields", {})
        annotation = fields[part].annotation if part in fields else None
        options = [annotation, *getattr(annotation, "__args__", ())]
        current = next((o for o in options if isinstance(o, type) and issubclass(o, BaseModel)), None)
    return [field.alias or name for name, field in getattr(current, "model_fields", {}).items()]


def _did_you_mean(name: str, candidates: list[str]) -> str:
    best = nearest(name, candidates)
    listed = ", ".join(sorted(candidates))
    return f"'{best}'? (there are: {listed})" if best else f"one of: {listed}"
