"""Settings of every stage: frozen dataclasses, presets, and their conversion from and to plain values.

A preset is a whole `Settings` value; `with_overrides(settings, ["geometry.long_side=512"])` changes single fields.
"""

from __future__ import annotations

import dataclasses
import json
from dataclasses import MISSING, fields, is_dataclass
from typing import Any

from ...errors import BadRequest
from ...io.arguments import annotations_of, coerce, unknown_name_error
from .presets import PRESETS, preset
from .stages import (
    FIELD_KINDS,
    HEAD_KINDS,
    LABEL_KINDS,
    LAYER_KINDS,
    GeometrySettings,
    HeadSettings,
    Level,
    NerfSettings,
    OpenSettings,
    PaletteSettings,
    RecoloringSettings,
    RenderSettings,
    SegmentationSettings,
    Settings,
    SplatSettings,
    check_setting,
)

MAX_LEVELS, MAX_VOXELS, MAX_ITERATIONS = 16, 2048, 10**7
# costs of stages in geometry samples, measured with the preset demo
RAY_OF_SEGMENTATION, RAY_OF_RECOLORING = 74.0, 93.0  # of one ray of a batch, for a head of width `WIDTH`
WIDTH = 64
PIXEL_OF_SPLATS, MAX_SIDE = 0.6, 400  # of one pixel of a photo; larger photos are learned in windows of this side


def to_dict(settings: Any) -> dict[str, Any]:
    """Return a settings dataclass as JSON values."""
    return json.loads(json.dumps(dataclasses.asdict(settings)))


def from_dict(content: dict[str, Any], kind: type = Settings, where: str = "") -> Any:
    """Make settings of plain values. Raises BadRequest for unknown names, wrong types and values out of range."""
    if not isinstance(content, dict):
        group = where.rstrip(".") or "A group of settings"
        raise BadRequest(f"{group} = {content!r:.200} is not a group of settings.", "Give an object.")
    known = {item.name: item for item in fields(kind)}
    for name in content:
        if name not in known:
            raise unknown_name_error("setting", name, known, where)
    return kind(**{name: _checked(known[name], kind, value, f"{where}{name}") for name, value in content.items()})


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
                stages = [item.name for item in fields(Settings) if is_dataclass(item.default)]
                raise BadRequest(f"Unknown setting {path!r}.", f"Stages: {', '.join(stages)}.")
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


def _range_text(metadata: Any) -> str:
    if metadata["choices"]:
        return f" ({' | '.join(metadata['choices'])})"
    return f" [{metadata['minimum']} .. {metadata['maximum']}]" if metadata["minimum"] is not None else ""


def _checked(item: dataclasses.Field, owner: type, value: Any, name: str) -> Any:
    """Return a plain value as the type of a field of the class `owner`; `name` is dotted."""
    if is_dataclass(item.default):
        return from_dict(value, type(item.default), f"{name}.")
    if isinstance(item.default, tuple):
        return _levels(value, name)
    kind = annotations_of(owner)[item.name]
    if coerce(value, kind) is MISSING:
        raise BadRequest(
            f"{name} = {value!r:.200} is not of type {kind.__name__}.", f"The default is {item.default!r}."
        )
    check_setting(item, value, name)
    return float(value) if kind is float else value  # after the range check: huge whole numbers overflow a float


def _levels(value: Any, name: str) -> tuple[Level, ...]:
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


def seconds_of_stages(settings: Settings, samples_per_second: float, is_open: bool = False) -> dict[str, float] | None:
    """Estimate the seconds that each stage of learning takes; None for fields other than voxels.

    Args:
        settings: The settings of the stages.
        samples_per_second: Speed of the computer, see `cli.smoke.samples_per_second`.
        is_open: Whether the scene extends behind the object and the cameras.
    """
    if settings.geometry.field != "voxels":
        return None
    geometry = settings.geometry.open if is_open else settings.geometry
    segmentation, recoloring, splats = settings.segmentation, settings.recoloring, settings.splats
    work = {
        "geometry": sum(level.iterations for level in geometry.levels) * geometry.samples,
        "segmentation": RAY_OF_SEGMENTATION * segmentation.iterations * segmentation.batch * segmentation.width / WIDTH,
        "recoloring": RAY_OF_RECOLORING * recoloring.iterations * recoloring.batch * recoloring.width / WIDTH,
        "splats": PIXEL_OF_SPLATS * splats.iterations * min(splats.long_side, MAX_SIDE) ** 2,
    }
    return {stage: samples / samples_per_second for stage, samples in work.items()}
