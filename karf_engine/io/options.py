"""Options of commands as data: frozen dataclasses whose fields know their help, type and range.

A command's parser, the JSON of its jobs and the signature of its library function are all derived from one class. The
standard library alone is needed.
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
    """A field of an `Options` class.

    Args:
        text: What it means, a phrase for `--help` and the reference.
        default: Without one the option is required.
        flag: On the command line, without dashes; by default the field's name, None for none.
        metavar: What stands for its value in `--help`.
        choices: The values that are allowed.
        minimum: The least number that is allowed.
        maximum: The greatest number that is allowed.
        positional: Whether the command line takes it by its place.
    """
    facts = {"help": text, "flag": flag, "metavar": metavar, "choices": choices, "positional": positional}
    return field(default=default, metadata=facts | {"minimum": minimum, "maximum": maximum})


@dataclass(frozen=True, kw_only=True)
class Options:
    """What one command is given. Values are checked when it is made; paths may be texts, tuples may be lists.

    Attributes:
        command: The command's name, of the class.
    """

    command: ClassVar[str] = ""

    threads: int | None = option(
        "processor threads (default: all cores, at most 4)", None, metavar="N", minimum=1, maximum=MOST_THREADS
    )
    device: str | None = option("cpu, cuda or cuda:NUMBER (default: cuda where there is one)", None)

    def __post_init__(self) -> None:
        kinds = types_of(type(self))
        for item in fields(self):
            value = _converted(item.name, kinds[item.name], getattr(self, item.name))
            _check_range(item, value)
            object.__setattr__(self, item.name, value)

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Make options of keywords.

        Raises:
            BadRequest: A name is unknown, a required one is missing, or a value is of another type or out of range.

        Examples:
            >>> Options.of(thread=1)
            Traceback (most recent call last):
            karf_engine.errors.BadRequest: Unknown option thread. Did you mean threads?
        """
        known = {item.name: item for item in fields(cls)}
        for name in values:
            if name not in known:
                raise unknown(name, known)
        missing = [name for name, item in known.items() if item.default is MISSING and values.get(name) is None]
        if missing:
            raise BadRequest(f"The {cls.command} command was given no {missing[0]}.", f"Give {' and '.join(missing)}.")
        return cls(**values)

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Self:
        """Make options of a job's JSON values, where null stands for the default. Raises BadRequest as `of` does."""
        return cls.of(**{name: value for name, value in content.items() if value is not None})

    def to_json(self) -> dict[str, Any]:
        """JSON values of what is not the default, from which `from_json` makes the same options."""
        return {
            item.name: _plain(getattr(self, item.name))
            for item in fields(self)
            if getattr(self, item.name) != item.default
        }

    def narrowed(self, kind: type[Kind]) -> Kind:
        """Options of another command, with all values that this one has for it."""
        own = {item.name for item in fields(self)}
        return kind(**{item.name: getattr(self, item.name) for item in fields(kind) if item.name in own})

    def to_arguments(self) -> list[str]:
        """What is not the default as arguments of the command line, positional ones left out."""
        return [part for item in fields(self) for part in _arguments(item, getattr(self, item.name))]


def unknown(name: str, known: Iterable[str]) -> BadRequest:
    """The error for a name that is not among the known ones; it says which of them is nearest."""
    known = list(known)
    nearest = difflib.get_close_matches(name, known, 1)
    hint = f"Did you mean {nearest[0]}?" if nearest else f"Known: {', '.join(known)}."
    return BadRequest(f"Unknown option {name:.200}.", hint)


def listed(kind: type[Options]) -> list[dataclasses.Field]:
    """A class's fields in the order of help and reference: what every command has comes last."""
    common = {item.name for item in fields(Options)}
    return sorted(fields(kind), key=lambda item: item.name in common and kind is not Options)


@cache
def types_of(kind: type[Options]) -> dict[str, Any]:
    """The types of an options class's fields, by name."""
    return typing.get_type_hints(kind)


def flag_of(item: dataclasses.Field) -> str | None:
    """A field's flag on the command line, with its dashes; None where it has none."""
    flag = item.metadata["flag"]
    return None if flag is None else f"--{flag or item.name.replace('_', '-')}"


def bounds_of(kind: type[Options], name: str) -> dict[str, Any]:
    """Default, least and greatest value of a number, where it has them, by the keywords of Blender's properties.

    Examples:
        >>> bounds_of(Options, "threads")
        {'min': 1, 'max': 256}
    """
    item = next(item for item in fields(kind) if item.name == name)
    bounds = {"default": item.default, "min": item.metadata["minimum"], "max": item.metadata["maximum"]}
    return {key: value for key, value in bounds.items() if value not in (None, MISSING)}


def alternatives(kind: Any) -> tuple[Any, ...]:
    """The types of a union, or the one type; None is left out.

    Examples:
        >>> alternatives(int | None)
        (<class 'int'>,)
    """
    parts = typing.get_args(kind) if typing.get_origin(kind) in (Union, types.UnionType) else (kind,)
    return tuple(part for part in parts if part is not type(None))


def _converted(name: str, kind: Any, value: Any) -> Any:
    """The value as the field's type has it. Raises BadRequest for a value of another type."""
    if value is None and type(None) in typing.get_args(kind):
        return None
    for part in alternatives(kind):
        found = _fitted(part, value)
        if found is not MISSING:
            return found
    wanted = " or ".join(_name_of(part) for part in alternatives(kind))
    raise BadRequest(f"The option {name} = {value!r:.200} is not {wanted}.", "Correct it.")


def _fitted(kind: Any, value: Any) -> Any:
    """The value as this type has it; MISSING where it is of another."""
    if "\0" in str(value):
        raise BadRequest(f"{value!r:.200} holds a zero character.", "Correct it.")
    if typing.get_origin(kind) is tuple:
        return _fitted_tuple(typing.get_args(kind), value)
    if kind is Path:
        return Path(value) if isinstance(value, str | os.PathLike) and str(value) else MISSING
    if kind is float:
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else MISSING
    return value if type(value) is kind else MISSING


def _fitted_tuple(parts: tuple[Any, ...], value: Any) -> Any:
    if not isinstance(value, list | tuple):
        return MISSING
    parts = parts[:1] * len(value) if parts[-1] is Ellipsis else parts
    found = [_fitted(part, each) for part, each in zip(parts, value, strict=False)]
    is_whole = len(parts) == len(value) and all(each is not MISSING for each in found)
    return tuple(found) if is_whole else MISSING


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


def _plain(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
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
