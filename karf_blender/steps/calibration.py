"""Step 6: under which light the photos were taken, by a color chart in one of them."""

from collections.abc import Sequence

import bpy
import numpy as np

from ..engine_api import BadRequest, ChartFit, fit_photo, linear_to_srgb
from ..pictures import images
from ..swatches import reference


def pick_chart(scene: bpy.types.Scene, image: bpy.types.Image, corners: Sequence[tuple[float, float]]) -> ChartFit:
    """Read the light off a color chart of 24 patches (ColorChecker Classic) that a picture shows.

    Names, numbers and sheets of colorways are then those under daylight, as by a gray card, whose place it takes.

    Args:
        scene: The scene.
        image: A photo that is exposed and lit as those of the capture.
        corners: Of its block of patches, round it: where in the picture, from its lower left corner to its upper right one,
            0 to 1.

    Raises:
        BadRequest: No chart is there, or it is too dark or too bright.
    """
    if not image.size[0]:
        raise BadRequest("{name} shows no picture.", "Open the photo of the chart.", name=image.name)
    pixels = images.pixels(image)[..., :3].astype(np.float64)
    photo = linear_to_srgb(pixels) if image.is_float else pixels
    across, up = np.transpose(corners)
    fit = fit_photo(np.clip(photo, 0, 1), np.stack([across * image.size[0], (1 - up) * image.size[1]], axis=-1))
    reference.set_chart(scene, fit)
    return fit


def remove_chart(scene: bpy.types.Scene) -> None:
    """Forget the color chart: names are what photos show, or those of the gray card."""
    reference.set_chart(scene, None)
