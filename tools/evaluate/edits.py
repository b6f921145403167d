"""Recolors of the demo's test photos against the true ones, and what they change outside (Table 2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from karf_engine.metrics.images import hue_shift, mse_outside

from ..metrics.scores import score_recolor
from .demo import MLP_HEADS, ONE, PLAIN, Demo
from .store import Store
from .table import Figures, Table
from .ways import (
    Recolor,
    composed,
    in_mattes,
    masked_hue_shift,
    masked_recolor,
    on_photo,
    on_render,
    projected,
    true_masks_of,
)

PUBLISHED = {"PaletteNeRF with LSeg": 0.0038, "ICE-NeRF": 0.0075, "LAENeRF": 0.0028, "KaRF": 0.0002}


def outside_table(store: Store) -> Table:
    """Measure what edits change outside their objects' true masks (Table 2)."""
    demo = Demo(store)
    field, shipped = demo.ours(), demo.shipped()
    ways = {
        "**ours**, as shipped: delta on the photo, mattes": (shipped.frames, "delta"),
        "ours in the field's masks": ([on_photo(field.model, frame) for frame in field.frames], "delta"),
        "delta on the photo, weights from F_w": (field.frames, "delta"),
        "delta on the render, weights from F_w": ([on_render(frame) for frame in field.frames], "delta"),
        "paper (Eq. 9) on the photo, weights from F_w": (field.frames, "paper"),
        "paper (Eq. 9) on the render, weights from F_w": ([on_render(frame) for frame in field.frames], "paper"),
    }
    rows = {label: outside_figures(demo, *way) for label, way in ways.items()}
    for name, value in PUBLISHED.items():
        rows[f"paper: {name}, mean of other captures"] = {"mse_outside": value}
    return Table("recolored by", rows)


def outside_figures(demo: Demo, frames: Sequence, compositing: str) -> Figures:
    """Return a row of Table 2: frames recolored by both edits."""
    base, photo = [], []
    for edit in demo.truth.edits:
        edited = demo.edited(demo.model, edit)
        for frame, shown, inside in zip(frames, demo.photos(), demo.truth.inside(edit), strict=True):
            result = composed(demo.model, frame, edited, compositing)
            base.append(mse_outside(result, frame.base, inside))
            photo.append(mse_outside(result, shown, inside))
    return {
        "mse_outside": float(np.mean(base)),
        "mse_outside_photo": float(np.mean(photo)),
        "mse_outside_worst": float(np.max(base)),
    }


def edits_table(store: Store) -> Table:
    """Measure recolors of the test photos against the true ones."""
    demo = Demo(store)
    ours, photos = demo.ours(), demo.photos()
    true_masks = true_masks_of(demo, ours.model)
    own = [frame.masks for frame in ours.frames]
    plain = demo.learned((PLAIN,), ONE, "field")
    mlp = demo.learned(MLP_HEADS, ONE, "field")
    ways: dict[str, Recolor] = {
        "**ours**, as shipped: delta on the photo, mattes": in_mattes(demo),
        "ours in the field's masks": projected(demo, ours, "photo"),
        "ours, weights from F_w": projected(demo, ours, "field"),
        "ours on the render, weights from F_w": projected(demo, ours, "render"),
        "ours with plain MLP heads": projected(demo, mlp, "photo"),
        "paper's replacement (Eq. 9) on the photo, weights from F_w": projected(demo, ours, "field", "paper"),
        "paper's replacement (Eq. 9) on the render, weights from F_w": projected(demo, ours, "render", "paper"),
        "plain cross-entropy on the rough masks (Eq. 12)": projected(demo, plain, "photo"),
        "plain cross-entropy, paper's replacement, weights from F_w": projected(demo, plain, "field", "paper"),
        "hue shift of the whole picture": lambda edit: [
            hue_shift(photo, *next(iter(demo.pairs(edit).values()))) for photo in photos
        ],
        "hue shift in our masks": masked_hue_shift(demo, own),
        "hue shift in the true masks": masked_hue_shift(demo, true_masks),
        "no edit": lambda edit: photos,
        "bound: ours in the true masks": masked_recolor(demo, true_masks),
    }
    return Table("recolored by", {label: edit_figures(demo, way) for label, way in ways.items()})


def edit_figures(demo: Demo, recolor: Recolor) -> Figures:
    """Return a row: a way's recolors of the test photos, means over both edits."""
    scores = [
        score_recolor(recolor(edit), demo.truth.recolored(edit), demo.photos(), demo.truth.inside(edit))
        for edit in demo.truth.edits
    ]
    return {
        "ciede2000": float(np.mean([score.ciede2000 for score in scores])),
        "psnr_recolored": float(np.mean([score.psnr for score in scores])),
        "mse_outside_photo": float(np.mean([score.mse_outside for score in scores])),
    }
