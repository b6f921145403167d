"""How far the sparse points are from where the looked-through photo shows them: numbers, and an overlay on the photo.

The numbers belong to the session and are taken when a view is looked through; drawing only reads them.
"""

from dataclasses import dataclass, field
from pathlib import Path

import blf
import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from .. import session
from ..engine_api import (
    Capture,
    ErrorSummary,
    KarfError,
    observed_points,
    reprojection_errors,
    summarize,
    undistort_points_near,
)
from ..host import compat, windows
from ..project import captures

BAD_PIXELS = 4.0  # pixels of error from which it is drawn red
GOOD, FAIR, BAD = np.array([[0.1, 0.9, 0.2, 1.0], [1.0, 0.85, 0.0, 1.0], [1.0, 0.05, 0.05, 1.0]], np.float32)
LINE_WIDTH, POINT_SIZE = 1.5, 4.0
TEXT_SIZE, TEXT_MARGIN = 14, 24


@dataclass(frozen=True)
class Check:
    """One view's errors.

    Attributes:
        capture: Where the capture lies.
        view: The view's name.
        summary: Count, median and worst error.
        places: [2m, 3] float32, capture's world: each point as it is, and where the photo shows it at the same depth.
        colors: [2m, 4] float32.
        batches: Lines and dots on the graphics card, made at the first drawing.
    """

    capture: Path
    view: str
    summary: ErrorSummary
    places: np.ndarray
    colors: np.ndarray
    batches: list = field(default_factory=list)


@dataclass
class _State:
    """The check of the view that was looked through last."""

    check: Check | None = None


# --- numbers -------------------------------------------------------------------------------------------------------
def remember(scene: bpy.types.Scene, capture: Capture, name: str) -> None:
    """Remember the errors of a view of the scene's capture; captures without points have none."""
    session.get(_State).check = check(captures.path_of(scene), capture, name) if capture.points is not None else None


def check(path: Path, capture: Capture, name: str) -> Check:
    """The errors of one view.

    Raises:
        DataError: The capture has no points or no such view.
    """
    view = capture.view(name)
    number = capture.views.index(view)
    observed, projected = reprojection_errors(capture, number)
    points = observed_points(capture, number)
    camera = view.camera
    shown, depth = camera.project(points)
    origins, directions = camera.rays(undistort_points_near(camera, observed, shown))
    seen = origins + depth[:, None] * directions
    usable = np.isfinite(projected).all(-1) & np.isfinite(seen).all(-1)
    errors = np.linalg.norm(observed - projected, axis=-1)[usable]
    places = np.stack([points[usable], seen[usable]], 1).reshape(-1, 3)
    return Check(
        path, name, summarize(observed, projected), places.astype(np.float32), _colors(errors).repeat(2, axis=0)
    )


def _colors(errors: np.ndarray) -> np.ndarray:
    """Green, yellow, red for errors [m] of 0, half and all of BAD_PIXELS; [m, 4] float32."""
    share = np.minimum(errors / BAD_PIXELS, 1)
    channels = [np.interp(share, [0, 0.5, 1], [GOOD[i], FAIR[i], BAD[i]]) for i in range(4)]
    return np.stack(channels, -1).astype(np.float32)


def of_camera(scene: bpy.types.Scene, camera: bpy.types.Object | None) -> Check | None:
    """What is known of a camera of the scene's rig; None where it was not looked through last."""
    known = session.get(_State).check
    if known is None or camera is None or camera.parent is None or camera.parent != scene.karf.rig:
        return None
    is_same = camera.karf_view == known.view and captures.path_of(scene) == known.capture
    return known if is_same else None


def refresh(scene: bpy.types.Scene) -> None:
    """The overlay was switched: take the numbers of the scene's camera where they are not known yet, and redraw."""
    camera = scene.camera
    if scene.karf.show_reprojection and camera is not None and camera.karf_view and of_camera(scene, camera) is None:
        try:
            remember(scene, captures.of(scene), camera.karf_view)
        except KarfError as error:
            print(f"KaRF: {error.sentence} {error.hint}")
    windows.redraw("VIEW_3D")


def forget() -> None:
    """Drop the numbers."""
    session.get(_State).check = None


# --- the overlay ---------------------------------------------------------------------------------------------------
def _drawn() -> Check | None:
    """What the 3D View that is being drawn is to show."""
    context = bpy.context
    space, scene = context.space_data, context.scene
    if not scene.karf.show_reprojection or not space.overlay.show_overlays:
        return None
    if context.region_data.view_perspective != "CAMERA":
        return None
    return of_camera(scene, space.camera if space.use_local_camera else scene.camera)


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


def _draw_numbers() -> None:
    known = _drawn()
    if known is None:
        return
    text, scale = str(known.summary), bpy.context.preferences.system.ui_scale
    blf.size(0, TEXT_SIZE * scale)
    blf.color(0, 1, 1, 1, 1)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0, 0, 0, 1)
    blf.position(0, (bpy.context.region.width - blf.dimensions(0, text)[0]) / 2, TEXT_MARGIN * scale, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)


@session.handler("load_post", phase=session.Phase.READ)
def _after_load(*_):
    # the numbers were another file's, and the cameras are not looked through yet
    forget()
    for scene in bpy.data.scenes:
        if scene.karf.show_reprojection:
            scene.karf.show_reprojection = False


@session.setup
def _overlay():
    space = bpy.types.SpaceView3D
    handlers = (
        space.draw_handler_add(_draw_points, (), "WINDOW", "POST_VIEW"),
        space.draw_handler_add(_draw_numbers, (), "WINDOW", "POST_PIXEL"),
    )
    yield
    for handler in handlers:
        space.draw_handler_remove(handler, "WINDOW")
