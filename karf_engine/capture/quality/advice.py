"""What an inspection means: a sentence that an artist understands, and what else to mend, as messages."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import Message
from .inspection import Inspection
from .photos import THIN
from .prediction import LINE

MOST_NAMED = 3  # photos of one sentence


@dataclass(frozen=True)
class Bounds:
    """From when on something is said. Chosen on the demo and on drawn captures 0 to 7, of which none shall be scolded
    for what it learned well with.

    Attributes:
        poor: dB of prediction below which more photos are asked for.
        more: How many are proposed.
        blurred: Sharpness against neighbors.
        stops: Brightness against the mean.
        tint: Difference between a photo's channels, stops.
        reprojection: Pixels.
        poor_pairs: Share of pairs that share next to nothing.
        few: Share of what photos show that one or two show.
        thin: Share of an object.
    """

    poor: float = 26.5
    more: int = 10
    blurred: float = 0.65
    stops: float = 0.3
    tint: float = 0.2
    reprojection: float = 1.5
    poor_pairs: float = 0.5
    few: float = 0.15
    thin: float = 0.2


BOUNDS = Bounds()


@dataclass(frozen=True)
class Advice:
    """What to do about a capture.

    Attributes:
        inspection: What it was told by.
        psnr: Predicted for new views of preset `demo`, dB.
        error: Of the prediction, dB, root mean square.
        gain: dB that `more` photos would bring.
        is_poor: Whether it should not be learned as it is.
        sentence: The one to read.
        findings: What else there is to mend.
        more: Directions from the scene's middle at which more photos would help most, [k, 3].
    """

    inspection: Inspection
    psnr: float
    error: float
    gain: float
    is_poor: bool
    sentence: Message
    findings: tuple[Message, ...]
    more: np.ndarray

    def to_json(self) -> dict[str, Any]:
        """Advice and figures as JSON values."""
        place = self.inspection.placement
        return {
            "psnr": round(self.psnr, 2),
            "psnr_error": self.error,
            "is_poor": self.is_poor,
            "sentence": self.sentence,
            "findings": list(self.findings),
            "more": {
                "gain": round(self.gain, 2),
                "positions": (place.center + place.radius * self.more).round(6).tolist(),
                "look_at": place.center.round(6).tolist(),
            },
            "figures": self.inspection.to_json(),
        }


def advise(found: Inspection) -> Advice:
    """What an inspection means."""
    placement = found.placement
    psnr = LINE.psnr(found.agreed, found.plainness, found.is_matte)
    more = placement.more(BOUNDS.more)
    then = placement
    for direction in more:
        then = then.and_at(direction)
    gain = LINE.gain(placement.spacing, then.spacing)
    is_poor = psnr < BOUNDS.poor
    sentence = _too_few(found, psnr, gain) if is_poor else _enough(found, psnr, gain)
    return Advice(found, psnr, LINE.error, gain, is_poor, sentence, tuple(_findings(found)), more)


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
        error=f"{LINE.error:.0f}",
        **_figures(found, psnr, gain),
    )


def _figures(found: Inspection, psnr: float, gain: float) -> dict[str, str | Message]:
    width, _ = found.placement.hole
    return {
        "count": str(len(found.views)),
        "psnr": f"{psnr:.0f}",
        "more": str(BOUNDS.more),
        "gain": f"{gain:.1f}",
        "hole": f"{width:.0f}",
        "where": _beside_hole(found),
    }


def _beside_hole(found: Inspection) -> Message:
    """Where the widest hole is: between the two photos next to it, above or below them."""
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
    blurred = found.sharpness < BOUNDS.blurred
    if blurred.any():
        yield Message(
            "Less sharp than the photos beside them: {names}. Take them again, or leave them out.",
            names=_listed(names[blurred], found.sharpness[blurred]),
        )
    if (np.abs(brightness) > BOUNDS.stops).any():
        odd = np.abs(brightness) > BOUNDS.stops
        yield Message(
            "Exposed otherwise than the rest, by up to {stops} stops: {names}. Lock the exposure.",
            stops=f"{np.abs(brightness).max():.1f}",
            names=_listed(names[odd], -np.abs(brightness[odd])),
        )
    if (tints > BOUNDS.tint).any():
        yield Message(
            "Of another white balance than the rest: {names}. Lock the white balance.",
            names=_listed(names[tints > BOUNDS.tint], -tints[tints > BOUNDS.tint]),
        )
    if found.reprojection > BOUNDS.reprojection:
        yield Message(
            "Photos and camera poses miss each other by {pixels} pixels: find the poses again.",
            pixels=f"{found.reprojection:.1f}",
        )
    if found.poor_pairs > BOUNDS.poor_pairs:
        yield Message(
            "{share} % of neighboring photos share too little to be compared: take more between them, of things with "
            "texture.",
            share=f"{100 * found.poor_pairs:.0f}",
        )
    if found.seen_by_few > BOUNDS.few:
        yield Message(
            "{share} % of what the photos show is in one or two of them alone, and will be guesswork.",
            share=f"{100 * found.seen_by_few:.0f}",
        )
    for name, share in found.thin.items():
        if share > BOUNDS.thin:
            yield Message(
                "{share} % of {name} is thinner than {pixels} pixels: parts of it may be lost. A larger preset, or photos "
                "from nearer, would show them.",
                share=f"{100 * share:.0f}",
                name=name,
                pixels=str(THIN),
            )


def _listed(names: np.ndarray, order: np.ndarray) -> str:
    """The worst few names, those of the least values first, and how many others there are."""
    worst = [str(name) for name in names[np.argsort(order)]]
    more = f" (+{len(worst) - MOST_NAMED})" if len(worst) > MOST_NAMED else ""
    return ", ".join(worst[:MOST_NAMED]) + more
