"""The box or lasso being drawn, and the mouse's place on the photo."""

from dataclasses import dataclass, field

import bpy

from .raster import Place


@dataclass
class Gesture:
    """What is being drawn: places in pixels of the region. The overlay draws it."""

    places: list[tuple[int, int]] = field(default_factory=list)


def photo_place(region: bpy.types.Region, size: tuple[int, int], place: tuple[int, int]) -> Place:
    """Where a place in an Image Editor's region, from its lower left, lies in the photo: pixels, y down."""
    u, v = region.view2d.region_to_view(*place)
    return u * size[0], (1 - v) * size[1]


def photo_length(region: bpy.types.Region, size: tuple[int, int], length: float) -> float:
    """How many pixels of the photo a length of the region is."""
    (x0, _), (x1, _) = (photo_place(region, size, (x, 0)) for x in (0, 1000))
    return length * (x1 - x0) / 1000
