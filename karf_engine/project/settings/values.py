"""Convert settings from and to plain values, with checks of names, types and ranges."""

from __future__ import annotations

import dataclasses
import difflib
import json
from dataclasses import fields, is_dataclass
from typing import Any

from ...errors import BadRequest
from .stages import Level, Settings, check_setting

MAX_LEVELS, MAX_VOXELS, MAX_ITERATIONS = 16, 2048, 10**7


def to_dict(settings: Any) -> dict[str, Any]:
    """Return a settings dataclass as JSON values."""
    return json.loads(json.dumps(dataclasses.asdict(settings)))


def from_dict(content: dict[str, Any], kind: type = Settings, where: str = "") -> Any:
    """Make settings of plain values. Raises BadRequest for unknown names, wrong types and values out of range."""
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
        values[name] = _coerce(known[name], value, f"{where}{name}")
    return kind(**values)


def with_overrides(settings: Settings, overrides: list[str]) -> Settings:
    """Return settings changed by `stage.field=value` texts; values are JSON or bare words. Raises as `from_dict`."""
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
        except (ValueError, RecursionError):  # a bare word
            node[last] = value.strip()
    return from_dict(content)


def describe(kind: type = Settings, where: str = "") -> list[tuple[str, Any, str]]:
    """Return (dotted name, default, help with range) of every field."""
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


def _coerce(item: dataclasses.Field, value: Any, name: str) -> Any:
    default = item.default
    if is_dataclass(default):
        return from_dict(value, type(default), f"{name}.")
    if isinstance(default, tuple):
        return _coerce_levels(value, name)
    is_whole = isinstance(default, float) and type(value) is int
    if type(value) is not type(default) and not is_whole:
        raise BadRequest(
            f"{name} = {value!r:.200} is not of type {type(default).__name__}.", f"The default is {default!r}."
        )
    check_setting(item, value, name)
    return float(value) if is_whole else value  # after the range check: huge whole numbers overflow a float


def _coerce_levels(value: Any, name: str) -> tuple[Level, ...]:
    try:
        levels = tuple(Level(int(entry["voxels"]), int(entry["iterations"]), float(entry["step"])) for entry in value)
    except (TypeError, KeyError, ValueError, OverflowError) as error:
        raise BadRequest(
            f"{name} = {value!r:.200} is not a list of levels.",
            'Give [{"voxels": 40, "iterations": 150, "step": 1.0}, ..].',
        ) from error
    if not 0 < len(levels) <= MAX_LEVELS or not all(
        4 <= v.voxels <= MAX_VOXELS and 1 <= v.iterations <= MAX_ITERATIONS and 0 < v.step <= 1 for v in levels
    ):
        raise BadRequest(
            f"{name} holds an empty or impossible level, or too many.",
            f"1 to {MAX_LEVELS} levels; voxels 4 to {MAX_VOXELS}, iterations 1 to {MAX_ITERATIONS}, 0 < step <= 1.",
        )
    return levels
