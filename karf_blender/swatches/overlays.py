"""Overlays: masks, the split view's line, the scale of differences and the loupe, drawn over pictures."""

import blf
import bpy
import gpu
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from gpu_extras.batch import batch_for_shader

from .. import session
from ..host.drawing import draw_line, draw_text
from ..host.words import translate
from . import displayed, views
from .object_masks import ObjectMasks

LINE_WIDTH = 1.5
TEXT_SIZE, MARGIN = 12, 16
SCALE_WIDTH, SCALE_HEIGHT = 200, 12  # size of the scale of differences, pixels
TICKS = 4
UNIT_SQUARE = ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))
LOUPE_SIDE = 11  # pixels of the picture in a row and in a column of the loupe
LOUPE_CELL = 9  # size of each, pixels of the screen at scale 1
LOUPE_DISTANCE = 24  # from the mouse
AVERAGED = 3  # pixels in a row and in a column in the middle, whose mean is picked
FRAME, NO_COLOR = (0.05, 0.05, 0.05, 1.0), (0.3, 0.3, 0.3, 1.0)

Rectangle = tuple[float, float, float, float]  # left, bottom, right, top, in pixels of the region


# --- where ---------------------------------------------------------------------------------------------------------
def picture_in(region: bpy.types.Region) -> Rectangle:
    """Return where the picture is in the main region of an Image Editor."""
    return (*region.view2d.view_to_region(0, 0, clip=False), *region.view2d.view_to_region(1, 1, clip=False))


def place_under(region: bpy.types.Region, mouse: tuple[int, int]) -> tuple[float, float] | None:
    """Return the place in an Image Editor's picture, (0, 0) lower left to (1, 1), of a mouse in window pixels."""
    x, y = mouse[0] - region.x, mouse[1] - region.y
    if not (0 <= x < region.width and 0 <= y < region.height):
        return None
    left, bottom, right, top = picture_in(region)
    return (x - left) / max(1, right - left), (y - bottom) / max(1, top - bottom)


def shows_picture(context: bpy.types.Context) -> bool:
    """Tell whether the context's editor shows the scene's result image, or a followed camera's picture."""
    space = context.space_data
    is_image = space is not None and space.type == "IMAGE_EDITOR"
    return is_image and (displayed.is_camera_in(space) or is_result(context.scene, space))


def is_result(scene: bpy.types.Scene, space: bpy.types.Space | None) -> bool:
    """Tell whether a space is an Image Editor that shows a scene's result image."""
    result = scene.karf.result
    return space is not None and space.type == "IMAGE_EDITOR" and result is not None and space.image == result


def _camera_frame(context: bpy.types.Context) -> Rectangle | None:
    """Return where the camera's frame is in a 3D View that looks through the active view's camera."""
    scene, space, view = context.scene, context.space_data, context.region_data
    camera = space.camera if space.use_local_camera else scene.camera
    is_rigs = camera is not None and camera.parent is not None and camera.parent == scene.karf.rig
    if view.view_perspective != "CAMERA" or not is_rigs or camera.karf_view != scene.karf.active_view:
        return None
    corners = [camera.matrix_world @ corner for corner in camera.data.view_frame(scene=scene)]
    places = [location_3d_to_region_2d(context.region, view, corner) for corner in corners]
    if None in places:
        return None
    (left, bottom), (right, top) = np.min(places, axis=0), np.max(places, axis=0)
    return left, bottom, right, top


# --- in editors ----------------------------------------------------------------------------------------------------
@session.draw_handler(bpy.types.SpaceImageEditor, "POST_PIXEL")
def _draw_in_image() -> None:
    context = bpy.context
    if not shows_picture(context) or not context.space_data.overlay.show_overlays:
        return
    seeing, place = context.window_manager.karf_seeing, picture_in(context.region)
    if seeing.show_masks:
        is_camera = displayed.is_camera_in(context.space_data)
        masks = displayed.followed_camera().masks if is_camera else displayed.of(context.scene).known_masks()
        _draw_masks(masks, place)
    if seeing.mode == "DIFFERENCE":
        _draw_scale(context.preferences.system.ui_scale)
    if seeing.is_wiped:
        draw_split(context)


@session.draw_handler(bpy.types.SpaceView3D, "POST_PIXEL")
def _draw_in_view() -> None:
    context = bpy.context
    if context.window_manager.karf_seeing.show_masks and context.space_data.overlay.show_overlays:
        place = _camera_frame(context)
        if place is not None:
            _draw_masks(displayed.of(context.scene).known_masks(), place)


def _draw_masks(masks: ObjectMasks | None, place: Rectangle) -> None:
    if masks is None:
        return
    seeing = bpy.context.window_manager.karf_seeing
    fill, lines = (gpu.shader.from_builtin(name) for name in ("IMAGE_COLOR", "POLYLINE_FLAT_COLOR"))
    if not masks.drawn:
        masks.drawn.extend(_on_card(masks, fill, lines))
    texture, square, outlines = masks.drawn
    left, bottom, right, top = place
    gpu.state.blend_set("ALPHA")
    with gpu.matrix.push_pop():
        gpu.matrix.translate((left, bottom))
        gpu.matrix.scale((right - left, top - bottom))
        fill.bind()
        fill.uniform_sampler("image", texture)
        fill.uniform_float("color", (1, 1, 1, seeing.tint))
        square.draw(fill)
        if seeing.outlines:
            lines.bind()
            lines.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
            lines.uniform_float("lineWidth", LINE_WIDTH * bpy.context.preferences.system.ui_scale)
            outlines.draw(lines)
    gpu.state.blend_set("NONE")


def _on_card(masks: ObjectMasks, fill: gpu.types.GPUShader, lines: gpu.types.GPUShader) -> tuple:
    """Return the fill as a texture, the square that it is drawn in, and the outlines."""
    height, width = masks.fill.shape[:2]
    texture = gpu.types.GPUTexture(
        (width, height), format="RGBA8", data=gpu.types.Buffer("FLOAT", masks.fill.size, masks.fill.ravel())
    )
    square = batch_for_shader(fill, "TRIS", {"pos": UNIT_SQUARE, "texCoord": UNIT_SQUARE})
    return texture, square, batch_for_shader(lines, "LINES", {"pos": masks.outlines, "color": masks.colors})


def draw_split(context: bpy.types.Context, is_bold: bool = False) -> None:
    """Draw the split view's line in an Image Editor, and the names of its sides."""
    seeing, scale = context.window_manager.karf_seeing, context.preferences.system.ui_scale
    left, bottom, right, top = picture_in(context.region)
    x = left + seeing.wipe * (right - left)
    unit = 2 * scale if is_bold else scale
    gpu.state.blend_set("ALPHA")
    draw_line(((x, bottom), (x, top)), (4 * unit, (0, 0, 0, 0.5)), (LINE_WIDTH * unit, (1, 1, 1, 1)))
    gpu.state.blend_set("NONE")
    blf.size(0, TEXT_SIZE * scale)
    before, after = (seeing.bl_rna.properties["mode"].enum_items[name].name for name in ("ORIGINAL", seeing.mode))
    draw_text(before, x - blf.dimensions(0, before)[0] - MARGIN * scale / 2, top - MARGIN * scale)
    draw_text(after, x + MARGIN * scale / 2, top - MARGIN * scale)


def _draw_scale(scale: float) -> None:
    """Draw the colors of differences and what they mean."""
    left, bottom = MARGIN * scale, 2 * MARGIN * scale
    values = np.linspace(0, views.HOTTEST, len(views.HEAT))
    x = left + values / views.HOTTEST * SCALE_WIDTH * scale
    colors = [(*map(float, color), 1.0) for color in views.HEAT]
    corners = [(float(at), bottom + up * SCALE_HEIGHT * scale) for at in x for up in (0, 1)]
    _draw_colors("TRI_STRIP", corners, [color for color in colors for _ in (0, 1)])
    blf.size(0, TEXT_SIZE * scale)
    for tick in range(TICKS + 1):
        text = f"{views.HOTTEST * tick / TICKS:g}" + ("+" if tick == TICKS else "")
        draw_text(text, left + SCALE_WIDTH * scale * tick / TICKS, bottom - MARGIN * scale)
    draw_text(translate("Difference: 1 is just visible"), left, bottom + (SCALE_HEIGHT + 6) * scale)


def _draw_colors(kind: str, points: list, colors: list[tuple[float, ...]]) -> None:
    """Draw triangles with a color at each point, sRGB with alpha."""
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    batch_for_shader(shader, kind, {"pos": points, "color": colors}).draw(shader)


# --- the loupe -----------------------------------------------------------------------------------------------------
def pixels_at(picture: np.ndarray, place: tuple[float, float]) -> np.ndarray:
    """Return the pixels [LOUPE_SIDE, LOUPE_SIDE, 3] in [0, 1] round a `place_under` of a picture [H, W, 3] uint8."""
    height, width = picture.shape[:2]
    column, row, around = int(place[0] * width), int((1 - place[1]) * height), np.arange(LOUPE_SIDE) - LOUPE_SIDE // 2
    rows, columns = np.clip(row + around, 0, height - 1), np.clip(column + around, 0, width - 1)
    return picture[np.ix_(rows, columns)].astype(np.float32) / 255


def draw_loupe(
    pixels: np.ndarray, picked: np.ndarray | None, mouse: tuple[float, float], region: bpy.types.Region
) -> None:
    """Draw `pixels_at` the mouse (pixels of the region) beside it, which count, and the color a click picks, if any."""
    cell = LOUPE_CELL * bpy.context.preferences.system.ui_scale
    size, height = LOUPE_SIDE * cell, (LOUPE_SIDE + 2) * cell
    left, bottom = (
        at + LOUPE_DISTANCE if at + LOUPE_DISTANCE + extent < end else at - LOUPE_DISTANCE - extent
        for at, extent, end in zip(mouse, (size, height), (region.width, region.height), strict=True)
    )
    places = [
        (left + column * cell, bottom + (LOUPE_SIDE + 1 - row) * cell, cell, cell)
        for row in range(LOUPE_SIDE)
        for column in range(LOUPE_SIDE)
    ]
    _draw_rectangles([(left - 2, bottom - 2, size + 4, height + 4)], [FRAME])
    _draw_rectangles(places, [(*map(float, color), 1.0) for color in pixels.reshape(-1, 3)])
    color = NO_COLOR if picked is None else (*map(float, picked), 1.0)
    _draw_rectangles([(left, bottom, size, 2 * cell - 2)], [color])
    first, inner = (LOUPE_SIDE - AVERAGED) // 2 * cell, AVERAGED * cell
    x, y = left + first, bottom + 2 * cell + first
    corners = ((x, y), (x + inner, y), (x + inner, y + inner), (x, y + inner), (x, y))
    draw_line(corners, (3, (0, 0, 0, 1)), (1, (1, 1, 1, 1)))  # visible on light and on dark pixels


def _draw_rectangles(rectangles: list[tuple[float, float, float, float]], colors: list[tuple[float, ...]]) -> None:
    """Draw rectangles (left, bottom, width, height), each of one color."""
    points = [(x + u * width, y + v * height) for x, y, width, height in rectangles for u, v in UNIT_SQUARE]
    _draw_colors("TRIS", points, [color for color in colors for _ in UNIT_SQUARE])
