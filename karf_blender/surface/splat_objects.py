"""Objects of Gaussian splats and their colors: point clouds (of Blender 5.3) or meshes (of KIRI's 3DGS Render)."""

from typing import Any

import bpy
import numpy as np

from ..engine_api import BadRequest
from . import scene_object

BASE, HARMONIC = "radiance:base", "radiance:sh_{}"  # of Blender: the first harmonic with the opacity; the others
DIRECT, REST = "f_dc_{}", "f_rest_{}"  # of KIRI: the first harmonic; the others, all red ones first
DISPLAYED = "Col"  # of KIRI: the displayed color, from the first harmonic
C0 = np.float32(0.28209479177387814)  # the value of the first harmonic, the same in all directions
FIELDS = {"FLOAT": "value", "FLOAT_COLOR": "color"}  # of an attribute's items by its type; of others "vector"
MOST_SAMPLES = 64


def is_splat(item: bpy.types.Object | None) -> bool:
    """Return whether an object is Gaussian splats with colors, of Blender or of KIRI's add-on."""
    if item is None or item.type not in ("POINTCLOUD", "MESH"):
        return False
    names = [BASE] if item.type == "POINTCLOUD" else [DIRECT.format(channel) for channel in range(3)]
    return all(name in item.data.attributes for name in names)


def find(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """Return the splat object that follows the scene's swatches, if the scene has one."""
    item = scene.karf.surface.splat
    return item if scene_object.is_in(scene, item) and is_splat(item) else None


def points_of(item: bpy.types.Object) -> dict[str, Any]:
    """Return as JSON values the `count` of points, some `rows` of them, and their `positions` [m][3] in object space."""
    points = _points(item)
    count = len(points)
    rows = np.linspace(0, count - 1, min(count, MOST_SAMPLES)).astype(int).tolist()
    return {"count": count, "rows": rows, "positions": [list(points[row].co) for row in rows]}


def write(item: bpy.types.Object, harmonics: np.ndarray) -> None:
    """Set the points' colors and keep their opacities; the object must not be in Edit Mode.

    `harmonics` [n, 3 K] float32 are red, green and blue of each harmonic, in the order and signs of Kerbl et al. 2023;
    those that the object does not have are left out. Raises BadRequest if the number of points differs.
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
    write_kind = _write_point_cloud if item.type == "POINTCLOUD" else _write_mesh
    write_kind(item.data.attributes, harmonics.reshape(count, -1, 3))
    item.data.update_tag()


def _points(item: bpy.types.Object):
    return item.data.points if item.type == "POINTCLOUD" else item.data.vertices


def _write_point_cloud(attributes, harmonics: np.ndarray) -> None:
    _set_rgb(attributes[BASE], harmonics[:, 0])
    for number in range(1, harmonics.shape[1]):
        _set(attributes.get(HARMONIC.format(number - 1)), harmonics[:, number])


def _write_mesh(attributes, harmonics: np.ndarray) -> None:
    n_rest = sum(name.startswith(REST.format("")) for name in attributes.keys()) // 3  # of each channel
    for channel in range(3):
        _set(attributes[DIRECT.format(channel)], harmonics[:, 0, channel])
        for number in range(min(n_rest, harmonics.shape[1] - 1)):
            _set(attributes.get(REST.format(channel * n_rest + number)), harmonics[:, 1 + number, channel])
    if DISPLAYED in attributes:
        _set_rgb(attributes[DISPLAYED], np.clip(0.5 + C0 * harmonics[:, 0], 0, 1))


def _set_rgb(attribute: bpy.types.Attribute, colors: np.ndarray) -> None:
    """Set the first three of an attribute's four numbers; the fourth, the opacity, stays."""
    values = np.empty((len(colors), 4), np.float32)
    attribute.data.foreach_get(FIELDS.get(attribute.data_type, "vector"), values.ravel())
    values[:, :3] = colors
    _set(attribute, values)


def _set(attribute: bpy.types.Attribute | None, values: np.ndarray) -> None:
    if attribute is not None:
        field = FIELDS.get(attribute.data_type, "vector")
        attribute.data.foreach_set(field, np.ascontiguousarray(values, np.float32).ravel())
