"""Table 4, and what the differences from the paper are worth: how well palettes and F_w alone show the objects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch

from karf_engine.heads.rendering import render_weights
from karf_engine.kan.gated_block import count_parameters

from ..metrics.scores import PaletteScore, score_palettes
from . import printed  # noqa: F401  registers the layer and the head that two rows name
from .demo import ONE, Demo
from .store import Store
from .table import Figures, Table
from .views import TestViews, score_palettes_of
from .ways import true_masks_of, with_masks

EQUAL = "recoloring.match=parameters"
FULL = "**w/ All** (ours)"
ABLATIONS: dict[str, tuple[str, ...]] = {
    FULL: (),
    "w/o Res": ("recoloring.variant=no_residual",),
    "w/ Gate": ("recoloring.variant=gate",),
    "w/o All": ("recoloring.variant=none",),
    "w/o All, equal parameters": ("recoloring.variant=none", EQUAL),
    "B-spline layers": ("recoloring.layer=bspline",),
    "MLP layers": ("recoloring.layer=mlp",),
    "MLP layers, equal parameters": ("recoloring.layer=mlp", EQUAL),
    "plain MLP head, equal parameters": ("recoloring.head=mlp", EQUAL),
    "w/o L_Weight": ("recoloring.weight_loss=0",),
    "w/o L_Palette": ("recoloring.palette_loss=0",),
    "palette fixed": ("recoloring.palette_share=0",),
    "random palette, learned throughout": (
        "palette.start=random",
        "recoloring.weight_loss=0",
        "recoloring.palette_share=1",
        "recoloring.palette_rate=0.01",
    ),
    "one palette for all objects": ("palette.shared=true",),
}
# Eq. 13's mean runs over the supervised rays: with one marked view of 24 lambda_W counts five times as much as in a sum
SUMMED_WEIGHT_LOSS = 0.1 / 5
DIFFERENCES: dict[str, tuple[str, ...]] = {
    FULL: (),
    "Eq. 4 and 5 as printed: no bias, no LayerNorm": ("recoloring.layer=printed",),
    "sigmoids instead of the softmax": ("recoloring.head=sigmoid",),
    "weights of marked views only": ("recoloring.supervision=reference",),
    "the same, lambda_W as in the paper's sum": (
        "recoloring.supervision=reference",
        f"recoloring.weight_loss={SUMMED_WEIGHT_LOSS:.2f}",
    ),
    "all rays, the background learns black (Eq. 11)": ("recoloring.background=black",),
}
ALL_VIEWS = ("segmentation.cache_views=60", "segmentation.cache_long_side=256")
PRINTED_WEIGHTS = "weights as printed: sum(w p) instead of sum(w s p) / sum(w s)"


def ablations_table(store: Store) -> Table:
    """Measure the parts of Eq. 6, other layers, and the palette's and weights' losses (Table 4, Fig. 7 and 8)."""
    demo = Demo(store)
    rows = {label: ablation_figures(demo, overrides) for label, overrides in ABLATIONS.items()}
    return Table("F_w", rows | {"bound: star weights of the test photos, true masks": bound_figures(demo)})


def differences_table(store: Store) -> Table:
    """Measure what the engine builds otherwise than the paper prints."""
    demo = Demo(store)
    rows = {label: ablation_figures(demo, overrides) for label, overrides in DIFFERENCES.items()}
    ours = demo.ablation(())
    as_printed = score_palettes_of(printed_weights(ours), demo.truth.masks("test"))
    all_views = score_palettes_of(demo.learned(ALL_VIEWS, ONE, "field"), demo.truth.masks("test"))
    rows["F_s and F_w from all 60 photos of 256 pixels"] = palette_figures(all_views)
    return Table("F_w", rows | {PRINTED_WEIGHTS: palette_figures(as_printed)})


def ablation_figures(demo: Demo, overrides: tuple[str, ...]) -> Figures:
    """Return the figures of palette and F_w learned in another way."""
    learned = demo.ablation(overrides)
    score = palette_figures(score_palettes_of(learned, demo.truth.masks("test")))
    seconds = learned.model.project.finished("recoloring")["seconds"]
    return {**score, "parameters": count_parameters(learned.model.recoloring.head), "seconds": float(seconds)}


def palette_figures(score: PaletteScore) -> Figures:
    """Return a score as figures."""
    return {"psnr_frame": score.psnr_frame, "psnr_object": score.psnr_object, "ssim_object": score.ssim_object}


def bound_figures(demo: Demo) -> Figures:
    """Return what the palettes allow: star weights of the test photos themselves, in the true masks."""
    test = demo.ours()
    masks = true_masks_of(demo, test.model)
    frames = [with_masks(test.model, frame, mask) for frame, mask in zip(test.frames, masks, strict=True)]
    weights, probabilities = [f.palette_weights for f in frames], [f.probabilities for f in frames]
    score = score_palettes(weights, probabilities, test.model.learned_colors, demo.photos(), masks)
    return palette_figures(score)


@torch.no_grad()
def printed_weights(test: TestViews) -> TestViews:
    """Return the test views with palette weights to which every sample of a ray counts, whichever object it is of."""
    model, frames = test.model, []
    for frame in test.frames:
        cache, probabilities = frame.picture.cache, frame.probabilities
        features = model.scene.field.features(cache.positions.flatten(0, 1)).view(*cache.positions.shape[:2], -1)
        weights = render_weights(model.recoloring, cache.positions, cache.viewdirs, features)  # [n, K, M]
        planes = np.zeros((*weights.shape[1:], probabilities[0].size), np.float32)
        planes[..., cache.index.numpy()] = weights.permute(1, 2, 0).numpy()
        planes = planes.reshape(*weights.shape[1:], *probabilities.shape[1:]) * probabilities[:, None]
        frames.append(replace(frame, palette_weights=planes))
    return TestViews(model, test.training_images, frames)
