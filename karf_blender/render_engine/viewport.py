"""The picture in a rendered 3D View: small while the view or a swatch changes, at full size after that."""

import json
import time
from functools import partial
from typing import Any

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d
from mathutils import Matrix

from .. import session
from ..engine_api import BadRequest, Camera, KarfError, camera_to_json, srgb_to_linear
from ..host import windows
from ..host.words import translate, translate_error
from ..rig import lens
from ..tasks import queries, runner
from . import camera_pixels

MOVING_SECONDS = 0.04  # time limit of a small picture
STILL_SECONDS = 0.12  # without a change before the full picture is requested
FIRST_SIDE, LEAST_SIDE = 256, 96  # pixels of a small picture
LEVELS = 1 << 16
LINEAR = srgb_to_linear(np.arange(LEVELS) / (LEVELS - 1)).astype(np.float32)  # of sRGB in invisible steps


class Viewport:
    """The requested and the displayed picture of one 3D View."""

    def __init__(self) -> None:
        self.message = ""  # the reason for a missing picture
        self._wanted = ""
        self._wanted_since = 0.0
        self._asked: tuple[str, int] | None = None  # and not answered yet
        self._shown: tuple[str, int] | None = None
        self._moving_side = FIRST_SIDE
        self._pixels: np.ndarray | None = None
        self._texture: gpu.types.GPUTexture | None = None

    def draw(self, engine: bpy.types.RenderEngine, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        """Draw the latest picture in the bound frame buffer, and request the next one."""
        try:
            self._ask(context, depsgraph)
        except KarfError as error:
            self.message, self._texture, self._pixels = translate_error(error), None, None
        if self._pixels is not None:
            height, width = self._pixels.shape[:2]
            data = gpu.types.Buffer("FLOAT", self._pixels.size, self._pixels)
            self._texture, self._pixels = gpu.types.GPUTexture((width, height), format="RGBA16F", data=data), None
        if self._texture is not None:
            gpu.state.blend_set("ALPHA_PREMULT")
            engine.bind_display_space_shader(depsgraph.scene)
            draw_texture_2d(self._texture, (0, 0), context.region.width, context.region.height)
            engine.unbind_display_space_shader()
            gpu.state.blend_set("NONE")

    def _ask(self, context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> None:
        if runner.is_running():  # it changes the picture, and needs all cores
            self.message = translate("A KaRF job is running: the view waits for it")
            return
        scene = depsgraph.scene
        camera = _pinhole(context, depsgraph)
        options = camera_pixels.options_of(scene, camera)
        wanted, now = json.dumps([options, runner.n_begun()]), time.monotonic()
        if wanted != self._wanted:
            self._wanted, self._wanted_since = wanted, now
        if self._is_awaited(wanted):
            return
        full = max(camera.width, camera.height)
        moving = min(full, self._moving_side)
        if self._shown is None or self._shown[0] != wanted:
            side = moving
        elif self._shown[1] >= full:
            return
        elif now - self._wanted_since >= STILL_SECONDS:
            side = full
        else:
            session.start_timer(_redraw_once_still)
            return
        self._asked = wanted, side
        if self._shown is None:
            self.message = translate("The engine prepares the first picture")
        query = options | {"camera": camera_to_json(camera.reduced(side))}
        queries.send(scene, camera_pixels.KIND, query, partial(self._take, self._asked), self._fail)

    def _is_awaited(self, wanted: str) -> bool:
        """Return whether to wait for the latest request: it is the wanted picture, or a small one, which arrives soon."""
        if self._asked is None or not queries.is_waiting(camera_pixels.KIND):
            return False
        return self._asked[0] == wanted or self._asked[1] <= self._moving_side

    def _take(self, asked: tuple[str, int], _: bpy.types.Scene, answer: dict[str, Any]) -> None:
        self._asked, self._shown, self.message = None, asked, ""
        self._pixels = _displayable(camera_pixels.arrays_of(answer)["color"])
        if asked[1] <= self._moving_side:
            factor = (MOVING_SECONDS / max(answer["seconds"], 1e-3)) ** 0.5
            self._moving_side = round(np.clip(self._moving_side * min(2.0, factor), LEAST_SIDE, 4096))
        windows.redraw("VIEW_3D")

    def _fail(self, error: KarfError) -> None:
        self.message, self._asked = translate_error(error), None
        self._shown = self._wanted, 1 << 30  # requested again after a change
        windows.redraw("VIEW_3D")


def _pinhole(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph) -> Camera:
    region, view = context.region, context.region_data
    if not view.is_perspective:
        raise BadRequest("An orthographic view cannot be rendered.", "Switch to perspective: View > Perspective.")
    to_capture = lens.to_capture(depsgraph, depsgraph.scene)
    pose = lens.rigid(np.array(to_capture @ view.view_matrix.inverted()), "3D View")
    return lens.pinhole_of(np.array(Matrix(view.window_matrix)), region.width, region.height, pose)


def _displayable(color: np.ndarray) -> np.ndarray:
    """Return sRGB [H, W, 3] as opaque scene-linear [H, W, 4], the lowest row first."""
    height, width = color.shape[:2]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = LINEAR[(color[::-1] * (LEVELS - 1) + 0.5).astype(np.uint16)]
    return pixels


def _redraw_once_still() -> None:
    windows.redraw("VIEW_3D")
