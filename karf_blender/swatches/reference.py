"""The light of a scene beside the reference light of color books, by a gray card that was picked in a photo."""

import bpy
import numpy as np

from ..engine_api import BadRequest, ReferenceLight


def light(scene: bpy.types.Scene) -> ReferenceLight | None:
    """How the scene's light differs from daylight (D65); None where no card was picked, or one that tells nothing."""
    card = np.array(scene.karf.card)
    if not card.any():
        return None
    try:
        return ReferenceLight.of_card(card)
    except BadRequest:  # the panel says that the card is too dark or clipped
        return None


def as_named(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """A color of the photos, sRGB [3], as it is under the reference light, in [0, 1]; without a card itself."""
    known = light(scene)
    return np.clip(color if known is None else known.reference(color), 0, 1)


def as_photographed(scene: bpy.types.Scene, color: np.ndarray) -> np.ndarray:
    """A color of a book, sRGB [3] in [0, 1], as the photos would show it; without a card itself."""
    known = light(scene)
    return color if known is None else known.photographed(color)
