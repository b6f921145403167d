"""Layered pictures: OpenEXR files for recoloring a view in compositors.

=============================  =====  ====================================================================
channels                       type   what
=============================  =====  ====================================================================
R, G, B                        half   the base picture, scene-linear; in a named color space float
<object>_coverage.V            half   the object's coverage
<object>_color_<j>.V           half   the coverage times the weight of palette color j; 0 is black
Depth.Z                        float  along the optical axis, world units, 0 where empty
CryptoObject00.R .. A, 01, ..  float  mattes of all objects, see `cryptomatte`
=============================  =====  ====================================================================

Names, learned colors and the photo's gains are in the header, see `export.layer_names`. Scene-linear: the inverse of the
piecewise sRGB curve (IEC 61966-2-1; OpenColorIO: sRGB texture), with Rec. 709 primaries.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import OpenEXR

from ..capture.capture import UNIT_GAINS
from ..io.color import srgb_to_linear
from ..io.color_spaces import ColorSpace
from ..io.files import atomic_write
from ..io.images import save_exr, white_level
from ..recolor.frames import Layers
from . import cryptomatte
from .layer_names import ATTRIBUTE, ObjectLayers, describe_layers, name_layers

REC709 = (0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3127, 0.329)
COLORS = (
    "R, G, B: scene-linear, Rec. 709 primaries, display-referred sRGB undone by the exact piecewise sRGB curve "
    "(IEC 61966-2-1; OCIO: sRGB texture to linear Rec. 709). Recolor in sRGB: "
    "linear(clip(srgb(base) + sum of {factors} * (srgb(new color) - learned color)))"
)
COLORS_OF_SPACE = (
    "R, G, B: in the color space {name} of OpenColorIO, display-referred sRGB (IEC 61966-2-1) converted. Recolor in sRGB: "
    "clip(srgb(base) + sum of {factors} * (srgb(new color) - learned color))"
)


def write_layers(path: Path, layers: Layers, space: ColorSpace | None = None) -> None:
    """Write a layered picture, atomically.

    layers: half floats are written without a copy. space: of the base picture; None: linear Rec. 709.
    """
    objects = name_layers(layers.palettes, layers.gains)
    names = [each.name for each in objects]
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        **_color_facts(space, "weight" if layers.gains == UNIT_GAINS else "weight * gains"),
        ATTRIBUTE: describe_layers(objects),
        **cryptomatte.header(names),
    }
    channels = _planes(objects, layers, space) | cryptomatte.channels(names, layers.coverage)
    atomic_write(path, partial(save_exr, OpenEXR.File(header, channels)))


def _color_facts(space: ColorSpace | None, factors: str) -> dict[str, object]:
    """Return the header's attributes of the base picture's colors. factors: that multiply a change of color, as text."""
    if space is None:
        comments = COLORS.format(factors=factors)
        return {"chromaticities": REC709, "colorInteropID": "lin_rec709_scene", "comments": comments}
    known = {"colorInteropID": space.interop_id} if space.interop_id else {}
    return {**known, "comments": COLORS_OF_SPACE.format(name=space.name, factors=factors)}


def _planes(objects: tuple[ObjectLayers, ...], layers: Layers, space: ColorSpace | None) -> dict[str, np.ndarray]:
    if space is None:
        planes = {letter: _linear(layers.base[..., channel]) for channel, letter in enumerate("RGB")}
    else:
        base = space.from_srgb(layers.base / white_level(layers.base))
        planes = {letter: np.ascontiguousarray(base[..., channel]) for channel, letter in enumerate("RGB")}
    for k, each in enumerate(objects):
        planes[f"{each.coverage}.V"] = np.ascontiguousarray(layers.coverage[k], np.float16)
        for j, name in enumerate(each.weights):
            planes[f"{name}.V"] = np.ascontiguousarray(layers.palette_weights[k, j], np.float16)
    if layers.depth is not None:
        planes["Depth.Z"] = np.ascontiguousarray(layers.depth, np.float32)
    return planes


def _linear(channel: np.ndarray) -> np.ndarray:
    """Linearize sRGB values, float16 [H, W]."""
    if channel.dtype.kind == "u":  # a table of all values
        full = np.iinfo(channel.dtype).max
        return srgb_to_linear(np.arange(full + 1) / full).astype(np.float16)[channel]
    return np.stack([srgb_to_linear(row).astype(np.float16) for row in channel])
