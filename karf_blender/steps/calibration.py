"""Step 6: under which light the photos were taken, by a color chart in one of them."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from ..engine_api import BadRequest, ChartFit, fit_photo, linear_to_srgb
from ..host import windows
from ..pictures import editors, images
from ..project import captures
from ..swatches import reference
from ..tasks import queries

KIND = "chart"


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
    reference.set_chart(scene, fit.light.matrix, fit.mean_residual)
    return fit


def find_chart(scene: bpy.types.Scene, image: bpy.types.Image) -> None:
    """Let the engine look for a color chart in the photo that a picture shows, and read the light off it as `pick_chart` does.

    Args:
        scene: The scene.
        image: As of `pick_chart`; one of KaRF's own stands for the active view's photo.

    Raises:
        BadRequest: The picture has no file.
        KarfError: The engine cannot be started; in background mode also: no chart is seen, or it tells nothing.
    """
    queries.send(scene, KIND, {"photo": str(_photo(scene, image))}, _take_light)


def _photo(scene: bpy.types.Scene, image: bpy.types.Image) -> Path:
    if image.name.startswith(editors.PREFIX):
        return captures.view_of(scene).image
    path = Path(bpy.path.abspath(image.filepath, library=image.library))
    if not image.filepath or not path.is_file():
        raise BadRequest("{name} has no file.", "Save it, or click the corners of the chart.", name=image.name)
    return path


def _take_light(scene: bpy.types.Scene, values: dict[str, Any]) -> None:
    reference.set_chart(scene, np.reshape(values["light"], (3, 3)), values["left"])
    if bpy.ops.ed.undo_push.poll():
        bpy.ops.ed.undo_push(message="Find Color Chart")
    windows.redraw(*windows.PANEL_AREAS)


def remove_chart(scene: bpy.types.Scene) -> None:
    """Forget the color chart: names are what photos show, or those of the gray card."""
    reference.forget_chart(scene)
