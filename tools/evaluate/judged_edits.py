"""Projects with true recolors: their scores and contact sheet.

The judged frames are FRAMES/<edit>/recolor/<view>.png.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

import imageio.v3 as iio
import numpy as np
from skimage.color import rgb2lab

from karf_engine.capture.training_images import TrainingImage
from karf_engine.errors import BadRequest
from karf_engine.io.color import to_bytes
from karf_engine.metrics.images import hue_shift, mean_ciede2000, psnr
from karf_engine.palettes.calibration import to_mean_exposure
from karf_engine.palettes.compositing import delta_composite
from karf_engine.palettes.palette import Edit
from karf_engine.palettes.project_edit import solve
from karf_engine.recolor.model import Model

from ..metrics.scores import score_edit, score_recolor
from ..metrics.truth import Truth
from .scores import score_palettes_of, score_renders
from .sheets import sheet_numbers, tinted, write_sheet
from .views import TestViews


def edit_to_judge(model: Model, truth: Truth, name: str, per_paint: bool = False) -> Edit:
    """The edit of one who knows one color pair an object, read in the reference view: it "becomes" the second.

    What is read there is meant in the photos' mean exposure.

    per_paint: they know one for each paint of it.
    """
    palettes = {palette.name: palette for palette in model.palettes}
    colors = {key: palette.colors for key, palette in palettes.items()}
    reference = truth.edits[name]["reference_view"]
    (gains,) = (view.gains for view in model.capture.split("train") if view.stem == reference)
    for key in truth.edits[name]["objects"]:
        pairs = truth.paint_pairs(name, key) if per_paint else [truth.color_pair(name, key)]
        sources_and_targets = (to_mean_exposure(np.stack(each), gains) for each in zip(*pairs, strict=True))
        with suppress(BadRequest):  # paint that the reading shows black cannot be told: it stays
            colors[key] = solve(model.project, palettes[key], *sources_and_targets, "becomes")
    return Edit(colors, "delta")


def score_scene(test: TestViews, truth: Truth) -> dict:
    """The render, the palettes' own picture of the objects, and the edit that changes nothing."""
    model, identity = test.model, 0
    for frame in test.frames:
        unchanged = delta_composite(frame.base, frame.palette_weights, model.learned_colors, model.learned_colors)
        identity = max(identity, int(np.abs(to_bytes(unchanged).astype(int) - to_bytes(frame.base)).max()))
    palettes = score_palettes_of(test, truth.masks("test"))
    return score_renders(test) | {"psnr_object": palettes.psnr_object, "identity_max_abs": identity}


def score_edits(truth: Truth, test: TestViews, frames: Path) -> dict:
    """Our frames against the true recolors, beside no edit and hue shifts."""
    scores = {}
    photos = [frame.base.astype(np.float64) for frame in test.frames]
    for name, edit in truth.edits.items():
        recolored = [recolored_frame(frames, name, training_image) for training_image in test.training_images]
        masks = [{o: labels == truth.names[o] for o in edit["objects"]} for labels in truth.labels("test")]
        pairs = {o: truth.color_pair(name, o) for o in edit["objects"]}
        scores[name] = asdict(score_edit(photos, recolored, truth.recolored(name), masks, pairs))
        paints = {o: truth.paint_pairs(name, o) for o in edit["objects"]}
        shifted = [hue_shift_of_paints(photo, own, paints) for photo, own in zip(photos, masks, strict=True)]
        of_paints = score_recolor(shifted, truth.recolored(name), photos, truth.inside(name))
        scores[name]["hue_shift_of_paints_in_true_mask"] = of_paints.ciede2000
    mean = {key: float(np.mean([score[key] for score in scores.values()])) for key in next(iter(scores.values()))}
    return {"ciede2000": scores | {"mean": mean}, "mse_outside": mean["mse_outside"]}


def hue_shift_of_paints(
    photo: np.ndarray, masks: dict[str, np.ndarray], paints: dict[str, list[tuple[np.ndarray, np.ndarray]]]
) -> np.ndarray:
    """The photo with the hue of each masked pixel shifted by the color pair whose source is nearest to it in CIELAB.

    Args:
        photo: sRGB [H, W, 3] in [0, 1].
        masks: bool [H, W] of each object.
        paints: source and target [3], sRGB, of each paint of each object.
    """
    result = photo.copy()
    for name, mask in masks.items():
        own, sources = photo[mask], rgb2lab(np.stack([source for source, _ in paints[name]]))
        nearest = np.linalg.norm(rgb2lab(own)[:, None] - sources, axis=2).argmin(1)
        shifted = np.stack([hue_shift(own, *pair) for pair in paints[name]])
        result[mask] = shifted[nearest, np.arange(len(own))]
    return result


def score_new_cameras(test: TestViews, truth: Truth) -> dict:
    """Test views as cameras that took no photo: what these show as learned, and with each edit against its recolors."""
    model, cameras = test.model, [training_image.camera for training_image in test.training_images]
    plain = [model.render_recolored(camera, model.edit()) for camera in cameras]
    values = [psnr(shown, frame.base) for shown, frame in zip(plain, test.frames, strict=True)]
    scores = {"psnr": float(np.mean(values)), "psnr_worst": float(np.min(values))}
    for name in truth.edits:
        edit = edit_to_judge(model, truth, name)
        truths = zip(cameras, truth.recolored(name), truth.inside(name), strict=True)
        found = [mean_ciede2000(model.render_recolored(camera, edit), true, inside) for camera, true, inside in truths]
        scores[f"ciede2000_{name}"] = float(np.mean(found))
    return {"new_cameras": scores}


def recolored_frame(frames: Path, edit: str, training_image: TrainingImage) -> np.ndarray:
    """The judged frame of a test view."""
    return iio.imread(frames / edit / "recolor" / f"{training_image.view.name}.png")[..., :3] / 255


def contact_sheet(frames: Path, out: Path, test: TestViews, truth: Truth) -> None:
    """Columns: photo, learned render, masks over the photo, then each edit and its truth."""
    rows = []
    for number in sheet_numbers(len(test.frames)):
        training_image, frame = test.training_images[number], test.frames[number]
        row = [frame.base, frame.color, tinted(frame.base, frame.masks)]
        for name in truth.edits:
            row += [recolored_frame(frames, name, training_image), truth.recolored(name)[number]]
        rows.append(row)
    write_sheet(out, rows)
