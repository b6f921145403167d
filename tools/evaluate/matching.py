"""Swatches matched to the true recolor of one test view, judged on the others.

Beside them: *Becomes* with one color pair an object, an added color with the same pair, and the bound, the swatches that
fit the true recolors of all test views best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from karf_engine.metrics.images import mean_ciede2000
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.matching.fitting import bounded_least_squares, bounds
from karf_engine.palettes.matching.painted import match_picture
from karf_engine.palettes.palette import MAX_SRGB
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from ..metrics.truth import Truth
from .judging import edit_to_judge


@dataclass(frozen=True)
class MatchScore:
    """CIEDE2000 in the edited objects of the test views, means over views.

    Attributes:
        no_edit: Of the photos.
        becomes: By one color pair an object.
        added: By an added color an object, with the same pair.
        others: Matched to one view, in the others: mean over the views given.
        worst: The same for the worst view to give.
        given: Matched to one view, in that view.
        bound: By the swatches that fit the true recolors of all views best, in sRGB.
    """

    no_edit: float
    becomes: float
    added: float
    others: float
    worst: float
    given: float
    bound: float


def score_matches(model: Model, truth: Truth) -> dict[str, MatchScore]:
    """The score of each edit."""
    frames = [model.preview(view) for view in model.capture.split("test")]
    return {edit: _score_edit(model, truth, frames, edit) for edit in truth.edits}


def _score_edit(model: Model, truth: Truth, frames: list[Frame], edit: str) -> MatchScore:
    recolored, insides = truth.recolored(edit), truth.inside(edit)
    seen = [number for number, inside in enumerate(insides) if inside.any()]
    learned = model.learned_colors

    def differences_of(pictures: list[np.ndarray]) -> np.ndarray:
        return np.array([mean_ciede2000(p, recolored[v], insides[v]) for p, v in zip(pictures, seen, strict=True)])

    def differences(edited: np.ndarray) -> np.ndarray:
        return differences_of(
            [delta_composite(frames[view].base, frames[view].palette_weights, learned, edited) for view in seen]
        )

    given, others = [], []
    for place, view in enumerate(seen):
        of_views = differences(_matched(model, frames[view], recolored[view]))
        given.append(of_views[place])
        others.append(np.delete(of_views, place).mean())
    added = model.edit()
    for name in truth.edits[edit]["objects"]:
        added = added.add_color(name, *truth.color_pair(edit, name))
    return MatchScore(
        no_edit=float(differences(learned).mean()),
        becomes=float(differences(stack_palettes(model.objects, edit_to_judge(model, truth, edit).colors)).mean()),
        added=float(differences_of([model.composite(frames[view], added) for view in seen]).mean()),
        others=float(np.mean(others)),
        worst=float(np.max(others)),
        given=float(np.mean(given)),
        bound=float(differences(_best(model, truth, frames, edit)).mean()),
    )


def _matched(model: Model, frame: Frame, wanted: np.ndarray) -> np.ndarray:
    """The palettes [K, M, 3] matched to a picture of a view."""
    colors = {palette.name: palette.colors for palette in model.palettes}
    found = match_picture(frame.palette_weights, frame.probabilities, frame.base, wanted, model.palettes, colors)
    return stack_palettes(model.objects, colors | {match.name: match.colors for match in found})


def _best(model: Model, truth: Truth, frames: list[Frame], edit: str) -> np.ndarray:
    """The palettes [K, M, 3] with the least squared difference to the true recolors of all test views."""
    learned = model.learned_colors
    edited = [name in truth.edits[edit]["objects"] for name in model.objects]
    samples = zip(frames, truth.recolored(edit), truth.inside(edit), strict=True)
    parts = [(frame.palette_weights[edited][..., i], (true - frame.base)[i]) for frame, true, i in samples]
    weights = np.concatenate([part.reshape(-1, part.shape[-1]).T for part, _ in parts])
    palettes = learned[edited].reshape(-1, 3)
    lower, upper = bounds(palettes, range(0, len(palettes), learned.shape[1]), MAX_SRGB)
    change = bounded_least_squares(weights, np.concatenate([wanted for _, wanted in parts]), lower, upper)
    best = learned.copy()
    best[edited] += change.reshape(-1, *learned.shape[1:])
    return best
