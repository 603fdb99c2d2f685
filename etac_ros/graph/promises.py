"""The classes that a scenario names, held to their word: whoever breaks a promise is named, with what was expected."""

from __future__ import annotations

import inspect
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from pathlib import Path
from types import FrameType, MethodType
from typing import Any

import numpy as np

import etac_ros
from etac_ros.errors import BrokenPromise, EtacError
from etac_ros.maths.finite import all_finite
from etac_ros.parameters import FloatArray
from etac_ros.plants.plant import Plant

_OURS = f"{Path(etac_ros.__file__).resolve().parent}/"
_NUMBERS = "fiu"
_FLOAT64 = np.dtype(np.float64)


Probe = Callable[["Component", str, tuple[Any, ...], Mapping[str, Any]], Any]
_PROBE: ContextVar[Probe | None] = ContextVar("probe", default=None)


@contextmanager
def probing(probe: Probe) -> Iterator[None]:
    """While this lasts, every call of a component is made by the probe: it may ask twice."""
    token = _PROBE.set(probe)
    try:
        yield
    finally:
        _PROBE.reset(token)


class Component:
    """An object of a class that a scenario names, called with checks of what it returns.

    Parameters
    ----------
    node
        Full name of the node that it is part of.
    owner
        The object.
    named
        The object that answers for it, where that is another, which it wraps.
    """

    def __init__(self, node: str, owner: object, named: object = None) -> None:
        self.node = node
        self.owner = owner
        self.name = type(owner if named is None else named).__name__
        self._takes: dict[tuple[str, str], bool] = {}

    def call(self, method: str, *arguments: Any, **named: Any) -> Any:
        """What a method returns, unchecked.

        Raises
        ------
        BrokenPromise
            If it raises an exception that is none of etac_ros.
        """
        probe = _PROBE.get()
        if probe is not None:
            return probe(self, method, arguments, named)
        # As plain_call, which would cost another call.
        try:
            return getattr(self.owner, method)(*arguments, **named)
        except EtacError:
            raise
        except (Exception, SystemExit) as error:
            raise failure(self.node, f"{self.name}.{method}", error) from error

    def plain_call(self, method: str, arguments: tuple[Any, ...], named: Mapping[str, Any]) -> Any:
        """As :meth:`call`, whoever looks on."""
        function = getattr(self.owner, method)
        try:
            return function(*arguments, **named)
        except EtacError:
            raise
        except (Exception, SystemExit) as error:
            raise failure(self.node, f"{self.name}.{method}", error) from error

    def vector(self, size: int, method: str, *arguments: Any, **named: Any) -> FloatArray:
        """What a method returns, if it is a vector of a size, of numbers where it was given numbers."""
        value = self.array((size,), method, self.call(method, *arguments, **named))
        if not all_finite(value) and are_finite((*arguments, *named.values())):
            raise self.broken(method, f"returned {_listed(value)} for finite arguments", "finite numbers")
        return value

    def rows(self, count: int, size: int, method: str, *arguments: Any) -> FloatArray:
        """What a method returns, if it is a row of a size for each sample.

        Rows of samples that never come to be may hold what is no number: it is not looked at here.
        """
        return self.array((count, size), method, self.call(method, *arguments))

    def checked_index(self, count: int, method: str, found: Any) -> int:
        """What a method has returned, if it is the index of one of so many rows, or -1."""
        if isinstance(found, bool) or not isinstance(found, int | np.integer) or not -1 <= found < count:
            expected = f"the index of one of {count} samples (0 to {count - 1}), or -1 for none"
            raise self.broken(method, f"returned {shown(found)}", expected)
        return int(found)

    def array(self, shape: tuple[int, ...], method: str, value: Any) -> FloatArray:
        """A value as a contiguous array of float64, if it is an array of numbers of a shape."""
        if type(value) is np.ndarray and value.shape == shape and value.dtype == _FLOAT64 and value.flags.c_contiguous:
            return value
        if not isinstance(value, np.ndarray) or value.dtype.kind not in _NUMBERS or value.shape != shape:
            raise self.broken(method, f"returned {shown(value)}", f"an array of floats of shape {shape}")
        return np.ascontiguousarray(value, dtype=np.float64)

    def broken(self, method: str, found: str, expected: str = "", remedy: str = "") -> BrokenPromise:
        """The error that names this object and a method of it."""
        return BrokenPromise(self.node, f"{self.name}.{method} {found}", expected, remedy)

    def takes(self, method: str, parameter: str) -> bool:
        """Whether a method has a parameter of a name: so a class says what it wants to be told."""
        known = self._takes.get((method, parameter))
        if known is None:
            known = self._takes[method, parameter] = takes(getattr(self.owner, method), parameter)
        return known


def check_state_size(owner: object, plant: Plant) -> None:
    """Make sure that what reads a plant's states takes states of that size, where it says a size: ``state_size``.

    A compiled kernel that is shown too few columns reads what lies behind them, and one that is shown those of another
    plant takes one quantity for another.

    Raises
    ------
    ValueError
        If the sizes differ.
    """
    wanted, found = getattr(owner, "state_size", None), plant.initial_state().size
    if wanted is not None and wanted != found:
        raise ValueError(
            f"{type(owner).__name__} takes states of {wanted} components; {type(plant).__name__} has {found}"
        )


def takes(function: Callable[..., Any], parameter: str) -> bool:
    """Whether a function has a parameter of a name."""
    try:
        return parameter in signature_of(function).parameters
    except (TypeError, ValueError):  # a built-in that does not tell
        return False


def signature_of(function: Callable[..., Any]) -> inspect.Signature:
    """The parameters that a call of a function or method has.

    Raises
    ------
    TypeError, ValueError
        If it does not tell.
    """
    return _signature_of_method(function.__func__) if isinstance(function, MethodType) else inspect.signature(function)


@lru_cache(maxsize=1024)  # a sweep builds thousands of graphs of the same classes
def _signature_of_method(function: Callable[..., Any]) -> inspect.Signature:
    return inspect.signature(MethodType(function, object()))


def failure(where: str, called: str, error: BaseException, kind: type[EtacError] = BrokenPromise) -> EtacError:
    """What is said of an exception in a class that a scenario names, with its own part of the traceback below.

    Parameters
    ----------
    where
        Node, or file and key.
    called
        Class and method that were called.
    error
        The exception.
    kind
        Class of what is returned.
    """
    frames = _users_frames(error)
    who = frames[0][0].f_code.co_qualname if frames else called
    details = users_traceback(error)
    if not frames and not isinstance(error, ValueError):  # a fault of etac_ros: its own traceback is what helps
        details = "".join(traceback.format_exception(error)).rstrip()
    return kind(where, f"{who} raised {_in_words(error)}", details=details)


def users_traceback(error: BaseException) -> str:
    """The part of a traceback that is not in etac_ros; empty where there is none."""
    frames = _users_frames(error)
    if not frames:
        return ""
    lines = traceback.StackSummary.extract(iter(frames)).format()
    return "Traceback (most recent call last):\n" + "".join(lines).rstrip() + f"\n{_in_words(error)}"


def _in_words(error: BaseException) -> str:
    return "".join(traceback.format_exception_only(error)).rstrip()


def _users_frames(error: BaseException) -> list[tuple[FrameType, int]]:
    return [frame for frame in traceback.walk_tb(error.__traceback__) if not _is_ours(frame[0].f_code.co_filename)]


def failed_in_etac_ros(error: BaseException) -> bool:
    """Whether an exception has gone through code of etac_ros alone."""
    return all(_is_ours(frame.f_code.co_filename) for frame, _ in traceback.walk_tb(error.__traceback__))


def _is_ours(file: str) -> bool:
    return file.startswith((_OURS, "<frozen"))


def are_finite(arguments: Sequence[Any]) -> bool:
    """Whether all arrays among some arguments are of numbers."""
    return all(all_finite(each) for each in arguments if isinstance(each, np.ndarray) and each.dtype.kind == "f")


def first_broken(values: FloatArray, given: FloatArray) -> int | None:
    """First row that holds what is no number though its sample is one; None where there is none."""
    if all_finite(values):
        return None
    rows = np.flatnonzero(~np.isfinite(values).all(axis=1) & np.isfinite(given).all(axis=1))
    return int(rows[0]) if rows.size else None


def shown(value: Any) -> str:
    """A value as an error shows it."""
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    text = repr(value)
    return f"{text if len(text) <= 60 else text[:57] + '...'} ({type(value).__name__})"


def _listed(value: FloatArray) -> str:
    return f"[{', '.join(f'{number:.6g}' for number in value[:12])}{', ...' if value.size > 12 else ''}]"
