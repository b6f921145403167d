"""One picture of a render: what the engine shows a camera, put into Blender's render result."""

from dataclasses import replace

import bpy
import numpy as np

from ..engine_api import BadRequest, Camera
from ..rig import frames
from ..swatches import displayed
from . import blocking, camera_pixels, passes
from .passes import Pass


def render(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> None:
    """Render the view layer of a dependency graph; on the render thread, so data is only read.

    Raises:
        Cancelled: The user has cancelled.
        KarfError: There is no picture.
    """
    scene, layer = depsgraph.scene, depsgraph.view_layer
    if scene.camera is None:
        raise BadRequest(
            "The scene {name!r} has no camera.", "Add one, or choose one in its properties.", name=scene.name
        )
    camera = _bordered(scene, frames.pinhole_in(depsgraph, scene, scene.camera))
    wanted = list(passes.beside_combined(scene, layer))
    edited = displayed.of(scene).solved
    options = camera_pixels.options_of(depsgraph.scene_eval, camera, edited) | _asked_for(scene, layer, wanted)
    engine.update_stats("", "KaRF")
    answer = blocking.ask(scene, camera_pixels.KIND, options, engine.test_break)
    arrays = camera_pixels.arrays_of(answer)
    to_blender = frames.to_capture(depsgraph, scene).inverted().to_scale().x
    result = engine.begin_result(0, 0, camera.width, camera.height, layer=layer.name)
    rendered = result.layers[0].passes
    _put(rendered[passes.COMBINED], camera_pixels.combined(arrays))
    for each in wanted:
        _put(rendered[each.name], passes.pixels_of(each, arrays, to_blender))
    engine.end_result(result)
    whole = engine.get_result()  # that of one layer is gone once it is handed over
    for name, value in answer.get("metadata", {}).items():
        whole.stamp_data_add_field(name, value)


def _asked_for(scene: bpy.types.Scene, layer: bpy.types.ViewLayer, wanted: list[Pass]) -> dict:
    arrays = {each.array for each in wanted} | ({"alpha"} if scene.render.film_transparent else set())
    return {"passes": ["color", *sorted(arrays)], "cryptomatte": passes.cryptomatte_name(layer)}


def _bordered(scene: bpy.types.Scene, camera: Camera) -> Camera:
    """The camera that sees only the part of the picture that is rendered."""
    render = scene.render
    if not render.use_border:
        return camera
    left, right = (int(share * camera.width) for share in (render.border_min_x, render.border_max_x))
    bottom, top = (int(share * camera.height) for share in (render.border_min_y, render.border_max_y))
    above = camera.height - top
    return replace(camera, width=right - left, height=top - bottom, cx=camera.cx - left, cy=camera.cy - above)


def _put(target: bpy.types.RenderPass, pixels: np.ndarray) -> None:
    """Hand pixels [H, W, channels] to Blender, whose first row is the lowest."""
    target.rect.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())
