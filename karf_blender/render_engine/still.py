"""One picture of a render with its passes: depth, masks of objects, weights of swatches."""

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import bpy
import numpy as np
from bpy.props import BoolProperty

from .. import session
from ..engine.worker import error_from_event
from ..engine_api import BadRequest, Camera, Cancelled, KarfError, srgb_to_linear
from ..nodes import swatch_socket
from ..project import folders
from ..rig import lens
from ..swatches import colors, displayed
from ..tasks.queries import WarmWorker
from . import camera_pixels

COMBINED = "Combined"
POLL_SECONDS = 0.005
FAR = 1e10  # depth of the background, like that of Blender's own engines


def _update_passes(_, context):
    context.view_layer.update_render_passes()  # nodes of the compositor get a socket for each pass


class KARF_PG_layer(bpy.types.PropertyGroup):
    use_weights: BoolProperty(
        name="Weights",
        description="Add a pass for each swatch with its share in every pixel, from 0 to 1",
        update=_update_passes,
    )
    use_seen: BoolProperty(
        name="Seen",
        description="Add a pass of how well the photos cover each pixel, from 0 (no photo) to 1. Requires splats",
        update=_update_passes,
    )


@session.setup
def _layer_properties():
    bpy.types.ViewLayer.karf = bpy.props.PointerProperty(type=KARF_PG_layer)
    yield
    del bpy.types.ViewLayer.karf


@dataclass(frozen=True)
class Pass:
    name: str
    channels: str  # a letter for each
    kind: str  # COLOR or VALUE
    array: str  # in the answer to the engine's query `show`
    index: tuple[int, ...] = ()  # in the array


def passes_of(scene: bpy.types.Scene, layer: bpy.types.ViewLayer) -> Iterator[Pass]:
    """Yield the passes of a view layer beside the picture."""
    if layer.use_pass_z:
        yield Pass("Depth", "Z", "VALUE", "depth")
    if layer.use_pass_cryptomatte_object:
        for level in range((layer.pass_cryptomatte_depth + 1) // 2):
            yield Pass(f"CryptoObject{level:02d}", "RGBA", "COLOR", "cryptomatte", (level,))
    if layer.karf.use_seen:
        yield Pass("Seen", "X", "VALUE", "seen")
    if layer.karf.use_weights:
        for number, item in enumerate(scene.karf.objects):
            for index in range(1, colors.size(item)):
                yield Pass(swatch_socket(item.name, index), "X", "VALUE", "weights", (number, index))


def render(engine: bpy.types.RenderEngine, depsgraph: bpy.types.Depsgraph) -> None:
    """Render the view layer of a dependency graph; on the render thread, so data is only read. Raises KarfError."""
    scene, layer = depsgraph.scene, depsgraph.view_layer
    if scene.camera is None:
        raise BadRequest(
            "The scene {name!r} has no camera.", "Add one, or choose one in its properties.", name=scene.name
        )
    camera = _bordered(scene, lens.pinhole_in(depsgraph, scene, scene.camera))
    passes = list(passes_of(scene, layer))
    names = {each.array for each in passes} | ({"alpha"} if scene.render.film_transparent else set())
    options = camera_pixels.options_of(depsgraph.scene_eval, camera, displayed.of(scene).solved) | {
        "passes": ["color", *sorted(names)],
        "cryptomatte": f"{layer.name}.CryptoObject",  # the name that Blender's Cryptomatte node expects
    }
    engine.update_stats("", "KaRF")
    answer = ask(scene, camera_pixels.KIND, options, engine.test_break)
    arrays = camera_pixels.arrays_of(answer)
    to_blender = lens.to_capture(depsgraph, scene).inverted().to_scale().x
    result = engine.begin_result(0, 0, camera.width, camera.height, layer=layer.name)
    rendered = result.layers[0].passes
    color = srgb_to_linear(arrays["color"])
    alpha = arrays.get("alpha", np.ones(color.shape[:2], np.float32))[..., None]
    _put(rendered[COMBINED], np.concatenate([color * alpha, alpha], -1))  # scene-linear, alpha premultiplied
    for each in passes:
        _put(rendered[each.name], _pixels_of(each, arrays, to_blender))
    engine.end_result(result)
    whole = engine.get_result()  # the result of one layer is gone now
    for name, value in answer.get("metadata", {}).items():
        whole.stamp_data_add_field(name, value)


def _bordered(scene: bpy.types.Scene, camera: Camera) -> Camera:
    render = scene.render
    if not render.use_border:
        return camera
    left, right = (int(share * camera.width) for share in (render.border_min_x, render.border_max_x))
    bottom, top = (int(share * camera.height) for share in (render.border_min_y, render.border_max_y))
    cy = camera.cy - (camera.height - top)
    return replace(camera, width=right - left, height=top - bottom, cx=camera.cx - left, cy=cy)


def _pixels_of(each: Pass, arrays: dict[str, np.ndarray], to_blender: float) -> np.ndarray:
    """Return a pass [H, W, channels], zeros if the engine has nothing for it; depth times `to_blender`."""
    array = arrays[each.array]
    if each.array == "depth":
        return np.where(array > 0, array * to_blender, FAR)[..., None]
    if any(index >= size for index, size in zip(each.index, array.shape, strict=False)):
        return np.zeros((*arrays["color"].shape[:2], len(each.channels)))
    found = array[each.index]
    return found if found.ndim == 3 else found[..., None]


def _put(target: bpy.types.RenderPass, pixels: np.ndarray) -> None:
    """Give pixels [H, W, channels] to Blender, whose first row is the lowest."""
    target.rect.foreach_set(np.ascontiguousarray(pixels[::-1], np.float32).ravel())


# --- waiting for the engine ----------------------------------------------------------------------------------------
class RenderWorker(WarmWorker):
    """The worker of the render thread: a timer polls the interface's meanwhile. It stays for the next frame."""

    idle_minutes = 1


def ask(scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]) -> dict[str, Any]:
    """Send a query to the engine, and wait for its answer; the caller deletes files that it names.

    Raises Cancelled when `is_cancelled` returns True, which ends the worker, and KarfError without an answer.
    """
    options = {"project": str(folders.project_of(scene).folder), **options}
    for _ in range(2):  # an idle worker may end just before the query
        answer = _answer(scene, kind, options, is_cancelled)
        if answer is not None:
            return answer
    raise KarfError("The engine exited before it answered.", "Try again.")


def _answer(
    scene: bpy.types.Scene, kind: str, options: dict[str, Any], is_cancelled: Callable[[], bool]
) -> dict[str, Any] | None:
    """Return the answer's values; None if the worker has ended without a failure before."""
    kept = session.get(RenderWorker)
    if kept.worker is not None:
        kept.worker.poll()
        if kept.worker.ended:
            kept.close()
    worker = kept.start(scene)
    worker.query(kind, options, kind)
    while True:
        for _, event in worker.replies():
            if event.kind == "answer":
                return {name: value for name, value in event.values.items() if name != "id"}
            if event.kind == "refused":
                raise error_from_event(event)
        if worker.ended:
            kept.leave()
            return None
        if is_cancelled():
            kept.close()
            raise Cancelled("The render was cancelled.")
        time.sleep(POLL_SECONDS)
