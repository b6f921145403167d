"""One picture of what to shoot more: the cameras as seen from above, the directions they leave out, and where to go."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ...io.images import write_png
from .advice import Advice
from .inspection import Inspection
from .placement import Placement

SIDE, MARGIN, LINE, LETTERS = 720, 60, 30, 19  # pixels: an editor may show the map at half its size
PAPER, INK, WANTED = (250, 250, 250), (40, 40, 40), (225, 95, 20)
NEAR_COLOR, FAR_COLOR = np.array([214, 234, 214]), np.array([240, 150, 140])  # of directions, by the nearest camera
FAR = 25.0  # degrees to the nearest camera that are shown as far
DOT, SPOT, RING = 5, 9, 14  # pixels: radii of a camera, of a direction, of a proposed place


def draw_map(path: Path, advice: Advice) -> None:
    """Write the map, as PNG, atomically.

    All round, the middle is straight above the scene and the rim is level with it; a capture of one side is drawn as
    azimuth and elevation, as its cameras stand when one looks at the scene between them.
    """
    found, place = advice.inspection, advice.inspection.placement
    everything = np.concatenate([place.directions, place.wanted, advice.more])
    spots = _scaled(_flat(place, everything))
    cameras, wanted, more = np.split(spots, np.cumsum([len(place.directions), len(place.wanted)]))
    canvas = Image.new("RGB", (SIDE, SIDE + 3 * LINE), PAPER)
    draw = ImageDraw.Draw(canvas)
    for spot, angle in zip(wanted, place.empty, strict=True):
        share = min(1.0, angle / max(1e-6, min(FAR, place.empty.max())))
        _disk(draw, spot, SPOT, tuple((NEAR_COLOR + share * (FAR_COLOR - NEAR_COLOR)).astype(int)))
    for spot in cameras:
        _disk(draw, spot, DOT, INK)
    font = ImageFont.load_default(LETTERS)
    for number, spot in enumerate(more, 1):
        _disk(draw, spot, RING, WANTED)
        draw.text(tuple(spot), str(number), PAPER, font, anchor="mm")
    _name_neighbors(draw, found, cameras, font)
    seen = "Seen towards the scene: left, right, up and down" if place.is_open else "Seen from above: the rim is level"
    for number, text in enumerate(
        (seen, "Dark: photos. Red: far from any photo. Orange: take more here, in this order.")
    ):
        draw.text((MARGIN / 2, SIDE + LINE * number), text, INK, font)
    write_png(path, np.asarray(canvas))


def _flat(place: Placement, directions: np.ndarray) -> np.ndarray:
    """Directions [m, 3] on paper, x to the right and y up, [m, 2]."""
    azimuth, elevation = np.radians(place.angles(directions)).T
    if not place.is_open:
        return (np.pi / 2 - elevation)[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    middle = np.angle(np.exp(1j * np.radians(place.angles(place.wanted)[:, 0])).sum())
    turned = np.angle(np.exp(1j * (azimuth - middle)))
    return np.stack([turned * np.cos(elevation.mean()), elevation], -1)


def _scaled(flat: np.ndarray) -> np.ndarray:
    """Places on paper as pixels, [m, 2]."""
    low, high = flat.min(0), flat.max(0)
    factor = (SIDE - 2 * MARGIN) / max(float((high - low).max()), 1e-6)
    return SIDE / 2 + (flat - (low + high) / 2) * factor * (1, -1)


def _disk(draw: ImageDraw.ImageDraw, spot: np.ndarray, radius: float, color: tuple[int, ...]) -> None:
    draw.ellipse((*(spot - radius), *(spot + radius)), color)


def _name_neighbors(
    draw: ImageDraw.ImageDraw, found: Inspection, cameras: np.ndarray, font: ImageFont.FreeTypeFont
) -> None:
    """The names of the two photos beside the widest hole, as the sentence has them."""
    for number in found.placement.beside_hole():
        draw.text(tuple(cameras[number] + (DOT + 3, 0)), found.views[number][:24], INK, font, anchor="lm")
