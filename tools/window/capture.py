"""The capture of the story of the first color: what an artist sees in it, and how good the masks have become."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

from karf_engine.capture import Capture, open_capture
from karf_engine.capture.capture import masks_of_view
from karf_engine.io.images import read_mask
from karf_engine.metrics.masks import iou
from tools.judging.truth import DEMO, Truth

DEMO_OBJECT = "pot"
MARGIN = 0.015  # between the object and the box, of the picture's longer side
CLEAR = 0.9  # of its usual size: so much of the object is seen in the view that an artist marks
NOT_PHOTOS = shutil.ignore_patterns("*masks*", "labels", "depth", "recolor", "edits.json")


@dataclass(frozen=True)
class Seen:
    """A capture as an artist sees it.

    Attributes:
        views: How many it has.
        view: The first, of those that are learned from, in which the object is well seen.
        box: Two opposite corners around it there, in shares of the picture from the lower left.
    """

    views: int
    view: str
    box: tuple[tuple[float, float], tuple[float, float]]


def lay_out(source: Path, target: Path) -> None:
    """Copy a capture without what is known of its objects."""
    shutil.copytree(source, target, ignore=NOT_PHOTOS)


def write_demo_truth(folder: Path) -> Path:
    """The demo's true masks of one object; returns the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    truth = Truth(DEMO)
    for split in ("train", "test"):
        for number, mask in enumerate(truth.masks(split)[DEMO_OBJECT]):
            imageio.imwrite(folder / f"{split}_r_{number:03d}.png", (mask * 255).astype(np.uint8))
    return folder


def look(capture_folder: Path, truth: Path) -> Seen:
    """What an artist sees in a capture of an object whose masks are in a folder."""
    capture = open_capture(capture_folder)
    masks = _masks(capture, truth)
    usual = np.median([mask.mean() for mask in masks.values()])
    learned = [view.name for view in capture.split("train")]
    view = next(name for name in learned if name in masks and masks[name].mean() >= CLEAR * usual)
    mask = masks[view]
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(1)), np.flatnonzero(mask.any(0))
    margin = MARGIN * max(width, height)
    left, right = max(columns[0] - margin, 0), min(columns[-1] + 1 + margin, width)
    top, bottom = max(rows[0] - margin, 0), min(rows[-1] + 1 + margin, height)
    box = (left / width, 1 - top / height), (right / width, 1 - bottom / height)
    return Seen(len(capture.views), view, box)


def judge(capture_folder: Path, truth: Path, facts: dict, view: str, out: Path) -> list[str]:
    """What the box and the segmentation are worth, beside masks that are known; a sentence each."""
    capture = open_capture(capture_folder)
    masks = _masks(capture, truth)
    marked = read_mask(Path(facts["mask"]) / f"{view}.png")
    held_out = [each.name for each in capture.split("test")]
    judged = [name for name in held_out or masks if name in masks and name != view]
    command = [sys.executable, "-m", "karf_engine", "render", facts["project"], "--views", ",".join(judged)]
    subprocess.run([*command, "--out", str(out)], check=True, capture_output=True)
    scores = [iou(read_mask(next((out / "masks").glob(f"*/{name}.png"))), masks[name]) for name in judged]
    which = "held-out views" if held_out else "views that were not marked"
    return [
        f"the box's mask of {view}: IoU {iou(marked, masks[view]):.3f}",
        f"segmentation, {len(scores)} {which}: mean IoU {np.mean(scores):.3f}, least {min(scores):.3f}",
    ]


def _masks(capture: Capture, folder: Path) -> dict[str, np.ndarray]:
    found = {view.name: masks_of_view(folder, view) for view in capture.views}
    return {name: read_mask(files[0]) for name, files in found.items() if files}
