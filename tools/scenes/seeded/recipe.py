"""A drawn scene as a capture."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import bpy
import numpy as np
from mathutils import Vector

from ..cameras import View, dome_views, patch_views, path_views
from ..recipe import Extent, Recipe, TrueEdit, make_capture
from .draw import draw_scene
from .forms import add_thing
from .masks import draw_hasty_masks
from .photo_flaws import spoil_photos
from .scene import Cameras, Scene
from .surroundings import add_surroundings

TEST_VIEWS = 8
PATCH = (1.8, 1.0)
SLOTS = ("main", "second")
PROBES, RAYS = 7, 32  # photos, and rays along their side, that test what they show
SHOWN_LEAST, SHOWN_IN = 0.006, 0.5  # share of a photo that a marked thing has, and of the photos in which it has it

README = """\
Drawn scene of seed {scene.seed}: {scene.place}, {scene.light}, {scene.cameras.way} of {scene.cameras.train} photos
================================================================================================

Rendered with Cycles from a drawn scene; public domain (CC0 1.0). Made by
    {command}
(bpy {blender}). Laid out as the demo. Beside the first object: {scene.relation}. Background: {scene.background}.
Training photos have noise of {flaws.noise:.3f}, blur of {flaws.blur:.2f} pixels, and exposures that differ by
{flaws.drift:.3f}; test photos are clean. Edits: "first" changes the main color of the first object, "all" all colors
of all marked objects.

Rough masks, drawn by a hasty hand
{masks}
"""


def make_drawn_capture(seed: int, size: int, samples: int, out: Path, *, command: str, threads: int) -> None:
    """Render the scene of a seed as a capture into ``out``, ``size`` pixels square."""
    scene = visible_scene(seed)
    recipe, extent = _recipe(scene), Extent(size, scene.cameras.train, TEST_VIEWS, samples)
    make_capture(recipe, extent, out, command, threads, ("photos", "truth", "recolors"))
    spoil_photos(out, scene.flaws, scene.seed)
    masks = draw_hasty_masks(out, recipe.views(extent.train, extent.test), recipe.names, seed)
    facts = {"scene": scene, "flaws": scene.flaws, "command": command, "blender": bpy.app.version_string}
    (out / "README.txt").write_text(README.format(**facts, masks=masks), encoding="utf-8")


def visible_scene(seed: int) -> Scene:
    """Return the first scene of a seed whose marked things are seen well enough in enough photos."""
    attempt = 0
    while not _shows_marked(scene := draw_scene(seed, attempt)):
        attempt += 1
    return scene


def _recipe(scene: Scene) -> Recipe:
    edits = {name: TrueEdit(tuple(repaints), _slots(repaints)) for name, repaints in scene.repaints.items()}
    return Recipe(
        title="",
        place="",
        about_edits="",
        build=partial(_build, scene),
        views=_views(scene.cameras),
        field_of_view=scene.cameras.field_of_view,
        names={thing.name: thing.object_id for thing in scene.marked},
        edits=edits,
    )


def _slots(repaints) -> dict:
    return {name: dict(zip(SLOTS, colors, strict=False)) for name, colors in repaints.items()}


def _build(scene: Scene) -> None:
    add_surroundings(scene)
    for thing in scene.things:
        add_thing(thing)


def _views(cameras: Cameras) -> Callable[[int, int], list[View]]:
    """Return the function that makes this many training and test views."""
    if cameras.way == "dome":
        return partial(dome_views, radius=cameras.distance, target=cameras.target)
    if cameras.way == "path":
        return partial(path_views, distance=cameras.distance, target=cameras.target, seed=cameras.seed)
    x, y, z = cameras.target
    return partial(patch_views, center=(x, y - cameras.distance, z + 0.3), size=PATCH, target=cameras.target)


def _shows_marked(scene: Scene) -> bool:
    """Test by a few rays whether every marked thing fills its share of enough photos."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    _build(scene)
    views = _views(scene.cameras)(PROBES, 0)
    shares = np.array([_shares(view, scene) for view in views])
    return bool(((shares >= SHOWN_LEAST).mean(0) >= SHOWN_IN).all())


def _shares(view: View, scene: Scene) -> list[float]:
    """Return the share of a photo that each marked thing has."""
    graph = bpy.context.evaluated_depsgraph_get()
    reach = np.tan(0.5 * scene.cameras.field_of_view)
    across = reach * ((np.arange(RAYS) + 0.5) / RAYS * 2 - 1)
    rotation, origin = view.camera_to_world.to_3x3(), view.camera_to_world.translation
    hits = []
    for x in across:
        for y in across:
            hit = bpy.context.scene.ray_cast(graph, origin, rotation @ Vector((x, y, -1.0)))
            hits.append(hit[4].pass_index if hit[0] else 0)
    return [hits.count(thing.object_id) / len(hits) for thing in scene.marked]
