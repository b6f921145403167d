"""Predict the color that an edit reaches, before rendering, and the reason for a miss.

The color reached is the source color plus the median change of the object's colors near it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..errors import BadRequest
from ..io.color import ciede2000, lab_to_srgb, srgb_to_lab
from .calibration import ReferenceLight
from .color_histogram import ColorHistogram
from .matching.becomes import is_near, match_becomes, mean_weights
from .palette import MAX_SRGB, Palette, rgb_to_hex

TOLERANCE = 2.0  # CIEDE2000 of a target color that counts as reached
SPREAD = 6.0  # of a paint's colors about its dominant one, in Lab
MAX_CANDIDATES = 256  # histogram cells tried as dominant color
FOREIGN = 10.0  # CIEDE2000 beyond which the object does not show the source color
BRIGHT = 0.95  # sRGB value beyond which better lit parts would exceed white
CHANNELS = "red", "green", "blue"
ROUNDING = 0.005  # tolerance of sRGB numbers and palette weights


@dataclass(frozen=True)
class TargetColor:
    """Target color of one object in a colorway."""

    name: str  # of the object
    lab: np.ndarray  # the target color, CIE L*a*b* [3]
    source: np.ndarray | None  # the object's color in the photos to be replaced, sRGB [3]; None for the dominant one
    where: str  # file and line, for messages


@dataclass(frozen=True)
class Prediction:
    """Predicted result of an edit for one target color."""

    target_color: TargetColor
    source: np.ndarray  # the object's color to be replaced, sRGB [3]
    colors: np.ndarray  # the object's edited palette [M, 3]
    reached: np.ndarray  # the source's new color, sRGB [3]
    ciede2000: float  # of the color reached to the target color
    reason: str  # why the target color is missed, to follow "because"; empty if it is reached

    @property
    def target(self) -> np.ndarray:
        """The target color clipped to the gamut, sRGB [3]."""
        return np.clip(lab_to_srgb(self.target_color.lab), 0, 1)

    def under_light(self, light: ReferenceLight | None) -> Prediction:
        """Convert the target color, the color reached and their difference to a reference light."""
        if light is None:
            return self
        lab, reached = light.lab_reference(self.target_color.lab), light.reference(self.reached)
        left = float(ciede2000(srgb_to_lab(reached), lab))
        return replace(self, target_color=replace(self.target_color, lab=lab), reached=reached, ciede2000=left)


def dominant_color(seen: ColorHistogram) -> np.ndarray:
    """Return the dominant color of an object, sRGB [3]: the mean about the densest of its colors in Lab."""
    lab = srgb_to_lab(seen.colors)
    candidates = np.argsort(seen.counts)[-MAX_CANDIDATES:]
    distance = np.linalg.norm(lab[candidates, None] - lab, axis=-1)
    density = np.exp(-0.5 * (distance / SPREAD) ** 2) * seen.counts
    return np.average(seen.colors, axis=0, weights=density[density.sum(axis=1).argmax()]).astype(np.float64)


def predict(
    target_color: TargetColor, palette: Palette, seen: ColorHistogram, locked: Iterable[int] = ()
) -> Prediction:
    """Solve for a target color, by `delta` compositing, and predict the color reached."""
    source = dominant_color(seen) if target_color.source is None else np.asarray(target_color.source, np.float64)
    target, reason = np.clip(lab_to_srgb(target_color.lab), 0, 1), ""
    try:
        colors = match_becomes(*seen, palette.colors, source, target, locked)
    except BadRequest as error:  # a source that is black
        colors, reason = palette.colors, error.sentence.rstrip(".")
    reached, difference, why = evaluate_edit(colors, palette.colors, seen, source, target_color.lab, locked)
    return Prediction(target_color, source, colors, reached, difference, reason if reason and why else why)


def evaluate_edit(
    edited: np.ndarray,  # palette [M, 3]
    start: np.ndarray,  # the palette [M, 3] before the edit; it may be an edited one, with colors beyond white
    seen: ColorHistogram,  # the object's colors with it
    source: np.ndarray,  # the color to be replaced, sRGB [3]
    wanted: np.ndarray,  # the target color, Lab [3]
    locked: Iterable[int] = (),  # swatches that stay
) -> tuple[np.ndarray, float, str]:
    """Return the color that an edit reaches, sRGB [3], its CIEDE2000, and the reason if that exceeds 2, or ""."""
    reached = reached_color(seen.colors, _moved(seen, start, edited), source, seen.counts)
    left = float(ciede2000(srgb_to_lab(reached), wanted))
    return reached, left, _reason(wanted, start, seen, source, tuple(locked)) if left > TOLERANCE else ""


def edited_colors(seen: ColorHistogram, palette: Palette, edited: np.ndarray) -> np.ndarray:
    """Return an object's colors [n, 3] after an edit of its palette, clipped as in pictures."""
    return _moved(seen, palette.colors, edited)


def _moved(seen: ColorHistogram, start: np.ndarray, edited: np.ndarray) -> np.ndarray:
    return np.clip(seen.colors + seen.palette_weights @ (edited - start), 0, 1)


def reached_color(
    before: np.ndarray, after: np.ndarray, source: np.ndarray, counts: np.ndarray | None = None
) -> np.ndarray:
    """Return a color, sRGB [3], plus the median change of the colors near it, sRGB [n, 3] with counts [n]."""
    nearby = is_near(before, source)
    change = np.subtract(after, before)[nearby]
    weight = np.ones(len(change)) if counts is None else counts[nearby].astype(np.float64)
    order = np.argsort(change, axis=0)
    share = np.cumsum(weight[order], axis=0)
    middle = (share >= share[-1] / 2).argmax(axis=0)
    return np.clip(source + np.take_along_axis(np.take_along_axis(change, order, 0), middle[None], 0)[0], 0, 1)


def reason_in_view(prediction: Prediction, reached: np.ndarray) -> str:
    """Return why one view misses a target color, from the color measured there; empty if it is reached."""
    if ciede2000(srgb_to_lab(reached), prediction.target_color.lab) <= TOLERANCE:
        return ""
    if prediction.reason:
        return prediction.reason
    for bound, is_at, kind in ((1, reached >= 1 - ROUNDING, "bright"), (0, reached <= ROUNDING, "dark")):
        clipped = is_at & (abs(prediction.target - bound) > ROUNDING)
        if clipped.any():
            names = " and ".join(name for name, each in zip(CHANNELS, clipped, strict=True) if each)
            return f"its {names} is as {kind} here as a picture can show"
    color = rgb_to_hex(prediction.reached)
    return f"the swatches move this color otherwise here than in all photos together, where it becomes {color}"


def _is_held(
    lab: np.ndarray, start: np.ndarray, seen: ColorHistogram, source: np.ndarray, locked: Iterable[int]
) -> bool:
    """Return whether the color would be reached without the locks."""
    try:
        free = match_becomes(*seen, start, source, np.clip(lab_to_srgb(lab), 0, 1))
    except BadRequest:  # a source that is black
        return False
    reached = reached_color(seen.colors, _moved(seen, start, free), source, seen.counts)
    return bool(ciede2000(srgb_to_lab(reached), lab) <= TOLERANCE)


def _reason(lab: np.ndarray, start: np.ndarray, seen: ColorHistogram, source: np.ndarray, locked: Iterable[int]) -> str:
    """Return the first applicable reason for missing a color."""
    wanted, color = lab_to_srgb(lab), rgb_to_hex(source)
    distance = ciede2000(srgb_to_lab(seen.colors), srgb_to_lab(source)).min()
    if distance > FOREIGN:
        return f"the object shows no color like {color}; the nearest differs by CIEDE2000 {distance:.0f}"
    if wanted.min() < -ROUNDING or wanted.max() > 1 + ROUNDING:
        return f"no sRGB picture can show it; the nearest that can be shown is {rgb_to_hex(wanted)}"
    weights = mean_weights(seen.colors, seen.counts, seen.palette_weights, source)
    free = np.setdiff1d(np.arange(len(weights)), [0, *locked])
    if weights[free].sum() < ROUNDING:
        return f"its color {color} is all of black or locked swatches, which stay as they are"
    held = [f"swatch {number}" for number in sorted(locked) if number and weights[number] > ROUNDING]
    if held and _is_held(lab, start, seen, source, locked):
        return f"locks hold it: without that of {' and '.join(held)} it would be reached"
    if (wanted > source + weights[free] @ (MAX_SRGB - start[free]) + ROUNDING).any():
        return (
            f"{100 * weights[0]:.0f} % of its color {color} are the palette's black: too little light falls there, "
            "even with swatches twice as bright as white"
        )
    if (wanted < source - weights[free] @ start[free] - ROUNDING).any():
        return f"locked swatches in its color {color} are brighter than this"
    if wanted.max() > BRIGHT:
        return "parts of the object that are better lit would be brighter than white"
    return "the swatches of this color make up other colors of the object too, which would suffer"
