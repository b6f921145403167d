"""Rough masks as a hasty hand draws them, made from the true labels."""

from __future__ import annotations

import math
from itertools import product
from pathlib import Path

import imageio.v3 as iio
import numpy as np

from .cameras import View
from .files import write_mask

IOU_RANGE = (0.77, 0.88)
# of the errors: large objects need larger ones to come into that range, thin ones smaller
STRENGTHS = (1.0, 1.5, 2.0, 3.0, 4.0, 0.7, 0.5, 0.35, 0.25)


def read_truth(out: Path, view: View) -> np.ndarray:
    """Return the label image of a view, (H, W) uint8."""
    return iio.imread(out / "labels" / view.split / f"{view.stem}.png", mode="P")


def visible_shares(out: Path, views: list[View], names: dict[str, int]) -> np.ndarray:
    """Return each object's pixels in each view over its most in any view, (views, objects) in [0, 1]."""
    counts = np.array([[(truth == k).sum() for k in names.values()] for truth in (read_truth(out, v) for v in views)])
    return counts / counts.max(0)


def reference_view(out: Path, views: list[View], names: dict[str, int]) -> View:
    """Return the training view in which the least visible of the objects with masks is most visible."""
    train = [view for view in views if view.split == "train"]
    return train[int(visible_shares(out, train, names).min(1).argmax())]


def views_to_mask(out: Path, views: list[View], names: dict[str, int], column: int) -> list[View]:
    """Return the reference view and two more training views that show object ``column`` well from far-apart sides."""
    train = [view for view in views if view.split == "train"]
    shares = visible_shares(out, train, names)[:, column]
    sides = np.array([view.camera_to_world.col[2][:3] for view in train])
    chosen = [train.index(reference_view(out, views, names))]
    for _ in range(2):
        closest = (sides @ sides[chosen].T).max(1)
        chosen.append(int(np.where(shares >= 0.6, closest, np.inf).argmin()))
    return [train[index] for index in chosen]


def signed_distance(mask: np.ndarray) -> np.ndarray:
    """Return the distance in pixels to the border of ``mask`` (H, W), positive inside, by brute force."""
    padded = np.pad(mask, 1)
    inner = mask & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    border = np.argwhere(mask & ~inner)
    best = np.full(mask.shape, np.inf)
    rows, columns = np.indices(mask.shape)
    for row, column in border:
        np.minimum(best, (rows - row) ** 2 + (columns - column) ** 2, out=best)
    return np.where(mask, np.sqrt(best) + 0.5, 0.5 - np.sqrt(best))


def smooth_noise(rng: np.random.Generator, size: int, cell: int) -> np.ndarray:
    """Return noise (size, size) of unit deviation that varies over ``cell`` pixels."""
    knots = rng.standard_normal((size // cell + 3, size // cell + 3))
    at = np.arange(size) / cell
    whole = at.astype(int)
    part = 0.5 - 0.5 * np.cos(np.pi * (at - whole))
    rows = knots[whole] * (1 - part)[:, None] + knots[whole + 1] * part[:, None]
    noise = rows[:, whole] * (1 - part) + rows[:, whole + 1] * part
    return noise / noise.std()


def coarse_mask(distance: np.ndarray, rng: np.random.Generator, flaw: str, strength: float) -> np.ndarray:
    """Return a blobby hand-drawn mask from a signed ``distance`` (H, W): its border moved by smooth noise.

    The noise is about 3 px times ``strength`` in an image of 256 px, and in proportion in others.

    ``flaw`` is "spill" (a disk added across the border), "gap" (a disk cut out at the border) or "none".
    """
    pixel = len(distance) / 256
    noise = 2.6 * smooth_noise(rng, len(distance), round(12 * pixel)) + rng.uniform(-0.5, 1.5)
    drawn = distance + strength * pixel * noise
    if flaw != "none":
        rim = np.argwhere(np.abs(distance) < 1.0)
        row, column = rim[rng.integers(len(rim))]
        rows, columns = np.indices(distance.shape)
        disk = 4.0 * pixel + 0.18 * math.sqrt((distance > 0).sum()) - np.hypot(rows - row, columns - column)
        drawn = np.maximum(drawn, disk) if flaw == "spill" else np.minimum(drawn, -disk)
    return drawn > 0.0


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    """Return the intersection over union of two boolean masks."""
    return float((a & b).sum() / (a | b).sum())


def flaw_area(mask: np.ndarray, distance: np.ndarray, others: np.ndarray, flaw: str) -> float:
    """Return the area of the flaw over the object's: ``others`` covered by a spill, or inner pixels lost."""
    wrong = mask & others if flaw == "spill" else ~mask & (distance > 5.0 * len(mask) / 256)
    return float(wrong.sum() / (distance > 0).sum())


def draw_mask(labels: np.ndarray, object_id: int, flaw: str, seed: int) -> np.ndarray:
    """Return the first coarse mask, over strengths and seeds, whose IoU is in ``IOU_RANGE`` and whose flaw shows."""
    truth = labels == object_id
    distance = signed_distance(truth)
    low, high = IOU_RANGE
    for strength, attempt in product(STRENGTHS, range(300)):
        mask = coarse_mask(distance, np.random.default_rng((seed, attempt)), flaw, strength)
        shows = flaw == "none" or flaw_area(mask, distance, (labels > 0) & ~truth, flaw) > 0.03
        if shows and low <= intersection_over_union(mask, truth) <= high:
            return mask
    raise RuntimeError(f"no coarse mask of object {object_id} with flaw {flaw} has an IoU between {low} and {high}")


def draw_masks(out: Path, views: list[View], names: dict[str, int], flaws: dict[tuple[str, int], str]) -> str:
    """Draw the coarse masks into ``out/coarse_masks`` and return the table of their overlaps with the truth.

    ``flaws``: (object, place in its three views) -> deliberate fault of that mask, ``spill`` or ``gap``.
    """
    lines = ["object  view   set         flaw   IoU"]
    for column, (name, object_id) in enumerate(names.items()):
        for place_in_set, view in enumerate(views_to_mask(out, views, names, column)):
            flaw = flaws.get((name, place_in_set), "none")
            labels = read_truth(out, view)
            mask = draw_mask(labels, object_id, flaw, 100 * object_id + place_in_set)
            sets = ("one", "three") if place_in_set == 0 else ("three",)
            for folder in sets:
                write_mask(out / "coarse_masks" / folder / name / f"{view.stem}.png", mask)
            overlap = intersection_over_union(mask, labels == object_id)
            lines.append(f"{name:7s} {view.stem}  {'+'.join(sets):10s}  {flaw:5s}  {overlap:.3f}")
    return "\n".join(lines)
