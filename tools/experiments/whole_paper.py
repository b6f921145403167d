"""The preset `paper` run to its end, narrower than the paper's, beside the same stages on voxels and beside ours."""

from __future__ import annotations

import numpy as np

import karf_engine as karf
from karf_engine.compute.progress import TerminalEmit
from karf_engine.recolor.model import Model
from tools.metrics.scores import score_recolor

from ..judging.scores import score_objects, score_palettes_of, score_renders
from ..judging.truth import DEMO
from ..judging.views import TestViews, learn_again, render_test_views
from .bench import LEARNED, THREE, Bench
from .recolors import composed, on_photo, on_render
from .table import Row, Table

# what one processor core learns in an hour; all else is the preset's
NARROW_NERF = (
    "geometry.long_side=256",
    "geometry.nerf.width=64",
    "geometry.nerf.coarse_samples=32",
    "geometry.nerf.fine_samples=64",
    "geometry.nerf.rays=512",
    "geometry.nerf.iterations=4000",
    "geometry.nerf.rate=5e-4",
)
NARROW_HEADS = (
    "segmentation.width=64",
    "segmentation.batch=256",
    "segmentation.samples_per_ray=8",
    "segmentation.cache_long_side=128",
    "segmentation.cache_views=24",
    "recoloring.width=64",
    "recoloring.batch=256",
)
# the preset's own stages after geometry, said of a project of another preset
PAPER_STAGES = (
    "compositing=paper",
    "segmentation.labels=masks",
    "segmentation.frequencies=10",
    "segmentation.iterations=2000",
    "segmentation.rate=5e-4",
    "segmentation.schedule=constant",
    "palette.shared=true",
    "palette.colors=6",
    "recoloring.schedule=constant",
    "recoloring.frequencies=10",
    "recoloring.direction_frequencies=4",
    "recoloring.iterations=5000",
    "recoloring.rate=5e-4",
    "recoloring.targets=loco",
    "recoloring.supervision=reference",
    "recoloring.background=black",
    *NARROW_HEADS,
)


def whole_paper_table(bench: Bench) -> Table:
    """The paper's method from photos to recolors, beside ours; three rough masks an object, as for scenes seen all round."""
    ours = bench.learned((), THREE, weights_from="field")
    on_voxels = learn_again(bench.model, bench.folder("paper") / "voxels", PAPER_STAGES, LEARNED, THREE, bench.threads)
    rows = [
        [
            "**paper**: narrow NeRF, its F_s and F_w",
            *paper_cells(bench, render_test_views(learn_paper(bench)), "render"),
        ],
        ["the same stages on our voxels", *paper_cells(bench, render_test_views(on_voxels), "render")],
        ["ours, new cameras: voxels, cleaned masks, delta", *paper_cells(bench, ours, "render", "delta")],
        ["ours, the photos recolored", *paper_cells(bench, ours, "photo", "delta")],
    ]
    return Table(
        "The preset paper, run whole",
        "From photos to recolored views by the paper's own means, as narrow as one core learns in an hour: a NeRF 64 wide, 32 "
        "and 64 samples, 4,000 iterations of 512 rays at 5e-4 (paper: 256, 64 and 128, 120,000 of 2,048 at 5e-5); F_s and F_w "
        "64 wide on 8 samples a ray, 2,000 and 5,000 iterations of 256 rays (paper: 256 wide, all fine samples, 1,024 rays). "
        "All else is the preset `paper`: Eq. 12 on the masks as they are, six colors for all objects, LoCoPalettes' weights in "
        "the marked views, a background that learns black, masks that replace (Eq. 9). Three rough masks an object in every "
        "row. PSNR: the learned scene against the photos; objects: W P inside the true masks. Recolors as under Edits. "
        "Seconds: processor time of geometry, and of all stages after it. A full run of `paper` was never made.",
        (
            ("way", ""),
            ("PSNR", ".1f"),
            ("worst", ".1f"),
            ("IoU", ".1f"),
            ("PSNR objects", ".2f"),
            ("CIEDE2000", ".1f"),
            ("MSE outside, against its base", ".1e"),
            ("s, geometry", ".0f"),
            ("s, rest", ".0f"),
        ),
        rows,
    )


def learn_paper(bench: Bench) -> Model:
    """The preset's own run; kept between runs of this table."""
    return karf.learn(
        DEMO,
        THREE,
        project=bench.folder("paper") / "nerf",
        preset="paper",
        overrides=[*NARROW_NERF, *NARROW_HEADS],
        threads=bench.threads,
        emit=TerminalEmit(),
    )


def paper_cells(bench: Bench, test: TestViews, source: str, compositing: str = "paper") -> Row:
    """The figures of one row; source: what is recolored, the `render` or the `photo`."""
    truth, stages = bench.truth.masks("test"), test.model.project.state()["stages"]
    renders, iou = score_renders(test), score_objects(test, truth)["iou"]["mean"]
    frames = [on_render(f) if source == "render" else on_photo(test.model, f) for f in test.frames]
    distance, outside = [], []
    for edit in bench.truth.edits:
        edited, inside = bench.edited(test.model, edit), bench.truth.inside(edit)
        pictures = [composed(test.model, frame, edited, compositing) for frame in frames]
        score = score_recolor(pictures, bench.truth.recolored(edit), [frame.base for frame in frames], inside)
        distance.append(score.ciede2000)
        outside.append(score.mse_outside)
    rest = sum(stages[stage]["seconds"] for stage in LEARNED)
    return [
        renders["psnr_full"],
        renders["psnr_full_worst"],
        100 * iou,
        score_palettes_of(test, truth).psnr_object,
        float(np.mean(distance)),
        float(np.mean(outside)),
        stages["geometry"].get("seconds"),
        rest,
    ]
