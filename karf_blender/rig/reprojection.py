"""Reprojection errors of the sparse points in the viewed photo: numbers, and an overlay in the 3D View."""

from dataclasses import dataclass, field
from pathlib import Path

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from .. import session
from ..engine_api import Capture, ErrorSummary, observed_points, reprojection_errors, summarize, undistort_points_near
from ..host import compat, windows
from ..host.drawing import draw_text
from ..progress import printing_errors
from ..project import captures

BAD_PIXELS = 4.0  # errors from this size on are red
GOOD, FAIR, BAD = np.array([[0.1, 0.9, 0.2, 1.0], [1.0, 0.85, 0.0, 1.0], [1.0, 0.05, 0.05, 1.0]], np.float32)
LINE_WIDTH, POINT_SIZE = 1.5, 4.0
TEXT_SIZE, TEXT_MARGIN = 14, 24


@dataclass(frozen=True)
class Check:
    capture: Path
    view: str
    summary: ErrorSummary
    places: np.ndarray  # [2m, 3] float32, capture's world: each point, and where the photo shows it at the same depth
    colors: np.ndarray  # [2m, 4] float32
    batches: list = field(default_factory=list)  # lines and dots on the GPU, made at the first drawing


@dataclass
class _Latest:
    per_file = True
    check: Check | None = None


def remember(scene: bpy.types.Scene, capture: Capture, name: str) -> None:
    """Compute and keep the errors in a view of the scene's capture, if the capture has points."""
    session.get(_Latest).check = check(captures.path_of(scene), capture, name) if capture.points is not None else None


def check(path: Path, capture: Capture, name: str) -> Check:
    """Return the errors in one view of the capture at a path. Raises DataError if the capture has no points."""
    view = capture.view(name)
    number, camera = capture.views.index(view), view.camera
    observed, projected = reprojection_errors(capture, number)
    points = observed_points(capture, number)
    exact, depth = camera.project(points)
    origins, directions = camera.rays(undistort_points_near(camera, observed, exact))
    seen = origins + depth[:, None] * directions
    usable = np.isfinite(projected).all(-1) & np.isfinite(seen).all(-1)
    places = np.stack([points[usable], seen[usable]], 1).reshape(-1, 3).astype(np.float32)
    colors = _colors(np.linalg.norm(observed - projected, axis=-1)[usable])
    return Check(path, name, summarize(observed, projected), places, colors.repeat(2, axis=0))


def _colors(errors: np.ndarray) -> np.ndarray:
    """Return green, yellow, red for errors [m] of 0, half and all of BAD_PIXELS; [m, 4] float32."""
    share = np.minimum(errors / BAD_PIXELS, 1)
    channels = [np.interp(share, [0, 0.5, 1], [GOOD[i], FAIR[i], BAD[i]]) for i in range(4)]
    return np.stack(channels, -1).astype(np.float32)


def of_camera(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> Check | None:
    """Return the errors of a camera of the scene's rig, if it was viewed through last."""
    known = session.get(_Latest).check
    if known is None or camera is None or camera.parent is None or camera.parent != scene.karf.rig:
        return None
    is_same = camera.karf_view == known.view and captures.path_of(scene) == known.capture
    return known if is_same else None


def refresh(scene: bpy.types.Scene) -> None:
    """Compute the errors of the scene's camera when the overlay is switched on, and redraw."""
    camera = scene.camera
    if scene.karf.show_reprojection and camera is not None and camera.karf_view and of_camera(scene, camera) is None:
        with printing_errors():
            remember(scene, captures.of(scene), camera.karf_view)
    windows.redraw("VIEW_3D")


@session.handler("load_post", phase=session.Phase.READ)
def _after_load(*_):
    for scene in bpy.data.scenes:
        if scene.karf.show_reprojection:
            scene.karf.show_reprojection = False  # no camera is viewed through yet


def _drawn() -> Check | None:
    context = bpy.context
    space, scene = context.space_data, context.scene
    is_wanted = scene.karf.show_reprojection and space.overlay.show_overlays
    if not is_wanted or context.region_data.view_perspective != "CAMERA":
        return None
    return of_camera(scene, space.camera if space.use_local_camera else scene.camera)


@session.draw_handler(bpy.types.SpaceView3D, "POST_VIEW")
def _draw_points() -> None:
    known = _drawn()
    if known is None or not len(known.places):
        return
    lines, dots = (gpu.shader.from_builtin(name) for name in ("POLYLINE_FLAT_COLOR", compat.POINT_SHADER))
    if not known.batches:
        points = {"pos": known.places[::2], "color": known.colors[::2]}
        known.batches.append(batch_for_shader(lines, "LINES", {"pos": known.places, "color": known.colors}))
        known.batches.append(batch_for_shader(dots, "POINTS", points))
    gpu.state.point_size_set(POINT_SIZE)
    with gpu.matrix.push_pop():
        gpu.matrix.multiply_matrix(bpy.context.scene.karf.rig.matrix_world)
        lines.bind()
        lines.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        lines.uniform_float("lineWidth", LINE_WIDTH)
        known.batches[0].draw(lines)
        known.batches[1].draw(dots)
    gpu.state.point_size_set(1.0)


@session.draw_handler(bpy.types.SpaceView3D, "POST_PIXEL")
def _draw_numbers() -> None:
    known = _drawn()
    if known is None:
        return
    text, scale = str(known.summary), bpy.context.preferences.system.ui_scale
    blf.size(0, TEXT_SIZE * scale)
    draw_text(text, (bpy.context.region.width - blf.dimensions(0, text)[0]) / 2, TEXT_MARGIN * scale)
