"""Table 4, Fig. 7 and 8: how well palettes and F_w alone show the objects, and what F_w is taught."""

from __future__ import annotations

import time

import numpy as np

from karf_engine.heads.files import load_surface
from karf_engine.heads.training_rays import training_rays
from karf_engine.kan.gated_block import count_parameters
from karf_engine.palettes.compositing import stack_palettes
from karf_engine.palettes.palette import read_palettes
from karf_engine.segmentation.report import SegmentationReport
from tools.metrics.scores import PaletteScore, score_palettes

from ..judging.scores import score_palettes_of
from ..judging.views import terminal_progress
from . import printed  # noqa: F401  registers what two rows name
from .bench import Bench
from .recolors import true_masks_of, with_masks
from .table import Row, Table

EQUAL = "recoloring.match=parameters"
ABLATIONS: dict[str, tuple[str, ...]] = {
    "**w/ All** (ours): GRBF, hull palette": (),
    "w/o Res": ("recoloring.variant=no_residual",),
    "w/ Gate": ("recoloring.variant=gate",),
    "w/o All": ("recoloring.variant=none",),
    "w/o All, equal parameters": ("recoloring.variant=none", EQUAL),
    "B-spline layers": ("recoloring.layer=bspline",),
    "MLP layers": ("recoloring.layer=mlp",),
    "MLP layers, equal parameters": ("recoloring.layer=mlp", EQUAL),
    "plain MLP head": ("recoloring.head=mlp",),
    "plain MLP head, equal parameters": ("recoloring.head=mlp", EQUAL),
    "bandwidth of FastKAN, fixed": ("recoloring.bandwidth=fastkan", "recoloring.learn_bandwidth=false"),
    "bandwidth of X-KANeRF, fixed": ("recoloring.bandwidth=xkanerf", "recoloring.learn_bandwidth=false"),
    "N = 5 centers": ("recoloring.centers=5",),
    "Eq. 4 and 5 as printed: no bias, no LayerNorm": ("recoloring.layer=printed",),
    "sigmoids in the place of the softmax": ("recoloring.head=sigmoid",),
    "weights of marked views only": ("recoloring.supervision=reference",),
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
    "all rays, the background learns black (Eq. 11)": ("recoloring.background=black",),
    "60 iterations: w/ All": ("recoloring.iterations=60",),
    "60 iterations: w/o All": ("recoloring.iterations=60", "recoloring.variant=none"),
    "60 iterations: MLP layers, equal parameters": ("recoloring.iterations=60", "recoloring.layer=mlp", EQUAL),
    "1,000 iterations: w/ All": ("recoloring.iterations=1000",),
    "1,000 iterations: w/o All": ("recoloring.iterations=1000", "recoloring.variant=none"),
    "1,000 iterations: MLP layers, equal parameters": ("recoloring.iterations=1000", "recoloring.layer=mlp", EQUAL),
    "1,000 iterations: all rays, the background learns black": (
        "recoloring.iterations=1000",
        "recoloring.background=black",
    ),
}


def ablations_table(bench: Bench) -> Table:
    """How well palettes and weights of F_w alone show the objects in test views."""
    rows = [ablation_row(bench, label, overrides) for label, overrides in ABLATIONS.items()]
    rows += [bound_row(bench)]
    return Table(
        "Ablations (Table 4, Fig. 7 and 8)",
        "The objects as palettes and F_w mix them (W P, Eq. 9) against the photos, mean over test views and, "
        "where there are several (`--seeds`), over seeds of the palette's and F_w's training on one segmentation; ± is "
        "the standard deviation over seeds. Frame: everything that is not an object is black in both, as in the paper, which makes figures high. "
        "Object: inside the true masks only. Equal parameters: as many as w/ All has, by the width. Seconds: the "
        "recoloring stage, which depends on the machine's load. The paper's means: w/o All 33.71, w/ Gate 34.11, "
        "w/o Res 34.40, w/ All 34.70 dB.",
        (
            ("F_w", ""),
            ("PSNR frame", ".2f"),
            ("SSIM frame", ".4f"),
            ("PSNR object", ".2f"),
            ("±", ".2f"),
            ("SSIM object", ".4f"),
            ("parameters", ",d"),
            ("s", ".1f"),
        ),
        rows,
    )


def ablation_row(bench: Bench, label: str, overrides: tuple[str, ...]) -> Row:
    scores, seconds = [], []
    for seed in range(bench.seeds):
        learned = bench.ablation(overrides, seed)
        scores.append(vars(score_palettes_of(learned, bench.truth.masks("test"))))
        seconds.append(learned.model.project.finished("recoloring")["seconds"])
    mean = {key: float(np.mean([score[key] for score in scores])) for key in scores[0]}
    deviation = float(np.std([score["psnr_object"] for score in scores], ddof=1)) if bench.seeds > 1 else None
    size = count_parameters(learned.model.recoloring.head)
    return [label, *palette_cells(PaletteScore(**mean), deviation), size, float(np.mean(seconds))]


def palette_cells(score: PaletteScore, deviation: float | None) -> Row:
    return [score.psnr_frame, score.ssim_frame, score.psnr_object, deviation, score.ssim_object]


def bound_row(bench: Bench) -> Row:
    """What the palettes allow: star weights of the test photos themselves, in the true masks."""
    test = bench.ours()
    masks = true_masks_of(bench, test.model)
    frames = [with_masks(test.model, frame, mask) for frame, mask in zip(test.frames, masks, strict=True)]
    weights, probabilities = [f.palette_weights for f in frames], [f.probabilities for f in frames]
    score = score_palettes(weights, probabilities, test.model.learned_colors, bench.photos(), masks)
    return ["bound: star weights of the test photos, true masks", *palette_cells(score, None), None, None]


DECOMPOSITIONS = {
    "**ours**: star weights, as few colors as are faithful": (),
    "star weights, six colors": ("palette.colors=6",),
    "LoCoPalettes' weights, six colors": ("palette.colors=6", "recoloring.targets=loco"),
}


def decomposition_table(bench: Bench) -> Table:
    """2-D weights that F_w is taught: ours, and those of LoCoPalettes."""
    return Table(
        "2-D palette weights (W of Eq. 13)",
        "What F_w is asked for, on the cached training views: pixels well inside the objects, in their photos' colors. "
        "LoCoPalettes' weights are of color and place, photo by photo, with the field's prior features in the place of "
        "its semantic network's. RMSE: of W P to the colors, RGB vectors, in 1/255. Used: weights over 0.02 a pixel. "
        "Disagreement: standard deviation of the weights of all pixels, in at least two views, that show the same "
        "voxel. Taught by W: PSNR of F_w in test views, inside the objects, as in the ablations, one seed.",
        (
            ("W", ""),
            ("colors", ".1f"),
            ("RMSE", ".2f"),
            ("used", ".2f"),
            ("disagreement", ".4f"),
            ("s", ".1f"),
            ("taught by W, dB", ".2f"),
        ),
        [[label, *decomposition_row(bench, overrides)] for label, overrides in DECOMPOSITIONS.items()],
    )


def decomposition_row(bench: Bench, overrides: tuple[str, ...]) -> Row:
    learned = bench.ablation(overrides, 0)
    model, project, field = learned.model, learned.model.project, learned.model.scene.field
    palettes = read_palettes(project.verified(project.palette_file), "initial")
    views = SegmentationReport.read(project.verified(project.segmentation_report)).views
    capture = model.capture
    cameras = [capture.view(name).camera for name in views]
    start = time.monotonic()
    surface, _ = load_surface(project.verified(project.surface_file), model.device)
    settings = model.settings.recoloring
    rays = training_rays(field, surface, palettes, settings, cameras=cameras, start_progress=terminal_progress)
    seconds = time.monotonic() - start
    weights, block, view = (values.cpu().numpy() for values in (rays.weights, rays.block, rays.view))
    colors = stack_palettes([p.name for p in palettes], {p.name: p.colors for p in palettes})
    mixed = np.einsum("nm,nmc->nc", weights, colors[block])
    error = np.sqrt(((mixed - rays.colors.cpu().numpy()) ** 2).sum(1).mean())
    places = rays.positions[:, rays.positions.shape[1] // 2].cpu().numpy()
    varied = disagreement(weights, np.column_stack([block, np.floor(places / field.voxel)]), view)
    taught = score_palettes_of(learned, bench.truth.masks("test")).psnr_object
    n_colors = float(np.mean([len(palette.colors) for palette in palettes]))
    return [n_colors, 255 * float(error), float((weights > 0.02).sum(1).mean()), varied, seconds, taught]


def disagreement(weights: np.ndarray, cells: np.ndarray, view: np.ndarray) -> float:
    """RMS deviation of weights [n, M] from their cell's mean, over cells [n, c] that several views [n] show."""
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([cell.ravel(), view]), axis=0)
    shared = (np.bincount(pairs[:, 0]) >= 2)[cell.ravel()]
    _, cell = np.unique(cell.ravel()[shared], return_inverse=True)
    values, count = weights[shared], np.bincount(cell)
    means = np.stack([np.bincount(cell, column) / count for column in values.T], 1)
    return float(np.sqrt(((values - means[cell]) ** 2).sum(1).mean()))
