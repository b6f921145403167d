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
PRESETS: dict[str, Settings] = {
    # two processor cores, a few minutes on photos of 256 pixels
    "demo": Settings(),
    # a laptop, about two minutes on photos of 400 pixels: more and finer cells, more samples per iteration
    "fast": Settings(
        preset="fast",
        geometry=GeometrySettings(
            long_side=400,
            levels=(Level(48, 120, 1.0), Level(112, 250, 0.75), Level(240, 500, 0.6)),
            samples=120_000,
            open=OpenSettings(levels=(Level(64, 150, 1.0), Level(128, 250, 1.0), Level(256, 600, 1.0))),
        ),
        segmentation=SegmentationSettings(cache_long_side=200, iterations=300),
        splats=SplatSettings(iterations=1200, count=80_000, long_side=400),
    ),
    # a laptop, ten minutes: as fine as fits in 4 GB of memory
    "fine": Settings(
        preset="fine",
        geometry=GeometrySettings(
            long_side=400,
            levels=(Level(48, 120, 1.0), Level(112, 250, 0.75), Level(240, 500, 0.6), Level(360, 1500, 0.6)),
            samples=120_000,
            open=OpenSettings(
                levels=(Level(64, 150, 1.0), Level(128, 250, 1.0), Level(256, 600, 1.0), Level(448, 2400, 1.0)),
                frustum_detail=1.2,
            ),
        ),
        segmentation=SegmentationSettings(cache_long_side=200, iterations=300),
        splats=SplatSettings(iterations=3000, count=100_000, long_side=400),
    ),
    # a graphics card, 800 pixels; heads of the paper's width
    "quality": Settings(
        preset="quality",
        geometry=GeometrySettings(
            long_side=800,
            levels=(Level(64, 500, 1.0), Level(160, 1500, 0.75), Level(384, 6000, 0.5)),
            samples=1_000_000,
            max_rays=65536,
            features=24,
            open=OpenSettings(
                levels=(Level(64, 500, 1.0), Level(160, 1500, 1.0), Level(448, 6000, 1.0)),
                samples=1_000_000,
                max_rays=65536,
            ),
        ),
        segmentation=SegmentationSettings(width=256, iterations=1000, batch=4096, cache_views=48, cache_long_side=400),
        recoloring=RecoloringSettings(width=256, frequencies=8, direction_frequencies=4, batch=4096),
        splats=SplatSettings(iterations=8000, count=200_000, long_side=1600, degree=3),
    ),
    # the paper's numbers and losses, for a graphics card: NeRF, plain Eq. 12, one palette of LoCoPalettes' size and its
    # weights in the marked views, a black background, the paper's compositing; docs/paper.md lists the differences
    "paper": Settings(
        preset="paper",
        compositing="paper",
        geometry=GeometrySettings(field="nerf", long_side=800),
        segmentation=SegmentationSettings(
            labels="masks",
            width=256,
            frequencies=10,
            iterations=2000,
            rate=5e-4,
            schedule="constant",
            cache_views=32,
            cache_long_side=256,
            samples_per_ray=64,
        ),
        palette=PaletteSettings(shared=True, colors=6),
        recoloring=RecoloringSettings(
            width=256,
            schedule="constant",
            frequencies=10,
            direction_frequencies=4,
            iterations=5000,
            batch=1024,
            rate=5e-4,
            targets="loco",
            supervision="reference",
            background="black",
        ),
        splats=SplatSettings(iterations=0),
    ),
}


def preset(name: str) -> Settings:
    """Return the preset of this name. Raises BadRequest listing the known ones."""
    if name not in PRESETS:
        raise BadRequest(f"Unknown preset {name!r}.", f"Use one of: {', '.join(PRESETS)}.")
    return PRESETS[name]


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

    `samples_per_second` is the computer's speed (see `cli.smoke`); `is_open`: the scene extends behind the object.
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
