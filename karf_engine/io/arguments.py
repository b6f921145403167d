"""Check values against type annotations: arguments of functions, fields of dataclasses, options, settings and queries.

A value of the wrong type raises TypeError, one that is out of range BadRequest. Needs the standard library only, except
for arrays.
"""

from __future__ import annotations

import difflib
import inspect
import sys
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
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
    "str": "a text", "int": "a whole number", "float": "a number", "bool": "true or false", "Path": "a path",
    "dict": "a dictionary", "ndarray": "an array", "NoneType": "None",
}  # fmt: skip
ABSTRACT = {int: Integral, float: Real, Path: PathLike}  # what is accepted for these
LONGEST = 80  # characters of a value quoted in a message


def check_arguments(function: Function) -> Function:
    """Decorate a function so that arguments of other types than annotated raise TypeError."""
    signature = inspect.signature(function)

    @wraps(function)
    def wrapper(*args: Any, **kwargs: Any) -> Any:
        bound, annotations = signature.bind(*args, **kwargs), annotations_of(function)
        for name, value in bound.arguments.items():
            if name in annotations and signature.parameters[name].kind is not inspect.Parameter.VAR_KEYWORD:
                check_type(function.__qualname__.removesuffix(".__init__"), name, value, annotations[name])
        return function(*args, **kwargs)

    return cast(Function, wrapper)


def check_fields(record: Any) -> None:
    """Raise TypeError if a field of a dataclass instance has another type than declared."""
    annotations = annotations_of(type(record))
    for item in fields(record):
        check_type(type(record).__name__, item.name, getattr(record, item.name), annotations[item.name])


def check_type(what: str, name: str, value: Any, kind: Any) -> None:
    """Raise TypeError if a value does not fit an annotation, or BadRequest if a path is empty or has a zero character."""
    if coerce(value, kind) is MISSING:
        raise TypeError(f"{what} takes {describe_type(kind)} as {name}, not {format_value(value)}.")
    if isinstance(value, str) and Path in typing.get_args(kind) and (not value or "\0" in value):
        raise BadRequest(f"{name} = {value!r:.200} is no path.", "Give the path of a file or folder.")


def check_number(name: str, value: float, lowest: float, highest: float | None = None) -> None:
    """Raise BadRequest if a number is not finite or outside [lowest, highest]; a `highest` of None means no limit."""
    if lowest <= value <= (sys.float_info.max if highest is None else highest):
        return
    allowed = f"from {lowest}" if highest is None else f"{lowest} to {highest}"
    raise BadRequest(f"{name} = {value!r:.200} is out of range.", f"Allowed: {allowed}.")


def check_array(name: str, array: np.ndarray, shape: tuple[int | str, ...]) -> None:
    """Raise TypeError if a value is not an array, BadRequest if it is not numeric or of another shape; "n" is any size."""
    import numpy as np  # the rest of this module must run without numpy

    check_type("This", name, array, np.ndarray)
    fits = len(array.shape) == len(shape) and all(
        isinstance(wanted, str) or size == wanted for size, wanted in zip(array.shape, shape, strict=True)
    )
    if not fits or array.dtype.kind not in "biuf":
        raise BadRequest(f"{name} is {format_value(array)}.", f"Give numbers [{', '.join(map(str, shape))}].")


def check_choice(name: str, value: Any, choices: Sequence[str]) -> None:
    """Raise BadRequest if a value is not one of the choices."""
    if value not in choices:
        raise BadRequest(f"{name} = {format_value(value)} is unknown.", f"Use one of: {', '.join(choices)}.")


def unknown_name_error(what: str, name: str, known: Iterable[str], prefix: str = "") -> BadRequest:
    """Return the error for an unknown option or setting, with the nearest known name; `prefix` precedes both names."""
    known = list(known)
    nearest = difflib.get_close_matches(name, known, 1)
    hint = f"Did you mean {prefix}{nearest[0]}?" if nearest else f"Known: {', '.join(known)}."
    return BadRequest(f"Unknown {what} {prefix}{name:.200}.", hint)


def format_value(value: Any) -> str:
    """Format a value for a message: the repr if short, otherwise its type; arrays by their shape."""
    if type(value).__name__ == "ndarray":
        return f"an array of shape {value.shape}"
    text = repr(value)
    return text if len(text) <= LONGEST else f"an object of type {type(value).__name__}"


@cache
def annotations_of(owner: Any) -> dict[str, Any]:
    """Return the resolved annotations of a class's fields or a function's parameters by name."""
    if isinstance(owner, type):
        return typing.get_type_hints(owner)
    # the return type may be imported under TYPE_CHECKING only
    arguments = {name: kind for name, kind in owner.__annotations__.items() if name != "return"}
    return typing.get_type_hints(types.SimpleNamespace(__annotations__=arguments), vars(sys.modules[owner.__module__]))


def union_members(kind: Any) -> tuple[Any, ...]:
    """Return the members of a union without None, or the one type."""
    parts = typing.get_args(kind) if typing.get_origin(kind) in (Union, types.UnionType) else (kind,)
    return tuple(part for part in parts if part is not types.NoneType)


def coerce(value: Any, kind: Any, is_json: bool = False) -> Any:
    """Return a value as the annotated type, or dataclasses.MISSING if it does not fit.

    Texts of JSON or a command line (`is_json`) become paths, lists tuples, and whole numbers floats; other values stay.
    Raises BadRequest if a text of JSON has a zero character.
    """
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, types.UnionType):
        return next((each for part in parts if (each := coerce(value, part, is_json)) is not MISSING), MISSING)
    if is_json and isinstance(value, str | PathLike):
        if "\0" in str(value):
            raise BadRequest(f"{value!r:.200} holds a zero character.", "Correct it.")
        if kind is Path:
            return Path(value) if str(value) else MISSING
    is_number = kind in (int, float)
    accepted = (tuple, list) if is_json and origin is tuple else ABSTRACT.get(kind, origin or kind)
    if (
        not isinstance(value, accepted)
        or (is_number and isinstance(value, bool))
        or (origin and isinstance(value, str))
    ):
        return MISSING
    if is_number and is_json:
        return kind(cast(Any, value))
    return _coerce_items(value, origin, parts, is_json) if parts else value


def _coerce_items(value: Any, origin: type, parts: tuple[Any, ...], is_json: bool) -> Any:
    if origin is tuple:
        parts = parts[:1] * len(value) if parts[-1] is Ellipsis else parts
        items = [coerce(each, part, is_json) for each, part in zip(value, parts, strict=False)]
        return MISSING if len(value) != len(parts) or any(each is MISSING for each in items) else tuple(items)
    items = []
    if issubclass(origin, Mapping):
        items = [coerce(each, part) for pair in value.items() for each, part in zip(pair, parts, strict=True)]
    elif issubclass(origin, Sequence):
        items = [coerce(each, parts[0]) for each in value]
    return MISSING if any(each is MISSING for each in items) else value


def describe_type(kind: Any, is_json: bool = False) -> str:
    """Return the words for an annotation, such as "a whole number or None"."""
    origin, parts = typing.get_origin(kind), typing.get_args(kind)
    if origin in (Union, types.UnionType):
        return " or ".join(dict.fromkeys(describe_type(part, is_json) for part in parts))
    if origin is None:
        return NAMES.get(kind.__name__) or ("an " if kind.__name__[0] in "AEIOU" else "a ") + kind.__name__
    if origin is tuple:
        word = "a list" if is_json else "a tuple"
        return (
            f"{word}, each {describe_type(parts[0], is_json)}"
            if Ellipsis in parts
            else f"{word} of {len(parts)} values"
        )
    return {dict: "a dictionary", Callable: "a function"}.get(origin, "a list")
