"""Recolors of the test photos by each rule, all by the same one color pair an object: pictures [H, W, 3] of each view."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import torch

from karf_engine.errors import BadRequest
from karf_engine.heads.rendering import ObjectSamples, object_samples
from karf_engine.recolor.field_rendering import photo_frame, weights_of_colors
from karf_engine.recolor.frames import Frame

from ...metrics.scores import hue_shifted
from ...metrics.truth import Truth
from ..judging import edit_to_judge
from ..views import TestViews
from .decomposition import Layers, Training, edited_palette, hull_palette, learn, recolored
from .points import ObjectPoints, points_of_objects
from .transfers import channel_gains
from .warping import Painted, carried_over

Pictures = list[np.ndarray]
Recolor = Callable[[str], Pictures]  # from an edit's name
Pairs = dict[str, tuple[np.ndarray, np.ndarray]]
PixelRule = Callable[[np.ndarray, dict[str, np.ndarray], Pairs], np.ndarray]  # photo, masks, color pairs -> picture


@dataclass(frozen=True)
class Recoloring:
    """The input of all rules.

    Attributes:
        test: The test views: photos, the field's masks and surface samples, our palette weights.
        truth: Of the capture; recolors of the test views are only judged by.
    """

    test: TestViews
    truth: Truth

    def pairs(self, edit: str) -> Pairs:
        """The color pair of each object of an edit, as read in its reference view."""
        return {name: self.truth.color_pair(edit, name) for name in self.truth.edits[edit]["objects"]}

    def unedited(self) -> Recolor:
        """The photos."""
        return lambda edit: [frame.base for frame in self.test.frames]

    def ours(self, frames: list[Frame]) -> Recolor:
        """Our palettes and solver with these frames' palette weights."""
        model = self.test.model

        def recolor(edit: str) -> Pictures:
            ours = edit_to_judge(model, self.truth, edit)
            return [model.composite(frame, ours) for frame in frames]

        return recolor

    def mattes(self) -> tuple[Recolor, list[np.ndarray]]:
        """As the render stage does, with borders of the photo instead of the field's; and these coverages."""
        model, long_side = self.test.model, self.test.model.settings.geometry.long_side
        frames = [model.preview(image.view, long_side) for image in self.test.training_images]
        return self.ours(frames), [frame.probabilities for frame in frames]

    def in_masks(self, masks: list[np.ndarray]) -> Recolor:
        """Ours in other masks: probabilities [K, H, W] of each view."""
        frames = []
        for frame, probabilities in zip(self.test.frames, masks, strict=True):
            weights = weights_of_colors(self.test.model, frame.base, probabilities)
            frames.append(Frame(frame.picture, probabilities, weights, frame.base))
        return self.ours(frames)

    def layers(self, rule: Callable[[ObjectPoints, np.ndarray], Layers], training: Training = Training()) -> Recolor:  # noqa: B008
        """A rule of layers, learned here for each object that is ever edited."""
        model, learned = self.test.model, {}
        for name in sorted({name for edit in self.truth.edits.values() for name in edit["objects"]}):
            torch.manual_seed(model.settings.seed)
            points = self.points[name]
            learned[name] = rule(points, hull_palette(points, model.settings.palette.tolerance))
            learn(learned[name], len(points), training, torch.Generator().manual_seed(model.settings.seed))

        def recolor(edit: str) -> Pictures:
            own, edited = {}, {}
            for name, pair in self.pairs(edit).items():
                number = model.objects.index(name)
                with suppress(BadRequest):  # paint that the reading shows black cannot be told: it stays
                    edited[number] = edited_palette(learned[name], self.points[name], *pair)
                    own[number] = learned[name]
            frames = zip(self.test.frames, self.samples, strict=True)
            return [recolored(frame, samples, own, edited) for frame, samples in frames]

        return recolor

    def of_pixels(self, rule: PixelRule) -> Recolor:
        """A rule of single pixels in the true masks."""

        def recolor(edit: str) -> Pictures:
            pairs, masks = self.pairs(edit), self.truth.masks("test")
            pictures = enumerate(self.test.frames)
            return [rule(frame.base, {name: masks[name][view] for name in pairs}, pairs) for view, frame in pictures]

        return recolor

    def hue(self) -> Recolor:
        """Hue rotation."""
        return self.of_pixels(hue_shifted)

    def gains(self) -> Recolor:
        """Gains of channels."""
        return self.of_pixels(channel_gains)

    def warped(self) -> Recolor:
        """The reference view's true recolor, carried over."""
        model = self.test.model

        def recolor(edit: str) -> Pictures:
            reference, objects = self._painted(edit), self.truth.edits[edit]["objects"]
            pictures = []
            for image, frame in zip(self.test.training_images, self.test.frames, strict=True):
                changes = [carried_over(reference, image.camera, frame, model.objects.index(name)) for name in objects]
                pictures.append(np.clip(frame.base + np.sum(changes, 0), 0, 1))
            return pictures

        return recolor

    def _painted(self, edit: str) -> Painted:
        model, name = self.test.model, self.truth.edits[edit]["reference_view"]
        view = next(view for view in model.capture.split("train") if view.stem == name)
        image = model.training_image(view)
        before, after = self.truth.reference(edit)
        return Painted(image.camera, photo_frame(model, image), after - before)

    @cached_property
    def points(self) -> dict[str, ObjectPoints]:
        """The training points of each object."""
        return points_of_objects(self.test.model)

    @cached_property
    def samples(self) -> list[ObjectSamples]:
        """Where the objects are along the rays of each test view."""
        model = self.test.model
        return [object_samples(model.segmentation, model.scene.field, f.picture.cache) for f in self.test.frames]
