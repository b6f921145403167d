"""Captures like the demo whose photos are darkened and tinted on purpose, and the truth of it."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from karf_engine.errors import BadRequest
from karf_engine.io.color import linear_to_srgb, srgb_to_linear, to_bytes
from karf_engine.io.files import write_json

DARKEST = -1.0  # exposure value at least; the brightest photo has 0, as light beyond white would be lost
TINT = 0.15  # of red, and of blue, at most
HELD_OUT_EVERY = 6
TOLD = 0.06, 0.94  # sRGB between which a pixel tells its photo's gain


def drawn_gains(count: int, seed: int) -> np.ndarray:
    """Factors [count, 3] of photos' linear light, drawn by chance: up to one stop darker, red and blue up to 15 % off."""
    random = np.random.default_rng(seed)
    brightness = 2.0 ** random.uniform(DARKEST, 0, count)
    tint = np.ones((count, 3))
    tint[:, [0, 2]] += random.uniform(-TINT, TINT, (count, 2))
    return brightness[:, None] * tint


class ExposedCapture:
    """A copy of a capture laid out like the demo, made in `folder`, whose photos and true recolors are exposed by `gains`.

    The photos whose true recolors are known are learned from, as an artist recolors photos that are learned from; some
    others are held out in their place.

    Attributes:
        folder: Where it is.
        gains: By photo, as `train/r_000` in the folder: factors [3] of its linear light.
        recolored: The stems of the photos with true recolors, in the order of `Truth.recolored`.
    """

    def __init__(self, source: Path, folder: Path, seed: int | None) -> None:
        """Make the copy anew. seed: of the gains; None: photos stay as they are. Raises BadRequest for photos with a matte."""
        shutil.rmtree(folder, ignore_errors=True)
        shutil.copytree(source, folder)
        self.folder = folder
        train, test = (sorted((folder / split).glob("*.png")) for split in ("train", "test"))
        self.recolored = [f"t_{path.stem}" for path in test]  # training and test photos share stems
        photos = [f"{path.parent.name}/{path.stem}" for path in (*train, *test)]
        drawn = np.ones((len(photos), 3)) if seed is None else drawn_gains(len(photos), seed)
        self.gains = dict(zip(photos, drawn, strict=True))
        for photo, gains in self.gains.items():
            for path in (folder / f"{photo}.png", *(folder / "recolor").glob(f"*/{photo}.png")):
                picture = iio.imread(path) / 255
                if picture.shape[-1] != len(gains):
                    raise BadRequest(f"{path} has a matte: such photos have no gains.", "Give another capture.")
                iio.imwrite(path, to_bytes(exposed(picture, gains)))
        for path, stem in zip(test, self.recolored, strict=True):
            shutil.copy(path, folder / "train" / f"{stem}.png")
            self.gains[f"train/{stem}"] = self.gains[f"test/{path.stem}"]
        self._swap_splits({path.stem for path in (folder / "coarse_masks").glob("*/*/*.png")})

    def _swap_splits(self, marked: set[str]) -> None:
        files = {split: self.folder / f"transforms_{split}.json" for split in ("train", "test")}
        told = {split: json.loads(path.read_text()) for split, path in files.items()}
        frames = told["train"]["frames"]
        held = [each for each in frames[::HELD_OUT_EVERY] if Path(each["file_path"]).stem not in marked]
        with_truth = [
            frame | {"file_path": f"./train/t_{Path(frame['file_path']).stem}"} for frame in told["test"]["frames"]
        ]
        learned = [each for each in frames if each not in held] + with_truth
        write_json(files["train"], told["train"] | {"frames": learned})
        write_json(files["test"], told["test"] | {"frames": held})

    def known_gains(self, source: Path) -> dict[str, list[float]]:
        """What `View.gains` would be if it were known, by the names of training views: in sRGB, with geometric mean 1.

        source: The capture with photos as they were.
        """
        frames = json.loads((self.folder / "transforms_train.json").read_text())["frames"]
        stems = [Path(frame["file_path"]).stem for frame in frames]
        logs = []
        for stem in stems:
            is_with_truth = stem in self.recolored
            before = source / ("test" if is_with_truth else "train") / f"{stem.removeprefix('t_')}.png"
            logs.append(_log_gains(iio.imread(before) / 255, iio.imread(self.folder / "train" / f"{stem}.png") / 255))
        gains = np.exp(np.array(logs) - np.mean(logs, 0))
        return {stem: own.tolist() for stem, own in zip(stems, gains, strict=True)}


def exposed(color: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """sRGB colors [..., 3] whose linear light is multiplied, clipped at white.

    Examples:
        >>> exposed(np.array([0.5, 0.5, 0.5]), np.array([0.5, 1.0, 8.0])).round(2).tolist()
        [0.36, 0.5, 1.0]
    """
    return linear_to_srgb(np.clip(srgb_to_linear(color) * gains, 0, 1))


def _log_gains(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Logarithms [3] of the sRGB gains between two exposures of one photo [H, W, 3]: medians of what tells them."""
    told = (np.minimum(before, after) > TOLD[0]) & (np.maximum(before, after) < TOLD[1])
    ratios = np.where(told, after, np.nan) / np.where(told, before, 1)
    return np.log(np.nanmedian(ratios.reshape(-1, 3), 0))
