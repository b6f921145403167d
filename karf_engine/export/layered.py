"""Layered pictures to finish by hand: one OpenEXR file with the photo, the recolored picture and each object's part in it.

======================  ======  ====================================================
channels                type    what
======================  ======  ====================================================
R, G, B                 half    the recolored picture, scene-linear Rec. 709
photo.R, .G, .B         half    the picture that the edit changes
<object>_mask.V         half    the object's coverage
<object>_change.R ..    half    what to add to the photo: all changes give R, G and B
======================  ======  ====================================================
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import OpenEXR

from ..io.color import srgb_to_linear
from ..io.files import atomic_write
from ..io.images import save_exr, white_level
from ..palettes.palette import Edit
from ..recolor.frames import Layers
from . import cryptomatte
from .layer_names import name_layers
from .layers import REC709


def write_layered(path: Path, layers: Layers, edit: Edit) -> None:
    """Write a layered picture, atomically. edit: of the layers' palettes, added to the base (*Photo plus change*)."""
    objects = name_layers(layers.palettes, layers.gains)
    shown = (layers.base / white_level(layers.base)).astype(np.float32)
    light = srgb_to_linear(shown)
    planes = _colors("photo.", light)
    for k, each in enumerate(objects):
        name, n_colors = each.coverage.removesuffix("_coverage"), len(each.colors)
        change = (edit.colors[each.name] - each.colors) * np.array(each.gains, np.float32)
        shown += np.einsum("mhw,mc->hwc", layers.palette_weights[k, :n_colors].astype(np.float32), change)
        before, light = light, srgb_to_linear(shown.clip(0, 1))
        planes |= _colors(f"{name}_change.", light - before)
        planes[f"{name}_mask.V"] = np.ascontiguousarray(layers.coverage[k], np.float16)
    names = [each.name for each in objects]
    planes |= _colors("", light) | cryptomatte.channels(names, layers.coverage)
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, "chromaticities": REC709}
    atomic_write(path, partial(save_exr, OpenEXR.File(header | cryptomatte.header(names), planes)))


def _colors(prefix: str, color: np.ndarray) -> dict[str, np.ndarray]:
    return {f"{prefix}{letter}": np.ascontiguousarray(color[..., i], np.float16) for i, letter in enumerate("RGB")}
