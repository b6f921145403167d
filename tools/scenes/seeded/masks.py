"""Rough masks of drawn scenes, as hasty hands draw them: wavy, with chunks missing, spilt, or of one side only."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import numpy as np

from ..cameras import View
from ..files import write_mask
from ..masks import (
    coarse_mask,
    intersection_over_union,
    read_truth,
    reference_view,
    signed_distance,
    visible_shares,
)

FLAWS = ("none", "gap", "spill", "side")
OVERLAPS = (0.60, 0.90)  # IoU with the truth that a mask may have
SIDE = (0.6, 0.85)  # share of the object that a mask of one side covers
STRENGTHS, TRIES = (0.5, 1.0, 1.5, 2.0, 3.0), 6
SHOWN = 0.5  # of the most that any photo shows of it: an object is drawn where at least so much is seen


def draw_hasty_masks(out: Path, views: list[View], names: dict[str, int], seed: int) -> str:
    """Draw ``out/coarse_masks/one`` and ``three`` of every object, and return the table of their overlaps.

    ``one`` has a mask of each object in the reference view, where edits' color pairs are read; ``three`` has the same
    and two more, in photos drawn among those that show the object.
    """
    train = [view for view in views if view.split == "train"]
    shares, reference = visible_shares(out, train, names), train.index(reference_view(out, views, names))
    lines = ["object  view   flaw   IoU"]
    for column, (name, object_id) in enumerate(names.items()):
        rng = np.random.default_rng((seed, object_id))
        others = np.setdiff1d(np.flatnonzero(shares[:, column] >= SHOWN), reference)
        for place, index in enumerate([reference, *rng.permutation(others)[:2]]):
            view, truth = train[index], read_truth(out, train[index]) == object_id
            flaw = str(rng.choice(FLAWS))
            mask = _hasty_mask(truth, flaw, rng)
            for folder in ("one", "three") if place == 0 else ("three",):
                write_mask(out / "coarse_masks" / folder / name / f"{view.stem}.png", mask)
            lines.append(f"{name}  {view.stem}  {flaw:5s}  {intersection_over_union(mask, truth):.3f}")
    return "\n".join(lines)


def _hasty_mask(truth: np.ndarray, flaw: str, rng: np.random.Generator) -> np.ndarray:
    """Return a mask of that flaw whose overlap with the truth is nearest to a drawn one."""
    wanted, distance = rng.uniform(*OVERLAPS), signed_distance(truth)
    best, nearest = truth, np.inf
    for strength, _ in product(STRENGTHS, range(TRIES)):
        mask = coarse_mask(distance, rng, "none" if flaw == "side" else flaw, strength)
        if flaw == "side":
            mask &= _one_side(truth, rng)
        miss = abs(intersection_over_union(mask, truth) - wanted)
        if mask.any() and miss < nearest:
            best, nearest = mask, miss
    return best


def _one_side(truth: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the half-plane in a drawn direction that holds a drawn share of the object, (H, W) bool."""
    angle = rng.uniform(0, 2 * np.pi)
    rows, columns = np.indices(truth.shape)
    along = np.cos(angle) * columns + np.sin(angle) * rows
    return along <= np.quantile(along[truth], rng.uniform(*SIDE))
