"""The light of a scene and the reference light of color books, by a color chart or a gray card in a photo."""

import bpy
import numpy as np

from ..engine_api import BadRequest, ReferenceLight


def light(scene: bpy.types.Scene) -> ReferenceLight | None:
    """Return how the scene's light differs from daylight (D65), by its chart, else by its card; None without both."""
    if has_chart(scene):
        return ReferenceLight(np.reshape(scene.karf.chart, (3, 3)).astype(np.float64))
    card = np.array(scene.karf.card)
    if not card.any():
        return None
    try:
        return ReferenceLight.of_card(card)
    except BadRequest:  # the panel says that the card is too dark or clipped
        return None


def has_chart(scene: bpy.types.Scene) -> bool:
    """Tell whether a color chart was picked."""
    return any(scene.karf.chart)


def set_chart(scene: bpy.types.Scene, matrix: np.ndarray, left: float) -> None:
    """Remember the light by a color chart: a matrix [3, 3], and the mean CIEDE2000 that it leaves."""
    scene.karf.chart = np.ravel(matrix)
    scene.karf.chart_left = left


def forget_chart(scene: bpy.types.Scene) -> None:
    """Forget the color chart: names are what photos show, or those of the gray card."""
    scene.karf.chart = np.zeros(9)
    scene.karf.chart_left = 0


def as_named(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """Return a color of the photos, sRGB [3], under the reference light, in [0, 1]; the same without card and chart."""
    known = light(scene)
    return np.clip(color if known is None else known.reference(color), 0, 1)


def as_photographed(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """Return a color of a book, sRGB [3] in [0, 1], as the photos would show it; the same without card and chart."""
    known = light(scene)
    return color if known is None else known.photographed(color)
