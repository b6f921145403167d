"""Options of commands: frozen dataclasses whose fields have a help text, a type and a range.

The command-line parser, the JSON of jobs and the signature of library functions derive from one class. Needs the
standard library only.
"""

from __future__ import annotations

import dataclasses
import difflib
import os
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar, Union

from ..errors import BadRequest

MOST_THREADS = 256
Kind = TypeVar("Kind", bound="Options")


def option(
    text: str,
    default: Any = MISSING,
    *,
    flag: str | None = "",
    metavar: str | tuple[str, ...] = "",
    choices: tuple[str, ...] = (),
    minimum: int | None = None,
    maximum: int | None = None,
    positional: bool = False,
) -> Any:
    """Declare a field of an `Options` class.

    Args:
        text: Help text, a phrase.
        default: Default value; the option is required without one.
        flag: Name on the command line without dashes; by default the field's name, None for none.
        metavar: Placeholder of the value in `--help`.
        choices: Allowed values.
        minimum: Least allowed number.
        maximum: Greatest allowed number.
        positional: Whether the command line takes it by position.
    """
    facts = {"help": text, "flag": flag, "metavar": metavar, "choices": choices, "positional": positional}
    return field(default=default, metadata=facts | {"minimum": minimum, "maximum": maximum})


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a command, checked on creation; paths may be strings, tuples may be lists.

    Attributes:
        command: Name of the command.
    """

    command: ClassVar[str] = ""

    threads: int | None = option(
        "processor threads (default: all cores, at most 4)", None, metavar="N", minimum=1, maximum=MOST_THREADS
    )
    device: str | None = option("cpu, cuda or cuda:NUMBER (default: cuda where there is one)", None)

    def __post_init__(self) -> None:
        kinds = types_of(type(self))
        for item in fields(self):
            value = _coerce_field(item.name, kinds[item.name], getattr(self, item.name))
            _check_range(item, value)
            object.__setattr__(self, item.name, value)

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Make options from keywords.

        Raises:
            BadRequest: A name is unknown, a required option is missing, or a value has a wrong type or range.

        Examples:
            >>> Options.of(thread=1)
            Traceback (most recent call last):
            karf_engine.errors.BadRequest: Unknown option thread. Did you mean threads?
        """
        known = {item.name: item for item in fields(cls)}
        for name in values:
            if name not in known:
                raise unknown_option_error(name, known)
        missing = [name for name, item in known.items() if item.default is MISSING and values.get(name) is None]
        if missing:
            raise BadRequest(f"The {cls.command} command was given no {missing[0]}.", f"Give {' and '.join(missing)}.")
        return cls(**values)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """Make options from JSON values, where null means the default. Raises BadRequest as `of`."""
        return cls.of(**{name: value for name, value in content.items() if value is not None})

    def to_json(self) -> dict[str, Any]:
        """Return the values that differ from their defaults as JSON, for `from_json`."""
        return {
            item.name: _to_json(getattr(self, item.name))
            for item in fields(self)
            if getattr(self, item.name) != item.default
        }

    def subset(self, kind: type[Kind]) -> Kind:
        """Return options of another command with the values of the fields that both have."""
        own = {item.name for item in fields(self)}
        return kind(**{item.name: getattr(self, item.name) for item in fields(kind) if item.name in own})

    def to_arguments(self) -> list[str]:
        """Return the values that differ from their defaults as command-line arguments, without positional ones."""
        return [part for item in fields(self) for part in _arguments(item, getattr(self, item.name))]


def unknown_option_error(name: str, known: Iterable[str]) -> BadRequest:
    """Return the error for an unknown option, with the nearest known name."""
    known = list(known)
    nearest = difflib.get_close_matches(name, known, 1)
    hint = f"Did you mean {nearest[0]}?" if nearest else f"Known: {', '.join(known)}."
    return BadRequest(f"Unknown option {name:.200}.", hint)


def fields_in_help_order(kind: type[Options]) -> list[dataclasses.Field]:
    """Return the fields of a class in the order of the help: common fields last."""
    common = {item.name for item in fields(Options)}
    return sorted(fields(kind), key=lambda item: item.name in common and kind is not Options)


@cache
def types_of(kind: type[Options]) -> dict[str, Any]:
    """Return the field types of an options class by name."""
    return typing.get_type_hints(kind)


def flag_of(item: dataclasses.Field) -> str | None:
    """Return a field's command-line flag with dashes; None if it has none."""
    flag = item.metadata["flag"]
    return None if flag is None else f"--{flag or item.name.replace('_', '-')}"


def bounds_of(kind: type[Options], name: str) -> dict[str, Any]:
    """Return default, minimum and maximum of a number as keywords of a Blender property.

    Examples:
        >>> bounds_of(Options, "threads")
        {'min': 1, 'max': 256}
    """
    item = next(item for item in fields(kind) if item.name == name)
    bounds = {"default": item.default, "min": item.metadata["minimum"], "max": item.metadata["maximum"]}
    return {key: value for key, value in bounds.items() if value not in (None, MISSING)}


def union_members(kind: Any) -> tuple[Any, ...]:
    """Return the members of a union without None, or the one type.

    Examples:
        >>> union_members(int | None)
        (<class 'int'>,)
    """
    parts = typing.get_args(kind) if typing.get_origin(kind) in (Union, types.UnionType) else (kind,)
    return tuple(part for part in parts if part is not type(None))


def _coerce_field(name: str, kind: Any, value: Any) -> Any:
    """Coerce a value to the type of its field. Raises BadRequest if it has another type."""
    if value is None and type(None) in typing.get_args(kind):
        return None
    for part in union_members(kind):
        coerced = _coerce(part, value)
        if coerced is not MISSING:
            return coerced
    wanted = " or ".join(_name_of(part) for part in union_members(kind))
    raise BadRequest(f"The option {name} = {value!r:.200} is not {wanted}.", "Correct it.")


def _coerce(kind: Any, value: Any) -> Any:
    """Coerce a value to a type; MISSING if it has another."""
    if "\0" in str(value):
        raise BadRequest(f"{value!r:.200} holds a zero character.", "Correct it.")
    if typing.get_origin(kind) is tuple:
        return _coerce_tuple(typing.get_args(kind), value)
    if kind is Path:
        return Path(value) if isinstance(value, str | os.PathLike) and str(value) else MISSING
    if kind is float:
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else MISSING
    return value if type(value) is kind else MISSING


def _coerce_tuple(parts: tuple[Any, ...], value: Any) -> Any:
    if not isinstance(value, list | tuple):
        return MISSING
    parts = parts[:1] * len(value) if parts[-1] is Ellipsis else parts
    coerced = [_coerce(part, each) for part, each in zip(parts, value, strict=False)]
    is_complete = len(parts) == len(value) and all(each is not MISSING for each in coerced)
    return tuple(coerced) if is_complete else MISSING


def _name_of(kind: Any) -> str:
    names = {str: "a text", int: "a whole number", float: "a number", bool: "true or false", Path: "a path"}
    if kind in names:
        return names[kind]
    part, *others = typing.get_args(kind)
    return f"a list of {len(others) + 1} values" if Ellipsis not in others else f"a list, each {_name_of(part)}"


def _check_range(item: dataclasses.Field, value: Any) -> None:
    choices, minimum, maximum = (item.metadata[name] for name in ("choices", "minimum", "maximum"))
    if value is None:
        return
    if choices and value not in choices:
        raise BadRequest(f"The option {item.name} = {value!r:.200} is unknown.", f"Use one of: {', '.join(choices)}.")
    if (minimum is not None and value < minimum) or (maximum is not None and value > maximum):
        allowed = f"{minimum} to {maximum}" if maximum is not None else f"from {minimum}"
        raise BadRequest(f"The option {item.name} = {value} is out of range.", f"Allowed: {allowed}.")


def _to_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_to_json(each) for each in value]
    return str(value) if isinstance(value, Path) else value


def _arguments(item: dataclasses.Field, value: Any) -> Iterator[str]:
    flag = flag_of(item)
    if flag is None or item.metadata["positional"] or value == item.default:
        return
    if value is True:
        yield flag
    elif isinstance(value, tuple):
        for each in value:
            yield from (flag, *map(str, each)) if isinstance(each, tuple) else (flag, str(each))
    else:
        yield from (flag, str(value))
