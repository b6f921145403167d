"""Objects of splats as other programs make them."""

import numpy as np
import pytest

N = 5
KINDS = ("blender", "kiri")


def make(bpy, kind, count, n=N):
    """An active object of n points at (row, row^2, -row), with `count` harmonics of 0.5 and opacities of 0.25."""
    data = bpy.data.meshes.new("splats")
    data.vertices.add(n)
    rows = np.arange(n, dtype=np.float32)
    data.vertices.foreach_set("co", np.stack([rows, rows**2, -rows], 1).ravel())
    item = bpy.data.objects.new("splats", data)
    bpy.context.scene.collection.objects.link(item)
    bpy.context.view_layer.objects.active = item
    if kind == "kiri":
        _add_kiris(data.attributes, count, n)
        return item
    if bpy.app.version < (4, 5):
        pytest.skip("this Blender makes no point clouds of meshes")
    item.select_set(True)
    bpy.ops.object.convert(target="POINTCLOUD")
    _add_blenders(bpy.context.object.data.attributes, count, n)
    return bpy.context.object


def _add_kiris(attributes, count, n):
    names = [f"f_dc_{i}" for i in range(3)] + [f"f_rest_{i}" for i in range(3 * (count - 1))]
    for name in names:
        attributes.new(name, "FLOAT", "POINT").data.foreach_set("value", np.full(n, 0.5, np.float32))
    attributes.new("opacity", "FLOAT", "POINT").data.foreach_set("value", np.full(n, 0.25, np.float32))
    attributes.new("Col", "FLOAT_COLOR", "POINT").data.foreach_set("color", np.full(4 * n, 0.25, np.float32))


def _add_blenders(attributes, count, n):
    """Before Blender 5.3 only color attributes have four numbers."""
    base = np.tile(np.float32([0.5, 0.5, 0.5, 0.25]), n)
    attributes.new("radiance:base", "FLOAT_COLOR", "POINT").data.foreach_set("color", base)
    for number in range(count - 1):
        values = np.full(3 * n, 0.5, np.float32)
        attributes.new(f"radiance:sh_{number}", "FLOAT_VECTOR", "POINT").data.foreach_set("vector", values)
    attributes.new("scale", "FLOAT_VECTOR", "POINT")
    attributes.new("rotation", "QUATERNION", "POINT")


def colors_of(item):
    """The harmonics [n, count, 3] and opacities [n] of an object."""
    attributes = item.data.attributes
    if item.type == "MESH":
        direct = [_read(attributes[f"f_dc_{channel}"], "value", 1) for channel in range(3)]
        n_rest = sum(name.startswith("f_rest_") for name in attributes.keys()) // 3
        rest = [_read(attributes[f"f_rest_{number}"], "value", 1) for number in range(3 * n_rest)]
        rows = [direct, *(rest[number::n_rest] for number in range(n_rest))]
        harmonics = np.stack([np.concatenate(row, 1) for row in rows], 1)
        return harmonics, _read(attributes["opacity"], "value", 1)[:, 0]
    base = _read(attributes["radiance:base"], "color", 4)
    names = [name for name in (f"radiance:sh_{number}" for number in range(24)) if name in attributes]
    return np.stack([base[:, :3], *(_read(attributes[name], "vector", 3) for name in names)], 1), base[:, 3]


def _read(attribute, field, size):
    values = np.empty((len(attribute.data), size), np.float32)
    attribute.data.foreach_get(field, values.ravel())
    return values
