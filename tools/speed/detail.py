"""What limits a learned scene: the detail that its voxels can hold where photos look, against what it reaches there."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import karf_engine as karf
from karf_engine.capture.training_images import TrainingImage
from karf_engine.fields.extent import focus_point, pixels_per_voxel, remove_detail
from karf_engine.metrics.images import psnr
from karf_engine.recolor.field_rendering import photo_frame
from karf_engine.recolor.frames import Frame
from karf_engine.recolor.model import Model

SPANS = (8.0, 4.0, 3.0, 2.0, 1.5)  # pixels
FEWEST_PIXELS = 16  # of an object in a picture that counts


def run(project: Path) -> list[dict[str, Any]]:
    """A row for the middle of the scene, one for all surfaces, one for each object, and the photos' own table.

    Of the first rows, `pixels` is what a voxel spans there (the median over the test views), `kept` the PSNR that the
    photos keep there without detail of so many pixels, `reached` that of the scene. Those of the table have no place:
    they say what photos keep for each of SPANS.
    """
    model = karf.load(project)
    training_images = [model.training_image(view) for view in model.capture.split("test")]
    frames = [photo_frame(model, training_image) for training_image in training_images]
    everywhere = [np.ones(frame.depth.shape, bool) for frame in frames]
    places = {"everywhere": everywhere} | {
        name: [frame.masks[number] for frame in frames] for number, name in enumerate(model.objects)
    }
    rows = [_row("center", _at_center(model, training_images), frames, everywhere)]
    for name, masks in places.items():
        rows.append(_row(name, _on_surfaces(model, training_images, frames, masks), frames, masks))
    return rows + [_row("", pixels, frames, everywhere) for pixels in SPANS]


def _at_center(model: Model, training_images: list[TrainingImage]) -> float:
    """Pixels that a voxel spans at the point nearest to the cameras' axes."""
    field, center = (
        model.scene.field,
        focus_point([training_image.camera for training_image in training_images]).numpy()[None],
    )
    return _median(
        pixels_per_voxel(field.space, field.voxel, center, training_image.camera) for training_image in training_images
    )


def _on_surfaces(
    model: Model, training_images: list[TrainingImage], frames: list[Frame], masks: list[np.ndarray]
) -> float:
    """Pixels that a voxel spans on what these pixels show."""
    field, spans = model.scene.field, []
    for training_image, frame, mask in zip(training_images, frames, masks, strict=True):
        shown = (mask & (frame.depth > 0)).ravel()
        origins, directions = training_image.camera.rays(training_image.camera.pixel_centers()[shown])
        positions = origins + frame.depth.ravel()[shown, None] * directions
        spans.append(pixels_per_voxel(field.space, field.voxel, positions, training_image.camera))
    return _median(spans)


def _row(place: str, pixels: float, frames: list[Frame], masks: list[np.ndarray]) -> dict[str, Any]:
    seen = [(frame, mask) for frame, mask in zip(frames, masks, strict=True) if mask.sum() >= FEWEST_PIXELS]
    kept = [psnr(remove_detail(frame.base, pixels), frame.base, mask) for frame, mask in seen]
    reached = [psnr(frame.color, frame.base, mask) for frame, mask in seen]
    return {
        "place": place,
        "pixels": round(pixels, 2),
        "kept": round(float(np.mean(kept)), 2),
        "reached": round(float(np.mean(reached)), 2) if place else "",
        "worst": round(min(reached), 2) if place else "",
    }


def _median(spans: Iterable[np.ndarray]) -> float:
    return float(np.nanmedian(np.concatenate(list(spans))))
