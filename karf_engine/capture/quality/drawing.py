"""Draw a map of the cameras, of the directions without photos, and of proposed photos."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ...io.images import write_png
from .advice import Advice
from .placement import Placement

SIDE, MARGIN, LINE, FONT_SIZE = 720, 60, 30, 19  # pixels
PAPER, INK, WANTED = (250, 250, 250), (40, 40, 40), (225, 95, 20)
NEAR_COLOR, FAR_COLOR = np.array([214, 234, 214]), np.array([240, 150, 140])  # of directions
FAR = 25.0  # degrees to the nearest camera, drawn in `FAR_COLOR`
CAMERA_RADIUS, DIRECTION_RADIUS, PROPOSAL_RADIUS = 5, 9, 14  # pixels


def draw_map(path: Path, advice: Advice) -> None:
    """Write the map as PNG, atomically.

    A full capture is drawn from above, with the zenith at the center and the horizon at the rim; a capture of one side
    by azimuth and elevation, facing the scene.
    """
    inspection, place = advice.inspection, advice.inspection.placement
    everything = np.concatenate([place.directions, place.wanted, advice.proposed_directions])
    positions = _to_pixels(_flatten(place, everything))
    cameras, wanted, more = np.split(positions, np.cumsum([len(place.directions), len(place.wanted)]))
    canvas = Image.new("RGB", (SIDE, SIDE + 3 * LINE), PAPER)
    draw = ImageDraw.Draw(canvas)
    for position, angle in zip(wanted, place.nearest_angles, strict=True):
        weight = min(1.0, angle / max(1e-6, min(FAR, place.nearest_angles.max())))
        color = tuple((NEAR_COLOR + weight * (FAR_COLOR - NEAR_COLOR)).astype(int))
        _draw_disk(draw, position, DIRECTION_RADIUS, color)
    for position in cameras:
        _draw_disk(draw, position, CAMERA_RADIUS, INK)
    font = ImageFont.load_default(FONT_SIZE)
    for number, position in enumerate(more, 1):
        _draw_disk(draw, position, PROPOSAL_RADIUS, WANTED)
        draw.text(tuple(position), str(number), PAPER, font, anchor="mm")
    for number in place.beside_hole():
        label = inspection.views[number][:24]
        draw.text(tuple(cameras[number] + (CAMERA_RADIUS + 3, 0)), label, INK, font, anchor="lm")
    view = "Seen towards the scene: left, right, up and down" if place.is_open else "Seen from above: the rim is level"
    legend = "Dark: photos. Red: far from any photo. Orange: take more here, in this order."
    for number, text in enumerate((view, legend)):
        draw.text((MARGIN / 2, SIDE + LINE * number), text, INK, font)
    write_png(path, np.asarray(canvas))


def _flatten(place: Placement, directions: np.ndarray) -> np.ndarray:
    """Project directions [m, 3] to the map, x to the right and y up, [m, 2]."""
    azimuth, elevation = np.radians(place.angles(directions)).T
    if not place.is_open:
        return (np.pi / 2 - elevation)[:, None] * np.stack([np.cos(azimuth), np.sin(azimuth)], -1)
    middle = np.angle(np.exp(1j * np.radians(place.angles(place.wanted)[:, 0])).sum())
    relative = np.angle(np.exp(1j * (azimuth - middle)))
    return np.stack([relative * np.cos(elevation.mean()), elevation], -1)


def _to_pixels(flat: np.ndarray) -> np.ndarray:
    """Fit map positions [m, 2] into the canvas."""
    low, high = flat.min(0), flat.max(0)
    factor = (SIDE - 2 * MARGIN) / max(float((high - low).max()), 1e-6)
    return SIDE / 2 + (flat - (low + high) / 2) * factor * (1, -1)


def _draw_disk(draw: ImageDraw.ImageDraw, position: np.ndarray, radius: float, color: tuple[int, ...]) -> None:
    draw.ellipse((*(position - radius), *(position + radius)), color)
