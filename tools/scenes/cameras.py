"""Where the photos are taken from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mathutils import Matrix, Vector

from .files import write_json

ELEVATIONS = (math.radians(12.0), math.radians(65.0))
EVEN_STEPS = (0.7548776662466927, 0.5698402909980532)  # of the R2 sequence: no two points of it come close


@dataclass(frozen=True)
class View:
    """One camera: its stem (``r_007``), its split (``train`` or ``test``) and its 4x4 camera_to_world matrix."""

    split: str
    stem: str
    camera_to_world: Matrix

    @property
    def number(self) -> int:
        """Its number within its split."""
        return int(self.stem.removeprefix("r_"))


def dome_views(train: int, test: int, radius: float, target) -> list[View]:
    """Return the views of both splits, spread over a dome by one golden-angle spiral with a small jitter.

    ``radius`` is the dome's about ``target``, which all look at.
    """
    count = train + test
    rng = np.random.default_rng(7)
    low, high = (math.sin(angle) for angle in ELEVATIONS)
    views = []
    for place, (split, stem) in enumerate(split_stems(train, test)):
        elevation = math.asin(low + (high - low) * (place + 0.5) / count)
        azimuth = place * math.pi * (3.0 - math.sqrt(5.0))
        distance = radius + rng.uniform(-0.1, 0.1)
        center = Vector(target) + Vector(rng.uniform(-0.05, 0.05, 3))
        views.append(View(split, stem, look_at(azimuth, elevation, distance, center)))
    return views


def patch_views(train: int, test: int, center, size: tuple[float, float], target) -> list[View]:
    """Return the views of both splits, spread over an upright patch of ``size`` (width, height) that all look out of.

    The patch is at ``center``, at right angles to the y axis; the cameras look at ``target`` with a small jitter.
    """
    rng = np.random.default_rng(7)
    views = []
    for place, (split, stem) in enumerate(split_stems(train, test)):
        across, up = ((0.5 + place * step) % 1.0 - 0.5 for step in EVEN_STEPS)
        position = Vector(center) + Vector((across * size[0], rng.uniform(-0.1, 0.1), up * size[1]))
        jittered = Vector(target) + Vector(rng.uniform(-0.1, 0.1, 3))
        views.append(View(split, stem, facing(position, position - jittered)))
    return views


def path_views(train: int, test: int, distance: float, target, seed: int) -> list[View]:
    """Return the views of both splits along a hand-held walk round a part of ``target``, at about ``distance``.

    The walk goes round a third to a half, rises and sinks once, and the hand trembles.
    """
    rng = np.random.default_rng(seed)
    span, low, high = math.radians(rng.uniform(110, 180)), *np.radians(rng.uniform((12, 22), (20, 40)))
    views = []
    for place, (split, stem) in enumerate(split_stems(train, test)):
        share = (place + 0.5) / (train + test)
        azimuth = -math.pi / 2 + span * (share - 0.5) + rng.normal(0, 0.02)
        elevation = low + (high - low) * math.sin(math.pi * share) + rng.normal(0, 0.02)
        looked_at = Vector(target) + Vector(rng.normal(0, 0.07, 3))
        matrix = look_at(azimuth, elevation, distance * rng.uniform(0.93, 1.07), looked_at)
        views.append(View(split, stem, matrix @ Matrix.Rotation(rng.normal(0, 0.03), 4, "Z")))
    return views


def split_stems(train: int, test: int) -> Iterator[tuple[str, str]]:
    """Yield the split and stem of each place of a sequence; test views at regular steps, so amid training views."""
    count = train + test
    test_places = {int((k + 0.5) * count / test) for k in range(test)} if test else set()
    numbers = {"train": 0, "test": 0}
    for place in range(count):
        split = "test" if place in test_places else "train"
        yield split, f"r_{numbers[split]:03d}"
        numbers[split] += 1


def look_at(azimuth: float, elevation: float, radius: float, target: Vector) -> Matrix:
    """Return the camera_to_world matrix of a camera on a sphere of ``radius`` about ``target``, angles in radians."""
    direction = Vector(
        (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    )
    return facing(target + radius * direction, direction)


def facing(position: Vector, backward: Vector) -> Matrix:
    """Return the camera_to_world matrix of an upright camera at ``position`` that looks against ``backward``."""
    return Matrix.Translation(position) @ backward.to_track_quat("Z", "Y").to_matrix().to_4x4()


def write_transforms(out: Path, views: list[View], field_of_view: float) -> None:
    """Write ``transforms_train.json`` and ``transforms_test.json`` in the NeRF-synthetic layout."""
    for split in ("train", "test"):
        frames = [
            {
                "file_path": f"./{split}/{view.stem}",
                "transform_matrix": [[round(x, 9) for x in row] for row in view.camera_to_world],
            }
            for view in views
            if view.split == split
        ]
        write_json(out / f"transforms_{split}.json", {"camera_angle_x": field_of_view, "frames": frames})
