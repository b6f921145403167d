"""Ways to recolor the demo's test views: ours with its parts exchanged, and what one would do without us.

A way is a function from an edit's name to the recolored test views.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from karf_engine.palettes.compositing import delta_composite, paper_composite
from karf_engine.recolor.field_rendering import weights_of_colors
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

from ..metrics.scores import hue_shifted
from .demo import Demo
from .views import TestViews

Recolor = Callable[[str], list[np.ndarray]]  # from an edit's name to the recolored test views


def on_photo(model: Model, frame: Frame) -> Frame:
    """The frame with palette weights from its base's own colors, as captured views are recolored."""
    weights = weights_of_colors(model, frame.base, frame.probabilities)
    return Frame(frame.picture, frame.probabilities, weights, frame.base)


def on_render(frame: Frame) -> Frame:
    """The frame with its rendering as base, as new cameras are recolored."""
    return Frame(frame.picture, frame.probabilities, frame.palette_weights, frame.color)


def with_masks(model: Model, frame: Frame, masks: np.ndarray) -> Frame:
    """Return the frame with these masks [K, H, W] instead of its probabilities, and weights from its base's colors."""
    probabilities = masks.astype(np.float32)
    weights = weights_of_colors(model, frame.base, probabilities)
    return Frame(frame.picture, probabilities, weights, frame.base)


def composed(model: Model, frame: Frame, edited: np.ndarray, compositing: str) -> np.ndarray:
    """The frame's base with edited palettes, by `delta` or `paper` compositing; the latter only where one is edited."""
    if compositing == "delta":
        return delta_composite(frame.base, frame.palette_weights, model.learned_colors, edited)
    replaced = paper_composite(frame.base, frame.palette_weights, frame.probabilities, edited)
    changed = (edited != model.learned_colors).any((1, 2))
    return np.where(frame.masks[changed].any(0)[..., None], replaced, frame.base)


def projected(demo: Demo, test: TestViews, source: str, compositing: str = "delta") -> Recolor:
    """Recolors by a project. source: weights of the photo, of F_w (`field`), or both base and weights rendered."""
    prepare = {"photo": lambda f: on_photo(test.model, f), "field": lambda f: f, "render": on_render}[source]

    def recolor(edit: str) -> list[np.ndarray]:
        edited = demo.edited(test.model, edit)
        return [composed(test.model, prepare(frame), edited, compositing) for frame in test.frames]

    return recolor


def in_mattes(demo: Demo) -> Recolor:
    """Recolors as the render stage makes them: in mattes, with weights from the photo's colors."""
    test = demo.shipped()
    return lambda edit: [composed(test.model, frame, demo.edited(test.model, edit), "delta") for frame in test.frames]


def true_masks_of(demo: Demo, model: Model) -> list[np.ndarray]:
    """The true masks of each test view, [K, H, W]."""
    truth = demo.truth.masks("test")
    return [np.stack(views) for views in zip(*(truth[name] for name in model.objects), strict=True)]


def masked_recolor(demo: Demo, masks: list[np.ndarray]) -> Recolor:
    """Our palettes and weights of the photo, in these masks."""
    test = demo.ours()

    def recolor(edit: str) -> list[np.ndarray]:
        edited = demo.edited(test.model, edit)
        frames = [with_masks(test.model, frame, mask) for frame, mask in zip(test.frames, masks, strict=True)]
        return [composed(test.model, frame, edited, "delta") for frame in frames]

    return recolor


def masked_hue_shift(demo: Demo, masks: list[np.ndarray]) -> Recolor:
    """Each object's own hue shift inside masks [K, H, W] of each view."""
    objects = demo.ours().model.objects

    def recolor(edit: str) -> list[np.ndarray]:
        pairs = demo.pairs(edit)
        chosen = [{name: mask[objects.index(name)] for name in pairs} for mask in masks]
        return [hue_shifted(photo, own, pairs) for photo, own in zip(demo.photos(), chosen, strict=True)]

    return recolor
