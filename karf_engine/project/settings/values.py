"""Settings from and to plain values: names, types and ranges are checked."""

from __future__ import annotations

import dataclasses
import difflib
import json
from dataclasses import fields, is_dataclass
from typing import Any

from ...errors import BadRequest
from .stages import Level, Settings, check_option

MOST_LEVELS, MOST_VOXELS, MOST_ITERATIONS = 16, 2048, 10**7


def to_dict(settings: Any) -> dict[str, Any]:
    """Plain JSON values of a settings dataclass."""
    return json.loads(json.dumps(dataclasses.asdict(settings)))


def from_dict(content: dict[str, Any], kind: type = Settings, where: str = "") -> Any:
    """Rebuild settings from plain values; unknown names, wrong types and values out of range raise BadRequest."""
    if not isinstance(content, dict):
        group = where.rstrip(".") or "A group of settings"
        raise BadRequest(f"{group} = {content!r:.200} is not a group of settings.", "Give an object.")
    known = {item.name: item for item in fields(kind)}
    values = {}
    for name, value in content.items():
        if name not in known:
            nearest = difflib.get_close_matches(name, known, 1)
            hint = f"Did you mean {where}{nearest[0]}?" if nearest else f"Known: {', '.join(known)}."
            raise BadRequest(f"Unknown setting {where}{name:.200}.", hint)
        values[name] = _checked(known[name], value, f"{where}{name}")
    return kind(**values)


def with_overrides(settings: Settings, overrides: list[str]) -> Settings:
    """Apply `stage.field=value` texts; values are JSON, bare words are text."""
    content = to_dict(settings)
    for text in overrides:
        path, equals, value = text.partition("=")
        if not equals:
            raise BadRequest(f"Override {text!r} has no '='.", "Write it as stage.field=value.")
        *parents, last = path.strip().split(".")
        node = content
        for parent in parents:
            if not isinstance(node.get(parent), dict):
                raise BadRequest(f"Unknown setting {path!r}.", f"Stages: {', '.join(_stages())}.")
            node = node[parent]
        try:
            node[last] = json.loads(value)
        except (ValueError, RecursionError):  # a bare word; numbers or brackets without end are none of the types below
            node[last] = value.strip()
    return from_dict(content)


def describe(kind: type = Settings, where: str = "") -> list[tuple[str, Any, str]]:
    """(dotted name, default, help with range) of every field, for panels and `--help`."""
    rows = []
    for item in fields(kind):
        if is_dataclass(item.default):
            rows += describe(type(item.default), f"{where}{item.name}.")
        elif item.metadata:
            rows.append((f"{where}{item.name}", item.default, item.metadata["help"] + _range_text(item.metadata)))
    return rows


def _stages() -> list[str]:
    return [item.name for item in fields(Settings) if is_dataclass(item.default)]


def _range_text(metadata: Any) -> str:
    if metadata["choices"]:
        return f" ({' | '.join(metadata['choices'])})"
    return f" [{metadata['minimum']} .. {metadata['maximum']}]" if metadata["minimum"] is not None else ""


def _checked(item: dataclasses.Field, value: Any, name: str) -> Any:
    default = item.default
    if is_dataclass(default):
        return from_dict(value, type(default), f"{name}.")
    if isinstance(default, tuple):
        return _checked_levels(value, name)
    is_whole = isinstance(default, float) and type(value) is int
    if type(value) is not type(default) and not is_whole:
        raise BadRequest(
            f"{name} = {value!r:.200} is not of type {type(default).__name__}.", f"The default is {default!r}."
        )
    check_option(item, value, name)
    return float(value) if is_whole else value  # whole numbers may be too large for it before the range is known


def _checked_levels(value: Any, name: str) -> tuple[Level, ...]:
    try:
        levels = tuple(Level(int(entry["voxels"]), int(entry["iterations"]), float(entry["step"])) for entry in value)
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise BadRequest(
            f"{name} = {value!r:.200} is not a list of levels.",
            'Give [{"voxels": 40, "iterations": 150, "step": 1.0}, ..].',
        ) from error
    if not 0 < len(levels) <= MOST_LEVELS or not all(
        4 <= v.voxels <= MOST_VOXELS and 1 <= v.iterations <= MOST_ITERATIONS and 0 < v.step <= 1 for v in levels
    ):
        raise BadRequest(
            f"{name} holds an empty or impossible level, or too many.",
            f"1 to {MOST_LEVELS} levels; voxels 4 to {MOST_VOXELS}, iterations 1 to {MOST_ITERATIONS}, 0 < step <= 1.",
        )
    return levels
