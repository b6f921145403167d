"""Options of commands: frozen dataclasses whose fields have a help text, a type and a range.

The command-line parser, the JSON of jobs and the signature of library functions derive from one class. Needs the
standard library only.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields
from pathlib import Path
from typing import Any, ClassVar, Self, TypeVar

from ..errors import BadRequest
from .arguments import (
    annotations_of,
    check_choice,
    check_number,
    coerce,
    describe_type,
    union_members,
    unknown_name_error,
)

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
    """Declare a field of an `Options` class with its help text; an option without a default is required.

    `flag` is its name on the command line without dashes; by default the field's name, None for none. A `maximum` needs a
    `minimum`.
    """
    facts = {"help": text, "flag": flag, "metavar": metavar, "choices": choices, "positional": positional}
    return field(default=default, metadata=facts | {"minimum": minimum, "maximum": maximum})


@dataclass(frozen=True, kw_only=True)
class Options:
    """Options of a command, checked on creation; paths may be strings, tuples may be lists."""

    command: ClassVar[str] = ""

    threads: int | None = option(
        "processor threads (default: all cores, at most 4)", None, metavar="N", minimum=1, maximum=MOST_THREADS
    )
    device: str | None = option("cpu, cuda, cuda:NUMBER or, untested, mps (default: cuda where there is one)", None)

    def __post_init__(self) -> None:
        kinds = annotations_of(type(self))
        for item in fields(self):
            object.__setattr__(self, item.name, _checked(item, kinds[item.name], getattr(self, item.name)))

    @classmethod
    def of(cls, **values: Any) -> Self:
        """Make options from keywords. Raises BadRequest if one is unknown, missing, or of a wrong type or range."""
        known = {item.name: item for item in fields(cls)}
        for name in values:
            if name not in known:
                raise unknown_name_error("option", name, known)
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


def fields_in_help_order(kind: type[Options]) -> list[dataclasses.Field]:
    """Return the fields of a class in the order of the help: common fields last."""
    common = {item.name for item in fields(Options)}
    return sorted(fields(kind), key=lambda item: item.name in common and kind is not Options)


def flag_of(item: dataclasses.Field) -> str | None:
    """Return a field's command-line flag with dashes; None if it has none."""
    flag = item.metadata["flag"]
    return None if flag is None else f"--{flag or item.name.replace('_', '-')}"


def bounds_of(kind: type[Options], name: str) -> dict[str, Any]:
    """Return default, minimum and maximum of a number as keywords of a Blender property."""
    item = next(item for item in fields(kind) if item.name == name)
    bounds = {"default": item.default, "min": item.metadata["minimum"], "max": item.metadata["maximum"]}
    return {key: value for key, value in bounds.items() if value not in (None, MISSING)}


def _checked(item: dataclasses.Field, kind: Any, value: Any) -> Any:
    """Return a value as the type of its field. Raises BadRequest if it has another type or is out of range."""
    coerced = coerce(value, kind, is_json=True)
    if coerced is MISSING:
        wanted = " or ".join(describe_type(part, is_json=True) for part in union_members(kind))
        raise BadRequest(f"The option {item.name} = {value!r:.200} is not {wanted}.", "Correct it.")
    choices, minimum, maximum = (item.metadata[name] for name in ("choices", "minimum", "maximum"))
    if coerced is not None and choices:
        check_choice(f"The option {item.name}", coerced, choices)
    if coerced is not None and minimum is not None:
        check_number(f"The option {item.name}", coerced, minimum, maximum)
    return coerced


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
