"""The scene's object as a file for other programs, written by Blender's own exporters."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import BadRequest
from ..host import compat
from ..nodes import unlit_material
from . import scene_object

USD_COLOR = "displayColor"  # the attribute that USD viewers display


def export(scene: bpy.types.Scene, item: bpy.types.Object, path: Path, shape: str) -> None:
    """Write the scene's object as displayed: `quads`, or `points` of its faces. The ending chooses the format."""
    suffix = path.suffix.lower()
    if suffix not in WRITERS:
        raise BadRequest(
            "{path} has an unknown file extension.", "Use one of {endings}.", path=path, endings=", ".join(WRITERS)
        )
    write, operators, operator = WRITERS[suffix]
    if operator not in dir(operators):  # some Blenders are built without USD, and glTF is an add-on
        raise BadRequest(
            "This Blender has no exporter for {suffix} files.",
            "Enable it, or choose another file extension.",
            suffix=path.suffix,
        )
    displayed = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    data = _quads(displayed) if shape == "quads" else _points(displayed)
    with _selected(scene, data, f"{item.name} export") as copy:
        copy.matrix_world = item.matrix_world
        write(data, str(path))


def _ply(data: bpy.types.Mesh, path: str) -> None:
    bpy.ops.wm.ply_export(filepath=path, export_selected_objects=True, export_colors="SRGB")


def _gltf(data: bpy.types.Mesh, path: str) -> None:
    if not data.polygons and not compat.HAS_GLTF_POINTS:
        raise BadRequest("This Blender cannot write points to glTF.", "Choose quads, or write a PLY file.")
    # the exporter writes a Background shader as an unlit material, and an Emission as white light
    unlit = unlit_material("KaRF unlit")
    data.materials.clear()
    data.materials.append(unlit)
    kind = "GLB" if path.lower().endswith(".glb") else "GLTF_SEPARATE"
    try:
        bpy.ops.export_scene.gltf(
            filepath=path, use_selection=True, export_format=kind, export_vertex_color="ACTIVE", use_mesh_vertices=True
        )
    finally:
        bpy.data.materials.remove(unlit)


def _usd(data: bpy.types.Mesh, path: str) -> None:
    if not data.polygons:
        raise BadRequest("No program that reads USD shows single points.", "Choose quads, or write a PLY file.")
    data.materials.clear()
    data.attributes[scene_object.COLOR].name = USD_COLOR
    bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True)


# by ending: the function that writes the file, and the operator that it calls
WRITERS = {
    ".ply": (_ply, bpy.ops.wm, "ply_export"),
    **dict.fromkeys((".glb", ".gltf"), (_gltf, bpy.ops.export_scene, "gltf")),
    **dict.fromkeys((".usd", ".usda", ".usdc"), (_usd, bpy.ops.wm, "usd_export")),
}


def _quads(displayed: bpy.types.Object) -> bpy.types.Mesh:
    """Return the faces with their colors, without the attributes that recoloring needs."""
    data = bpy.data.meshes.new_from_object(displayed)
    for name in [each.name for each in data.attributes if each.domain == "FACE" and not each.is_required]:
        data.attributes.remove(data.attributes[name])
    return data


def _points(displayed: bpy.types.Object) -> bpy.types.Mesh:
    source = displayed.data
    n = len(source.polygons)
    positions, colors = np.empty(3 * n, np.float32), np.empty(16 * n, np.float32)
    source.attributes[scene_object.CENTER].data.foreach_get("vector", positions)
    source.attributes[scene_object.COLOR].data.foreach_get("color_srgb", colors)
    data = bpy.data.meshes.new("points")
    data.vertices.add(n)
    data.vertices.foreach_set("co", positions)
    attribute = data.attributes.new(scene_object.COLOR, "BYTE_COLOR", "POINT")
    attribute.data.foreach_set("color_srgb", colors.reshape(n, 4, 4)[:, 0].ravel())
    data.attributes.active_color = attribute
    return data


@contextmanager
def _selected(scene: bpy.types.Scene, data: bpy.types.Mesh, name: str) -> Iterator[bpy.types.Object]:
    """Select a temporary object of this mesh alone; remove both afterwards and restore the selection."""
    layer = bpy.context.view_layer
    active, selected = layer.objects.active, list(bpy.context.selected_objects)
    copy = bpy.data.objects.new(name, data)
    scene.collection.objects.link(copy)
    try:
        for each in selected:
            each.select_set(False)
        copy.select_set(True)
        layer.objects.active = copy
        yield copy
    finally:
        bpy.data.meshes.remove(data)  # removes the object too
        for each in selected:
            each.select_set(True)
        layer.objects.active = active
