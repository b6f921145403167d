"""The learned scene as an object, and as a file of other programs."""

from pathlib import Path

import bpy

from .. import steps
from ..tasks import runner
from .context import scene_of


def show_scene(
    count: int | None = None, points: str | Path | None = None, scene: bpy.types.Scene | None = None
) -> bpy.types.Object:
    """Show the learned scene as an object whose colors follow the swatches.

    Args:
        count: About how many points; default: the panel's.
        points: A file that the engine has written already (`points --out FILE.npz`); then it is not asked.
        scene: Default: the context's.

    Returns:
        The object; where there was one before, the same with other points.
    """
    scene = scene_of(scene)
    if points is not None:
        return steps.place_points(scene, Path(points).absolute())
    runner.wait(steps.show_scene(scene, count))
    return scene.karf.surface.item


def export_scene(path: str | Path, shape: str = "quads", scene: bpy.types.Scene | None = None) -> Path:
    """Write that object with its colors as they are now.

    Args:
        path: The file: `.ply`, `.glb`, `.gltf`, `.usd`, `.usda` or `.usdc`.
        shape: `quads`, as Blender shows it, or `points`, a vertex each.
        scene: Default: the context's.

    Returns:
        The file's path.
    """
    return steps.export_scene(scene_of(scene), Path(path).absolute(), shape)
