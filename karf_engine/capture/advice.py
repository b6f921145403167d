"""Turn an inspection into advice: a predicted PSNR, one sentence for an artist, findings to fix, and a map of the cameras.

PSNR with preset `demo` is predicted by linear regression. The coefficients were fitted to 25 captures of 12 scenes by
`tools/scenes/inspections.py`; docs/benchmark.md has their accuracy on other scenes. All are in dB.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from ..errors import Message
from ..io.images import write_png
from .inspection import THIN, Inspection
from .placement import Placement

MOST_NAMED = 3  # photos listed in a sentence
POOR_PSNR = 26.5  # dB
MORE_PHOTOS = 10  # number of proposed photos
# thresholds of the findings
ODD_EXPOSURE = 0.3  # stops from the mean
TINTED = 0.2  # stops between color channels
REPROJECTION = 1.5  # pixels
POOR_PAIRS = 0.5  # share of pairs with few matches
SEEN_BY_FEW = 0.15  # share of the visible scene
THIN_SHARE = 0.2  # share of an object
# prediction, dB
INTERCEPT = 13.8
OF_AGREED = 24.5  # coefficient of the share of matches that agree with the cameras
OF_MATTE = 5.6  # coefficient of a matte
MOST_ABOVE_PLAINNESS = 4.0  # detail finer than voxels is not learned
RMS_ERROR = 2.8  # in leave-one-scene-out cross-validation
OF_SPACING = -6.3  # for each doubling of the angle to the nearest photo
NEAR_ANGLE = 4.0  # degrees; nearer photos gain nothing
# the map
SIDE, MARGIN, LINE, FONT_SIZE = 720, 60, 30, 19  # pixels
PAPER, INK, WANTED = (250, 250, 250), (40, 40, 40), (225, 95, 20)
NEAR_COLOR, FAR_COLOR = np.array([214, 234, 214]), np.array([240, 150, 140])  # of directions
FAR = 25.0  # degrees to the nearest camera, drawn in `FAR_COLOR`
CAMERA_RADIUS, DIRECTION_RADIUS, PROPOSAL_RADIUS = 5, 9, 14  # pixels


@dataclass(frozen=True)
class Advice:
    """Advice about a capture."""

    inspection: Inspection  # the figures behind it
    psnr: float  # predicted for new views with preset `demo`, dB
    error: float  # root mean square error of the prediction, dB
    gain: float  # predicted for photos from the proposed directions, dB
    is_poor: bool  # more photos are needed before training
    sentence: Message  # the main message
    findings: tuple[Message, ...]  # further problems
    proposed_directions: np.ndarray  # from the scene's center, where more photos would help most, [k, 3]

    def to_json(self) -> dict[str, Any]:
        """Return advice and figures as JSON values."""
        place = self.inspection.placement
        return {
            "psnr": round(self.psnr, 2),
            "psnr_error": self.error,
            "is_poor": self.is_poor,
            "sentence": self.sentence,
            "findings": list(self.findings),
            "more": {
                "gain": round(self.gain, 2),
                "positions": (place.center + place.radius * self.proposed_directions).round(6).tolist(),
                "look_at": place.center.round(6).tolist(),
            },
            "figures": self.inspection.to_json(),
        }


def advise(found: Inspection) -> Advice:
    """Derive the advice from an inspection."""
    placement = found.placement
    psnr = _predict_psnr(found.agreed, found.plainness, found.is_matte)
    improved = placement.extended(MORE_PHOTOS)
    doublings = math.log2(max(improved.spacing, NEAR_ANGLE) / max(placement.spacing, NEAR_ANGLE))
    gain = OF_SPACING * doublings + 0.0
    sentence, more = _main_message(found, psnr, gain), improved.directions[len(placement.directions) :]
    return Advice(found, psnr, RMS_ERROR, gain, psnr < POOR_PSNR, sentence, tuple(_findings(found)), more)


def _predict_psnr(agreed: float, plainness: float, is_matte: bool) -> float:
    """Predict the PSNR of held-out views, dB, from the figures of an `Inspection`."""
    on_line = INTERCEPT + OF_AGREED * agreed + OF_MATTE * is_matte
    return round(min(on_line, plainness + MOST_ABOVE_PLAINNESS), 3)


def _main_message(found: Inspection, psnr: float, gain: float) -> Message:
    figures = {
        "count": str(len(found.views)),
        "psnr": f"{psnr:.0f}",
        "more": str(MORE_PHOTOS),
        "gain": f"{gain:.1f}",
        "hole": f"{found.placement.hole[0]:.0f}",
        "where": _beside_hole(found),
    }
    if psnr < POOR_PSNR:
        return Message(
            "{count} photos are too few here: new views will be soft or foggy, about {psnr} dB. {more} more where the "
            "picture shows it would give about {gain} dB; the widest hole is {hole} degrees, {where}.",
            **figures,
        )
    return Message(
        "{count} photos: new views will have about {psnr} dB (give or take {error}). {more} more would give about {gain} dB; "
        "the widest hole is {hole} degrees, {where}.",
        error=f"{RMS_ERROR:.0f}",
        **figures,
    )


def _beside_hole(found: Inspection) -> Message:
    """Describe the location of the widest hole relative to the two nearest photos."""
    _, middle = found.placement.hole
    nearest = found.placement.beside_hole()
    first, second = (found.views[n] for n in nearest)
    elevations = found.placement.angles(found.placement.directions[nearest])[:, 1]
    higher = found.placement.angles(middle[None])[0, 1] - elevations
    if (higher > 5).all():
        return Message("above {first} and {second}", first=first, second=second)
    if (higher < -5).all():
        return Message("below {first} and {second}", first=first, second=second)
    return Message("between {first} and {second}", first=first, second=second)


def _findings(found: Inspection) -> Iterator[Message]:
    names = np.array([found.views[n] for n in found.opened])
    brightness = found.exposures.mean(1)
    tints = np.abs(found.exposures - brightness[:, None]).max(1)
    if found.blurred:
        yield Message(
            "Less sharp than the photos beside them: {names}. Take them again, or leave them out.",
            names=_listed(found.blurred),
        )
    odd = np.abs(brightness) > ODD_EXPOSURE
    if odd.any():
        yield Message(
            "Exposed otherwise than the rest, by up to {stops} stops: {names}. Lock the exposure.",
            stops=f"{np.abs(brightness).max():.1f}",
            names=_listed(_sorted(names[odd], -np.abs(brightness[odd]))),
        )
    tinted = tints > TINTED
    if tinted.any():
        yield Message(
            "Of another white balance than the rest: {names}. Lock the white balance.",
            names=_listed(_sorted(names[tinted], -tints[tinted])),
        )
    for profile, count in found.profiles.items():
        yield Message(
            "{count} photos are in {profile}: they are learned in sRGB, and recolored copies keep that profile.",
            count=str(count),
            profile=profile,
        )
    if found.reprojection > REPROJECTION:
        yield Message(
            "Photos and camera poses miss each other by {pixels} pixels: find the poses again.",
            pixels=f"{found.reprojection:.1f}",
        )
    if found.poor_pairs > POOR_PAIRS:
        yield Message(
            "{share} % of neighboring photos share too little to be compared: take more between them, of things with "
            "texture.",
            share=f"{100 * found.poor_pairs:.0f}",
        )
    if found.seen_by_few > SEEN_BY_FEW:
        yield Message(
            "{share} % of what the photos show is in one or two of them alone, and will be guesswork.",
            share=f"{100 * found.seen_by_few:.0f}",
        )
    for name, share in found.thin.items():
        if share > THIN_SHARE:
            yield Message(
                "{share} % of {name} is thinner than {pixels} pixels: parts of it may be lost. A larger preset, or photos "
                "from nearer, would show them.",
                share=f"{100 * share:.0f}",
                name=name,
                pixels=str(THIN),
            )


def _sorted(names: np.ndarray, order: np.ndarray) -> list[str]:
    return [str(name) for name in names[np.argsort(order)]]


def _listed(names: list[str]) -> str:
    """List the first names, and the number of the others."""
    more = f" (+{len(names) - MOST_NAMED})" if len(names) > MOST_NAMED else ""
    return ", ".join(names[:MOST_NAMED]) + more


# -------------------------------------------------------------------------------------------------------------- the map
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
