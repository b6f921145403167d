"""Check the arguments of library functions against their annotations. Needs the standard library only, except for arrays.

A value of the wrong type raises TypeError; a value of the right type that is out of range raises a KarfError.
"""

from __future__ import annotations

import inspect
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields
from functools import cache, wraps
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, cast

from ..errors import BadRequest

if TYPE_CHECKING:
    import numpy as np

Function = TypeVar("Function", bound=Callable[..., Any])
NAMES = {
    "str": "a text", "int": "a whole number", "float": "a number", "bool": "True or False", "Path": "a path",
    "ndarray": "an array", "NoneType": "None",
}  # fmt: skip
LONGEST = 80  # characters of a value quoted in a message


def check_arguments(function: Function) -> Function:
    """Decorate a function so that arguments of other types than annotated raise TypeError.

    Examples:
        >>> @checked
        ... def double(number: int) -> int:
        ...     return 2 * number
        >>> double("2")
        Traceback (most recent call last):
        TypeError: double takes a whole number as number, not '2'.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        bound, annotations = signature.bind(*args, **kwargs), _types_of(function)
        for name, value in bound.arguments.items():
            if name in annotations and signature.parameters[name].kind is not inspect.Parameter.VAR_KEYWORD:
                check_type(function.__qualname__.removesuffix(".__init__"), name, value, annotations[name])
        return function(*args, **kwargs)

    return cast(Function, wrapper)


def check_fields(record: Any) -> None:
    """Raise TypeError if a field of a dataclass instance has another type than declared."""
    annotations = _types_of(type(record))
    for item in fields(record):
        check_type(type(record).__name__, item.name, getattr(record, item.name), annotations[item.name])


def check_type(what: str, name: str, value: Any, kind: Any) -> None:
    """Check a value against an annotation.

    Raises TypeError, or BadRequest for a path that is empty or has a NUL character.
    """
    if not _fits(value, kind):
        raise TypeError(f"{what} takes {_name_of(kind)} as {name}, not {format_value(value)}.")
    if isinstance(value, str) and Path in typing.get_args(kind) and (not value or "\0" in value):
        raise BadRequest(f"{name} = {value!r:.200} is no path.", "Give the path of a file or folder.")


def check_number(name: str, value: float, lowest: float, highest: float | None = None) -> None:
    """Raise BadRequest if a number is not finite or outside [lowest, highest]; a `highest` of None means no limit.

    Examples:
        >>> check_number("size", 0, 1)
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: size = 0 is out of range. Allowed: from 1.
    """
    if lowest <= value <= (sys.float_info.max if highest is None else highest):
        return
    allowed = f"from {lowest}" if highest is None else f"{lowest} to {highest}"
    raise BadRequest(f"{name} = {value!r} is out of range.", f"Allowed: {allowed}.")


def check_array(name: str, array: np.ndarray, shape: tuple[int | str, ...]) -> None:
    """Check that an array is numeric and has a shape; a string such as "n" allows any size.

    Raises:
        TypeError: The argument is not an array.
        BadRequest: The array has another shape or is not numeric.

    Examples:
        >>> import numpy as np
        >>> check_array("points", np.zeros((2, 2)), ("n", 3))
        Traceback (most recent call last):
        karf_engine.errors.BadRequest: points is an array of shape (2, 2). Give numbers [n, 3].
    """
    import numpy as np  # the rest of this module must run without numpy

    check_type("This", name, array, np.ndarray)
    fits = len(array.shape) == len(shape) and all(
        isinstance(wanted, str) or size == wanted for size, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in "biuf":
        raise BadRequest(f"{name} is {format_value(array)}.", f"Give numbers [{', '.join(map(str, shape))}].")


def check_choice(name: str, value: str, choices: Sequence[str]) -> None:
    """Raise BadRequest if a value is not one of the choices."""
    if value not in choices:
        raise BadRequest(f"{name} = {format_value(value)} is unknown.", f"Use one of: {', '.join(choices)}.")


def format_value(value: Any) -> str:
    """Format a value for a message: the repr if short, otherwise its type; arrays by their shape.

    Examples:
        >>> import numpy as np
        >>> format_value(np.zeros((2, 3))), format_value("r_003")
        ('an array of shape (2, 3)', "'r_003'")
    """
    if type(value).__name__ == "ndarray":
        return f"an array of shape {value.shape}"
    text = repr(value)
    return text if len(text) <= LONGEST else f"an object of type {type(value).__name__}"


@cache
def _types_of(owner: Any) -> dict[str, Any]:
    """Return resolved annotations by name; lazily, since modules may refer to each other's types."""
    if isinstance(owner, type):
        return typing.get_type_hints(owner)
    # the return type may be imported under TYPE_CHECKING only
    arguments = {name: kind for name, kind in owner.__annotations__.items() if name != "return"}
    return typing.get_type_hints(types.SimpleNamespace(__annotations__=arguments), vars(sys.modules[owner.__module__]))


def _fits(value: Any, kind: Any) -> bool:
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return True
    if origin in (Union, types.UnionType):
        return any(_fits(value, part) for part in parts)
    if kind in (int, float):
        return isinstance(value, Integral if kind is int else Real) and not isinstance(value, bool)
    if kind is Path:
        return isinstance(value, PathLike)
    if origin is None:
        return isinstance(value, kind)
    return isinstance(value, origin) and not isinstance(value, str) and _items_fit(value, origin, parts)


def _items_fit(value: Any, origin: type, parts: tuple[Any, ...]) -> bool:
    if issubclass(origin, Mapping):
        return all(_fits(key, parts[0]) and _fits(each, parts[1]) for key, each in value.items())
    if origin is tuple and parts[-1] is not Ellipsis:
        return len(value) == len(parts) and all(map(_fits, value, parts))
    return not issubclass(origin, Sequence) or all(_fits(each, parts[0]) for each in value)


def _name_of(kind: Any) -> str:
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(_name_of(part) for part in parts))
    if origin is None:
        return NAMES.get(kind.__name__) or ("an " if kind.__name__[0] in "AEIOU" else "a ") + kind.__name__
    if origin is tuple and Ellipsis not in parts:
        return f"a tuple of {len(parts)}"
    return {dict: "a dictionary", tuple: "a tuple", Callable: "a function"}.get(origin, "a list")
