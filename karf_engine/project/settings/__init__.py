"""Settings of every stage: frozen dataclasses, presets, and the help texts of panels and `--help`.

A preset is a whole `Settings` value; `with_overrides(settings, ["geometry.long_side=512"])` changes single fields.
"""

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
)
from .values import describe, from_dict, to_dict, with_overrides
from .work import seconds_of_stages

__all__ = [
    "FIELD_KINDS",
    "HEAD_KINDS",
    "LABEL_KINDS",
    "LAYER_KINDS",
    "PRESETS",
    "GeometrySettings",
    "HeadSettings",
    "Level",
    "NerfSettings",
    "OpenSettings",
    "PaletteSettings",
    "RecoloringSettings",
    "RenderSettings",
    "SegmentationSettings",
    "Settings",
    "SplatSettings",
    "describe",
    "from_dict",
    "preset",
    "seconds_of_stages",
    "to_dict",
    "with_overrides",
]
