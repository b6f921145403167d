"""Objects of Gaussian splats that other programs have imported, and colors for them.

Blender makes a point cloud of them (from 5.3 on), KIRI's add-on 3DGS Render a mesh of vertices. In both each point is a
Gaussian, in the order of its file.
"""

from typing import Any

import bpy
import numpy as np

from ..engine_api import BadRequest
from . import placing

BASE, HARMONIC = "radiance:base", "radiance:sh_{}"  # of Blender: the first harmonic with the opacity; the others
DIRECT, REST = "f_dc_{}", "f_rest_{}"  # of KIRI: the first harmonic; the others, all red ones first
SHOWN = "Col"  # of KIRI: what is seen of the first harmonic
C0 = np.float32(0.28209479177387814)  # the value of the first harmonic, the same from everywhere
FIELDS = {"FLOAT": "value", "FLOAT_COLOR": "color"}  # of an attribute's items by its type; of others "vector"
MOST_SAMPLES = 64


def is_splat(item: bpy.types.Object | None) -> bool:
    """Whether an object is Gaussian splats with colors, of Blender or of KIRI's add-on."""
    if item is None or item.type not in ("POINTCLOUD", "MESH"):
        return False
    names = [BASE] if item.type == "POINTCLOUD" else [DIRECT.format(channel) for channel in range(3)]
    return all(name in item.data.attributes for name in names)


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The object that follows the scene's swatches, if there is one in the scene."""
    item = scene.karf.surface.splat
    return item if placing.is_in(scene, item) and is_splat(item) else None


def points_of(item: bpy.types.Object) -> dict[str, Any]:
    """The points of a splat object, as JSON values: their number `count`, `rows` of a few, and `positions` of these,
    [m][3] in the object's own space."""
    points = _points(item)
    count = len(points)
    rows = np.linspace(0, count - 1, min(count, MOST_SAMPLES)).astype(int).tolist()
    return {"count": count, "rows": rows, "positions": [list(points[row].co) for row in rows]}


def write(item: bpy.types.Object, harmonics: np.ndarray) -> None:
    """Give the points of a splat object these colors; opacities stay.

    Args:
        item: A splat object that is not in Edit Mode.
        harmonics: [n, 3 K] float32, of each point red, green and blue of each spherical harmonic, in the order and signs of
            Kerbl et al. 2023; those that the object does not have are left out.

    Raises:
        BadRequest: The object has another number of points.
    """
    count = len(_points(item))
    if count != len(harmonics):
        raise BadRequest(
            "{name} has {count} points, but there are colors for {n} splats.",
            "Choose an object that was imported from this scene's splats.",
            name=item.name,
            count=count,
            n=len(harmonics),
        )
    write_kind = _write_blenders if item.type == "POINTCLOUD" else _write_kiris
    write_kind(item.data.attributes, harmonics.reshape(count, -1, 3))
    item.data.update_tag()


def _points(item: bpy.types.Object):
    return item.data.points if item.type == "POINTCLOUD" else item.data.vertices


def _write_blenders(attributes, harmonics: np.ndarray) -> None:
    """harmonics: [n, K, 3]."""
    _paint(attributes[BASE], harmonics[:, 0])
    for number in range(1, harmonics.shape[1]):
        _set(attributes.get(HARMONIC.format(number - 1)), harmonics[:, number])


def _write_kiris(attributes, harmonics: np.ndarray) -> None:
    """harmonics: [n, K, 3]."""
    n_rest = sum(name.startswith(REST.format("")) for name in attributes.keys()) // 3  # of each channel
    for channel in range(3):
        _set(attributes[DIRECT.format(channel)], harmonics[:, 0, channel])
        for number in range(min(n_rest, harmonics.shape[1] - 1)):
            _set(attributes.get(REST.format(channel * n_rest + number)), harmonics[:, 1 + number, channel])
    if SHOWN in attributes:
        _paint(attributes[SHOWN], np.clip(0.5 + C0 * harmonics[:, 0], 0, 1))


def _paint(attribute: bpy.types.Attribute, colors: np.ndarray) -> None:
    """Set the first three [n, 3] of an attribute's four numbers; the fourth, the opacity, stays."""
    values = np.empty((len(colors), 4), np.float32)
    attribute.data.foreach_get(_field(attribute), values.ravel())
    values[:, :3] = colors
    _set(attribute, values)


def _set(attribute: bpy.types.Attribute | None, values: np.ndarray) -> None:
    """Set an attribute, where there is one."""
    if attribute is not None:
        attribute.data.foreach_set(_field(attribute), np.ascontiguousarray(values, np.float32).ravel())


def _field(attribute: bpy.types.Attribute) -> str:
    return FIELDS.get(attribute.data_type, "vector")
