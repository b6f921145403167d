"""The truth of captures laid out like the demo: labels, true recolors, and each edit's color pair (numpy only)."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from karf_engine.io.color import srgb_to_linear

DEMO = Path(__file__).resolve().parents[2] / "demo"
SIDE = 256  # pixels to which larger pictures are reduced: what the preset `demo` learns, and what figures compare
CHANGED = 0.06  # a pixel takes part in an edit where the reference recolor differs by more, sRGB
PAINT_ANGLE = 15.0  # degrees at least between the changes of two paints in linear light
PAINT_SHARE = 0.1  # of the changed pixels at least, of each paint
ROUNDS = 20  # of 2-means


class Truth:
    """Ground truth of the capture in `folder`, at most SIDE pixels wide.

    Pictures are float [H, W, 3] in [0, 1]; labels int [H, W], 0 for no object.
    """

    def __init__(self, folder: Path = DEMO) -> None:
        self.folder = folder
        self.names: dict[str, int] = json.loads((self.folder / "labels" / "names.json").read_text())
        self.edits: dict[str, dict] = json.loads((self.folder / "edits.json").read_text())["edits"]

    @cache  # noqa: B019 (one instance a run)
    def labels(self, split: str) -> list[np.ndarray]:
        """Object ids of each view of a split, in the order of its names."""
        ids = np.array([0, *self.names.values()])
        # palette pictures: plain reading would give the palette's colors instead of the ids
        pictures = [iio.imread(path, mode="P") for path in sorted((self.folder / "labels" / split).glob("*.png"))]
        return [ids[reduced((labels[..., None] == ids).astype(float)).argmax(-1)] for labels in pictures]

    def masks(self, split: str) -> dict[str, list[np.ndarray]]:
        """The true masks of a split's views, object by object."""
        return {name: [labels == number for labels in self.labels(split)] for name, number in self.names.items()}

    def inside(self, edit: str, split: str = "test") -> list[np.ndarray]:
        """Where an edit's objects are in each view of a split, together."""
        masks = self.masks(split)
        return [np.any(views, 0) for views in zip(*(masks[name] for name in self.edits[edit]["objects"]), strict=True)]

    @cache  # noqa: B019
    def recolored(self, edit: str) -> list[np.ndarray]:
        """True recolors of the test views; of a matte capture over white, as renderings are."""
        return [_over_white(path) for path in sorted((self.folder / "recolor" / edit / "test").iterdir())]

    def color_pair(self, edit: str, object_name: str) -> tuple[np.ndarray, np.ndarray]:
        """Return an object's median color before and after, read in the one training view whose recolor is known.

        Of the pixels in the object's coarse mask whose paint really changes; of two paints the one that has more of them.
        [3] each, sRGB.
        """
        before, after = self._changed(edit, object_name)
        paint = _paints(srgb_to_linear(after) - srgb_to_linear(before))
        most = paint == np.bincount(paint).argmax()
        return np.median(before[most], 0), np.median(after[most], 0)

    def paint_pairs(self, edit: str, object_name: str) -> list[tuple[np.ndarray, np.ndarray]]:
        """A color pair for each of an object's paints, as one reads them who clicks on each paint; at most two.

        As `color_pair`, of each paint in that half of its pixels that changes most: there it fills the pixel and is lit.
        In linear light all pixels of a paint change in one direction, so two directions are two paints.
        """
        before, after = self._changed(edit, object_name)
        strength, paint = np.abs(after - before).max(-1), _paints(srgb_to_linear(after) - srgb_to_linear(before))
        pairs = []
        for number in np.argsort(-np.bincount(paint)):
            most = (paint == number) & (strength >= np.median(strength[paint == number]))
            pairs.append((np.median(before[most], 0), np.median(after[most], 0)))
        return pairs

    def _changed(self, edit: str, object_name: str) -> tuple[np.ndarray, np.ndarray]:
        """The reference photo and its recolor, [n, 3], where an object's rough mask changes; where none does, in all of it."""
        before, after = self.reference(edit)
        mask = self.coarse_mask(edit, object_name)
        changed = mask & (np.abs(after - before).max(-1) > CHANGED)
        where = changed if changed.any() else mask
        return before[where], after[where]

    def reference(self, edit: str) -> tuple[np.ndarray, np.ndarray]:
        """The one training photo whose true recolor is known, and that recolor."""
        name = f"{self.edits[edit]['reference_view']}.*"
        folders = self.folder / "train", self.folder / "recolor" / edit / "train"
        before, after = (_over_white(next(folder.glob(name))) for folder in folders)
        return before, after

    def coarse_mask(self, edit: str, object_name: str) -> np.ndarray:
        """The rough mask of an object in the edit's reference view, bool [H, W]."""
        view = self.edits[edit]["reference_view"]
        mask = iio.imread(self.folder / "coarse_masks" / "one" / object_name / f"{view}.png")
        return reduced(mask[..., None].astype(float))[..., 0] > 127

    def write_training_masks(self, folder: Path, count: int | None = None) -> Path:
        """The true masks of `count` training views, evenly chosen (default: all), as MASKS/<object>/<photo stem>.png;
        returns the folder."""
        paths = sorted((self.folder / "labels" / "train").glob("*.png"))
        for path in paths[:: len(paths) // (count or len(paths))][:count]:
            labels = iio.imread(path, mode="P")
            for name, number in self.names.items():
                if (labels == number).any():
                    target = folder / name / path.name
                    target.parent.mkdir(parents=True, exist_ok=True)
                    iio.imwrite(target, ((labels == number) * 255).astype(np.uint8))
        return folder


def _paints(changes: np.ndarray) -> np.ndarray:
    """Which of one or two paints each of n changes [n, 3] in linear light is of, int [n]: 2-means of their directions."""
    directions = changes / np.maximum(np.linalg.norm(changes, axis=1, keepdims=True), 1e-9)
    first = directions[(directions @ directions.mean(0)).argmin()]
    middles = np.stack([first, directions[(directions @ first).argmin()]])
    for _ in range(ROUNDS):
        paint = (directions @ middles.T).argmax(1)
        middles = np.stack([directions[paint == number].sum(0) for number in (0, 1)])
        middles /= np.maximum(np.linalg.norm(middles, axis=1, keepdims=True), 1e-9)
    apart = np.degrees(np.arccos(np.clip(middles[0] @ middles[1], -1, 1)))
    is_two = apart > PAINT_ANGLE and np.bincount(paint, minlength=2).min() > PAINT_SHARE * len(paint)
    return paint if is_two else np.zeros_like(paint)


def reduced(picture: np.ndarray) -> np.ndarray:
    """Return a picture [H, W, C] reduced by averaging blocks of pixels to at most SIDE pixels a side."""
    height, width, channels = picture.shape
    step = -(-max(height, width) // SIDE)
    return picture.reshape(height // step, step, width // step, step, channels).mean((1, 3))


def _over_white(path: Path) -> np.ndarray:
    picture = iio.imread(path) / 255
    alpha = picture[..., 3:] if picture.shape[-1] == 4 else 1.0
    return reduced(picture[..., :3] * alpha + 1 - alpha)
