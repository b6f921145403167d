"""What Blender puts into a new file, where nobody has worked in it yet."""

import bpy
from mathutils import Matrix

OBJECTS = {"Camera", "Cube", "Light"}


def find_cube(scene: bpy.types.Scene) -> bpy.types.Object | None:
    """The cube of a file that was just opened as Blender makes it; None where anybody has worked."""
    is_new = not bpy.data.filepath and set(scene.objects.keys()) == OBJECTS
    return scene.objects["Cube"] if is_new and _is_untouched(scene.objects["Cube"]) else None


def remove(cube: bpy.types.Object) -> None:
    """Take the cube out of the file, with its mesh."""
    mesh = cube.data
    bpy.data.objects.remove(cube)
    bpy.data.meshes.remove(mesh)


def _is_untouched(cube: bpy.types.Object) -> bool:
    """Whether it is two units wide, in the middle, and nothing else."""
    if cube.type != "MESH" or cube.modifiers or cube.animation_data is not None or cube.data.users > 1:
        return False
    corners = {tuple(round(value, 4) for value in vertex.co) for vertex in cube.data.vertices}
    is_cube = len(corners) == 8 and all(abs(value) == 1 for corner in corners for value in corner)
    return is_cube and cube.matrix_basis == Matrix()
