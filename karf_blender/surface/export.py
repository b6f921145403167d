"""What the scene's object shows, recolored, as a file of another program: by Blender's own exporters."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ..engine_api import BadRequest
from ..host import compat
from ..nodes import shadeless
from . import mesh

SHAPES = ("quads", "points")
USD_COLOR = "displayColor"  # the attribute that the format's viewers show


def _ply(data: bpy.types.Mesh, path: str) -> None:
    bpy.ops.wm.ply_export(filepath=path, export_selected_objects=True, export_colors="SRGB")


def _gltf(data: bpy.types.Mesh, path: str) -> None:
    if not data.polygons and not compat.HAS_GLTF_POINTS:
        raise BadRequest("This Blender cannot write points to glTF.", "Choose quads, or write a PLY file.")
    # the exporter takes a background for a material without light, and an emission for white light
    unlit = shadeless.background("KaRF unlit")
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
    data.attributes[mesh.COLOR].name = USD_COLOR
    bpy.ops.wm.usd_export(filepath=path, selected_objects_only=True)


WRITERS: dict[str, Callable[[bpy.types.Mesh, str], None]] = {
    ".ply": _ply,
    ".glb": _gltf,
    ".gltf": _gltf,
    ".usd": _usd,
    ".usda": _usd,
    ".usdc": _usd,
}


def export(scene: bpy.types.Scene, item: bpy.types.Object, path: Path, shape: str) -> None:
    """Write what an object of `placing` shows now, where it is in Blender's world.

    Args:
        scene: The scene; its selection stays as it was.
        item: The object.
        path: The file, whose ending says which kind.
        shape: `quads`, as Blender shows it, or `points`, a vertex each.

    Raises:
        BadRequest: No such kind of file is written, not of points, or not by this Blender.
    """
    write = WRITERS.get(path.suffix.lower())
    if write is None:
        raise BadRequest(
            "{path} has an unknown file extension.", "Use one of {endings}.", path=path, endings=", ".join(WRITERS)
        )
    if not _has_exporter(path):
        raise BadRequest(
            "This Blender has no exporter for {suffix} files.",
            "Enable it, or choose another file extension.",
            suffix=path.suffix,
        )
    shown = item.evaluated_get(bpy.context.evaluated_depsgraph_get())
    data = _quads(shown) if shape == "quads" else _points(shown)
    with _selected(scene, data, item) as copy:
        copy.matrix_world = item.matrix_world
        write(data, str(path))


def _has_exporter(path: Path) -> bool:
    """Whether this Blender writes such files: some are built without USD, and glTF is an add-on."""
    if path.suffix.lower().startswith(".usd"):
        return "usd_export" in dir(bpy.ops.wm)
    return not path.suffix.lower().startswith(".gl") or "gltf" in dir(bpy.ops.export_scene)


def _quads(shown: bpy.types.Object) -> bpy.types.Mesh:
    """The faces with their colors alone."""
    data = bpy.data.meshes.new_from_object(shown)
    names = [each.name for each in data.attributes if each.domain == "FACE" and not each.is_required]
    for name in names:
        data.attributes.remove(data.attributes[name])
    return data


def _points(shown: bpy.types.Object) -> bpy.types.Mesh:
    """A vertex with its color for each face."""
    source = shown.data
    n = len(source.polygons)
    places, colors = np.empty(3 * n, np.float32), np.empty(16 * n, np.float32)
    source.attributes[mesh.CENTER].data.foreach_get("vector", places)
    source.attributes[mesh.COLOR].data.foreach_get("color_srgb", colors)
    data = bpy.data.meshes.new("points")
    data.vertices.add(n)
    data.vertices.foreach_set("co", places)
    attribute = data.attributes.new(mesh.COLOR, "BYTE_COLOR", "POINT")
    attribute.data.foreach_set("color_srgb", colors.reshape(n, 4, 4)[:, 0].ravel())
    data.attributes.active_color = attribute
    return data


@contextmanager
def _selected(
    scene: bpy.types.Scene, data: bpy.types.Mesh, named_after: bpy.types.Object
) -> Iterator[bpy.types.Object]:
    """An object of this mesh, which alone is selected; afterwards both are gone, and the selection is what it was."""
    layer = bpy.context.view_layer
    active, selected = layer.objects.active, list(bpy.context.selected_objects)
    copy = bpy.data.objects.new(f"{named_after.name} export", data)
    scene.collection.objects.link(copy)
    try:
        for each in selected:
            each.select_set(False)
        copy.select_set(True)
        layer.objects.active = copy
        yield copy
    finally:
        bpy.data.meshes.remove(data)  # and with it the object
        for each in selected:
            each.select_set(True)
        layer.objects.active = active
