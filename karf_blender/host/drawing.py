"""Drawing lines and texts over editors, in pixels of the region."""

from collections.abc import Sequence

import blf
import gpu
from gpu_extras.batch import batch_for_shader


def draw_line(places: Sequence[Sequence[float]], *strokes: tuple[float, Sequence[float]]) -> None:
    """Draw a line through places (x, y) several times, each with a width and a color with alpha."""
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    batch = batch_for_shader(shader, "LINE_STRIP", {"pos": [(x, y, 0) for x, y in places]})
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    for width, color in strokes:
        shader.uniform_float("lineWidth", width)
        shader.uniform_float("color", color)
        batch.draw(shader)


def draw_text(text: str, x: float, y: float) -> None:
    """Write white text with a shadow, in the size set by `blf.size`."""
    blf.color(0, 1, 1, 1, 1)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 3, 0, 0, 0, 1)
    blf.position(0, x, y, 0)
    blf.draw(0, text)
    blf.disable(0, blf.SHADOW)
