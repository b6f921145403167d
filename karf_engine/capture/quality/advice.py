"""Turn an inspection into advice: one sentence for an artist, and findings to fix."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import Message
from .inspection import Inspection
from .photos import THIN
from .prediction import RMS_ERROR, predict_psnr, psnr_gain

MOST_NAMED = 3  # photos listed in a sentence
POOR_PSNR = 26.5  # dB
MORE_PHOTOS = 10  # number of proposed photos
# thresholds of the findings
BLURRED = 0.65  # sharpness relative to neighboring photos
ODD_EXPOSURE = 0.3  # stops from the mean
TINTED = 0.2  # stops between color channels
REPROJECTION = 1.5  # pixels
POOR_PAIRS = 0.5  # share of pairs with few matches
SEEN_BY_FEW = 0.15  # share of the visible scene
THIN_SHARE = 0.2  # share of an object


@dataclass(frozen=True)
class Advice:
    """Advice about a capture.

    Attributes:
        inspection: The figures behind it.
        psnr: Predicted PSNR of new views with preset `demo`, dB.
        error: Root mean square error of the prediction, dB.
        gain: Predicted gain of `more` photos, dB.
        is_poor: Whether more photos are needed before training.
        sentence: The main message.
        findings: Further problems.
        more: Directions from the scene's center where more photos would help most, [k, 3].
    """

    inspection: Inspection
    psnr: float
    error: float
    gain: float
    is_poor: bool
    sentence: Message
    findings: tuple[Message, ...]
    proposed_directions: np.ndarray

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
    psnr = predict_psnr(found.agreed, found.plainness, found.is_matte)
    more = placement.propose_directions(MORE_PHOTOS)
    improved = placement
    for direction in more:
        improved = improved.with_camera(direction)
    gain = psnr_gain(placement.spacing, improved.spacing)
    is_poor = psnr < POOR_PSNR
    sentence = _too_few(found, psnr, gain) if is_poor else _enough(found, psnr, gain)
    return Advice(found, psnr, RMS_ERROR, gain, is_poor, sentence, tuple(_findings(found)), more)


def _too_few(found: Inspection, psnr: float, gain: float) -> Message:
    return Message(
        "{count} photos are too few here: new views will be soft or foggy, about {psnr} dB. {more} more where the picture "
        "shows it would give about {gain} dB; the widest hole is {hole} degrees, {where}.",
        **_figures(found, psnr, gain),
    )


def _enough(found: Inspection, psnr: float, gain: float) -> Message:
    return Message(
        "{count} photos: new views will have about {psnr} dB (give or take {error}). {more} more would give about {gain} dB; "
        "the widest hole is {hole} degrees, {where}.",
        error=f"{RMS_ERROR:.0f}",
        **_figures(found, psnr, gain),
    )


def _figures(found: Inspection, psnr: float, gain: float) -> dict[str, str | Message]:
    width, _ = found.placement.hole
    return {
        "count": str(len(found.views)),
        "psnr": f"{psnr:.0f}",
        "more": str(MORE_PHOTOS),
        "gain": f"{gain:.1f}",
        "hole": f"{width:.0f}",
        "where": _beside_hole(found),
    }


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
    blurred = found.sharpness < BLURRED
    if blurred.any():
        yield Message(
            "Less sharp than the photos beside them: {names}. Take them again, or leave them out.",
            names=_listed(names[blurred], found.sharpness[blurred]),
        )
    odd = np.abs(brightness) > ODD_EXPOSURE
    if odd.any():
        yield Message(
            "Exposed otherwise than the rest, by up to {stops} stops: {names}. Lock the exposure.",
            stops=f"{np.abs(brightness).max():.1f}",
            names=_listed(names[odd], -np.abs(brightness[odd])),
        )
    tinted = tints > TINTED
    if tinted.any():
        yield Message(
            "Of another white balance than the rest: {names}. Lock the white balance.",
            names=_listed(names[tinted], -tints[tinted]),
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


def _listed(names: np.ndarray, order: np.ndarray) -> str:
    """List the names with the smallest values, and the number of the others."""
    worst = [str(name) for name in names[np.argsort(order)]]
    more = f" (+{len(worst) - MOST_NAMED})" if len(worst) > MOST_NAMED else ""
    return ", ".join(worst[:MOST_NAMED]) + more
