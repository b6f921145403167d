"""Table 1, and how many samples a ray the fields must learn from."""

from __future__ import annotations

from pathlib import Path

from ..judging.scores import score_objects, score_palettes_of
from .bench import MLP_HEADS, ONE, PLAIN, THREE, Bench
from .table import Row, Table

TRUE_VIEWS = 8
# samples a ray: this many of equal opacity hold nearly all that a voxel field's ray is made of; of 15 just those three
# that the labels are found on are the three of 3
DENSE = 15


def segmentation_table(bench: Bench) -> Table:
    """Masks of the test views against the true ones."""
    equal = "segmentation.match=parameters"
    ways = {
        "**ours**, one mask": bench.ours(),
        "ours, three masks": bench.learned((), THREE),
        "ours, plain MLP head": bench.learned(MLP_HEADS, weights_from="field"),
        "ours, plain MLP head of equal parameters": bench.learned(("segmentation.head=mlp", equal)),
        "ours, B-spline layers": bench.learned(("segmentation.layer=bspline",)),
        "plain cross-entropy (Eq. 12), one mask": bench.learned((PLAIN,), weights_from="field"),
        "plain cross-entropy (Eq. 12), three masks": bench.learned((PLAIN,), THREE),
        "ceiling: true masks of all training views": bench.ceiling(),
    }
    truth = bench.truth.masks("test")
    rows = [[label, *segmentation_row(score_objects(test, truth), bench.truth.names)] for label, test in ways.items()]
    nothing = [None] * (len(bench.truth.names) + 3)
    published = {"MVSeg": (90.7, 98.8), "SA3D": (93.7, 99.2), "KaRF": (94.7, 99.5)}
    rows += [
        [f"paper: {name}, mean of nine other captures", iou, accuracy, *nothing]
        for name, (iou, accuracy) in published.items()
    ]
    objects = tuple((f"IoU {name}", ".1f") for name in bench.truth.names)
    return Table(
        "Segmentation (Table 1)",
        "Percent. IoU and accuracy: for each object the mean over test views that show it (the protocol of SPIn-NeRF, "
        "there over all annotated views), then the mean over objects. Pooled: all pixels of all views counted together. "
        "Border left out: without the pixels that touch the truth's border. Worst: the worst view, mean over objects. "
        "All rows share one geometry; *ceiling* is what it allows.",
        (
            ("masks from", ""),
            ("IoU", ".1f"),
            ("Acc", ".2f"),
            ("IoU pooled", ".1f"),
            ("IoU border left out", ".1f"),
            ("IoU worst view", ".1f"),
            *objects,
        ),
        rows,
    )


def segmentation_row(scores: dict[str, dict[str, float]], names: dict[str, int]) -> Row:
    keys = ("iou", "accuracy", "iou_pooled", "iou_border_excluded", "iou_worst_view")
    return [100 * scores[key]["mean"] for key in keys] + [100 * scores["iou"][name] for name in names]


def sampling_table(bench: Bench) -> Table:
    """How many samples a ray the fields must learn from."""
    true_masks = bench.truth.write_training_masks(bench.folder(f"true_masks_of_{TRUE_VIEWS}"), TRUE_VIEWS)
    rows = [["ours", *sampling_row(bench, count)] for count in (1, 3, DENSE)]
    rows += [["plain cross-entropy (Eq. 12)", *sampling_row(bench, count, PLAIN)] for count in (3, DENSE)]
    label = f"plain cross-entropy, true masks of {TRUE_VIEWS} photos"
    rows += [[label, *sampling_row(bench, count, PLAIN, masks=true_masks)] for count in (3, DENSE)]
    return Table(
        "Samples a ray",
        "Density is frozen, so a ray is learned from on a few samples of equal opacity (the surface cache) instead of on "
        f"all that a NeRF takes; {DENSE} of them hold nearly all that a ray here is made of. Our labels are found on "
        "three at most in any row; plain cross-entropy sees them all. "
        "IoU in percent, mean over objects; PSNR of W P inside the objects; seconds of the two stages, which depend on "
        "the machine's load. What an iteration costs: `python3 tools/dev.py bench cache`.",
        (
            ("masks by", ""),
            ("samples", "d"),
            ("IoU", ".1f"),
            ("IoU border left out", ".1f"),
            ("PSNR object", ".2f"),
            ("s, F_s", ".0f"),
            ("s, F_w", ".0f"),
        ),
        rows,
    )


def sampling_row(bench: Bench, count: int, *overrides: str, masks: Path = ONE) -> Row:
    learned = bench.learned((f"segmentation.samples_per_ray={count}", *overrides), masks, weights_from="field")
    truth = bench.truth.masks("test")
    scores = score_objects(learned, truth)
    psnr = score_palettes_of(learned, truth).psnr_object
    seconds = [learned.model.project.finished(stage)["seconds"] for stage in ("segmentation", "recoloring")]
    return [count, 100 * scores["iou"]["mean"], 100 * scores["iou_border_excluded"]["mean"], psnr, *seconds]
