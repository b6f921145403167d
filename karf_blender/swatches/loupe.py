"""A loupe beside the mouse while a color is picked: the pixels there, which of them count, and what would be picked."""

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

SIDE = 11  # pixels of the picture that the loupe shows, in a row and in a column
COUNTED = 3  # of these, in the middle, that are averaged
CELL = 9  # size of each in the loupe, pixels of the screen at scale 1
AWAY = 24  # of the loupe from the mouse
FRAME, NOTHING = (0.05, 0.05, 0.05, 1.0), (0.3, 0.3, 0.3, 1.0)

Corner = tuple[float, float]


def pixels_at(picture: np.ndarray, place: tuple[float, float]) -> np.ndarray:
    """The pixels round a place of a picture, which is continued by its border.

    Args:
        picture: [H, W, 3] uint8, row 0 on top.
        place: From its lower left corner to its upper right one, 0 to 1.

    Returns:
        [SIDE, SIDE, 3] float32 in [0, 1], row 0 on top.
    """
    height, width = picture.shape[:2]
    column, row, around = int(place[0] * width), int((1 - place[1]) * height), np.arange(SIDE) - SIDE // 2
    rows, columns = np.clip(row + around, 0, height - 1), np.clip(column + around, 0, width - 1)
    return picture[np.ix_(rows, columns)].astype(np.float32) / 255


def draw(pixels: np.ndarray, picked: np.ndarray | None, mouse: Corner, room: Corner) -> None:
    """Draw the loupe in the region that is being drawn.

    Args:
        pixels: See `pixels_at`.
        picked: The color that a click would pick, sRGB [3]; None where there is none.
        mouse: Where it is in the region, pixels.
        room: The region's width and height.
    """
    cell = CELL * bpy.context.preferences.system.ui_scale
    size, height = SIDE * cell, (SIDE + 2) * cell
    left, bottom = (
        at + AWAY if at + AWAY + extent < end else at - AWAY - extent
        for at, extent, end in zip(mouse, (size, height), room, strict=True)
    )
    _fill([(left - 2, bottom - 2, size + 4, height + 4)], [FRAME])
    places = [
        (left + column * cell, bottom + (SIDE + 1 - row) * cell, cell, cell)
        for row in range(SIDE)
        for column in range(SIDE)
    ]
    _fill(places, [(*map(float, color), 1.0) for color in pixels.reshape(-1, 3)])
    _fill([(left, bottom, size, 2 * cell - 2)], [NOTHING if picked is None else (*map(float, picked), 1.0)])
    first = (SIDE - COUNTED) // 2 * cell
    _outline(left + first, bottom + 2 * cell + first, COUNTED * cell)


def _fill(rectangles: list[tuple[float, float, float, float]], colors: list[tuple[float, ...]]) -> None:
    """Rectangles (left, bottom, width, height), each of one color, sRGB with alpha."""
    corners = [
        (x + across * width, y + up * height)
        for x, y, width, height in rectangles
        for across, up in ((0, 0), (1, 0), (1, 1), (0, 0), (1, 1), (0, 1))
    ]
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    content = {"pos": corners, "color": [color for color in colors for _ in range(6)]}
    batch_for_shader(shader, "TRIS", content).draw(shader)


def _outline(left: float, bottom: float, size: float) -> None:
    """A square that is seen on light and on dark pixels."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    corners = [(left + x * size, bottom + y * size, 0) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1), (0, 0))]
    for width, color in ((3, (0, 0, 0, 1)), (1, (1, 1, 1, 1))):
        shader.uniform_float("lineWidth", width)
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINE_STRIP", {"pos": corners}).draw(shader)
