"""Recolors against the true ones, and what they change outside (Table 2)."""

from __future__ import annotations

import numpy as np

from karf_engine.metrics.images import hue_shift, mse_outside
from karf_engine.recolor.frames import Frame
from tools.metrics.scores import score_recolor

from ..judging.matching import score_matches
from ..judging.views import TestViews
from .bench import MLP_HEADS, PLAIN, Bench
from .recolors import (
    Recolor,
    composed,
    global_recolor,
    kmeans_recolor,
    masked_hue_shift,
    masked_recolor,
    on_photo,
    on_render,
    projected,
    true_masks_of,
    with_masks,
)
from .table import Row, Table


def outside_table(bench: Bench) -> Table:
    """What edits change outside their objects' true masks."""
    test = bench.ours()
    ways = {
        "delta, on the photo, weights from the photo": (lambda f: on_photo(test.model, f), "delta"),
        "delta, on the photo, weights from F_w": (lambda f: f, "delta"),
        "delta, on the render, weights from F_w": (on_render, "delta"),
        "paper (Eq. 9), on the photo, weights from F_w": (lambda f: f, "paper"),
        "paper (Eq. 9), on the render, weights from F_w": (on_render, "paper"),
    }
    rows = []
    for label, (prepare, compositing) in ways.items():
        frames = [prepare(frame) for frame in test.frames]
        rows.append([label, *outside_row(bench, test, frames, compositing)])
    published = {"PaletteNeRF with LSeg": 0.0038, "ICE-NeRF": 0.0075, "LAENeRF": 0.0028, "KaRF": 0.0002}
    rows += [[f"paper: {name}, mean of other captures", value, None, None] for name, value in published.items()]
    return Table(
        "Outside the edit (Table 2)",
        "Mean squared error over the pixels outside the edited objects' true masks, mean over test views and both "
        "edits. *Against its base*: the picture that was edited (photo or render), so that only the edit counts; the "
        "paper does not say which it takes. *Against the photo*: on the render this adds the radiance field's own error. "
        "Eq. 9 replaces the edited objects inside our masks, and nothing else.",
        (
            ("compositing", ""),
            ("MSE against its base", ".1e"),
            ("MSE against the photo", ".1e"),
            ("largest MSE of a view, against its base", ".1e"),
        ),
        rows,
    )


def outside_row(bench: Bench, test: TestViews, frames: list[Frame], compositing: str) -> Row:
    base, photo = [], []
    for edit in bench.truth.edits:
        edited = bench.edited(test.model, edit)
        for frame, shown, inside in zip(frames, bench.photos(), bench.truth.inside(edit), strict=True):
            result = composed(test.model, frame, edited, compositing)
            base.append(mse_outside(result, frame.base, inside))
            photo.append(mse_outside(result, shown, inside))
    return [float(np.mean(base)), float(np.mean(photo)), float(np.max(base))]


def edits_table(bench: Bench) -> Table:
    """Recolors of the test photos against the true ones."""
    ours, photos = bench.ours(), bench.photos()
    true_masks = true_masks_of(bench, ours.model)
    own = [frame.masks for frame in ours.frames]
    plain = bench.learned((PLAIN,), weights_from="field")
    mlp = bench.learned(MLP_HEADS, weights_from="field")
    ways: dict[str, Recolor] = {
        "**ours**: delta, on the photo, weights from the photo": projected(bench, ours, "photo"),
        "delta, on the photo, weights from F_w": projected(bench, ours, "field"),
        "delta, on the render, weights from F_w (new cameras)": projected(bench, ours, "render"),
        "paper's replacement (Eq. 9), on the photo, weights from F_w": projected(bench, ours, "field", "paper"),
        "paper's replacement (Eq. 9), on the render, weights from F_w": projected(bench, ours, "render", "paper"),
        "ours with plain MLP heads": projected(bench, mlp, "photo"),
        "ours with plain MLP heads, weights from F_w": projected(bench, mlp, "field"),
        "plain cross-entropy on the rough masks (Eq. 12)": projected(bench, plain, "photo"),
        "plain cross-entropy, paper's replacement, weights from F_w": projected(bench, plain, "field", "paper"),
        "k-means palette in our masks": kmeans_recolor(bench),
        "one palette of whole pictures, no segmentation": global_recolor(bench),
        "hue shift of the whole picture": lambda edit: [
            hue_shift(photo, *next(iter(bench.pairs(edit).values()))) for photo in photos
        ],
        "hue shift inside our masks": masked_hue_shift(bench, own),
        "hue shift inside the true masks": masked_hue_shift(bench, true_masks),
        "rough 2-D masks, no 3-D (no test view is marked: nothing changes)": lambda edit: photos,
        "bound: ours in the true masks": masked_recolor(bench, true_masks),
    }
    rows = [[label, *recolor_cells(bench, way)] for label, way in ways.items()]
    return Table(
        "Edits against the true recolor",
        "The test views with the objects painted anew in the scene itself are the truth. Each edit is defined by one "
        "color pair an object, read in one training view, and solved by `palettes/matching/becomes.py` wherever a palette is edited. "
        "CIEDE2000: mean inside the edited objects' true masks; PSNR: whole picture; outside: MSE to the photo outside "
        "the true masks. The hue shift of the whole picture knows the first object's pair only. k-means: as many "
        "colors as ours, black among them, weights by the same star rule. One palette of whole pictures: hull of all "
        "training photos, all color pairs solved on it together.",
        recolor_columns(bench, "recolored by"),
        rows,
    )


def recolor_columns(bench: Bench, first: str) -> tuple[tuple[str, str], ...]:
    each = [(f"CIEDE2000 {name}", ".1f") for name in bench.truth.edits]
    return ((first, ""), *each, ("CIEDE2000 mean", ".1f"), ("PSNR", ".1f"), ("MSE outside", ".1e"))


def recolor_cells(bench: Bench, recolor: Recolor) -> Row:
    scores = [
        score_recolor(recolor(edit), bench.truth.recolored(edit), bench.photos(), bench.truth.inside(edit))
        for edit in bench.truth.edits
    ]
    each = [score.ciede2000 for score in scores]
    mean = [float(np.mean(values)) for values in (each, [s.psnr for s in scores], [s.mse_outside for s in scores])]
    return [*each, *mean]


def marked_photo_table(bench: Bench) -> Table:
    """The one photo that has masks and whose true recolor is known: rough masks as they are, against ours."""
    model, rows = bench.model, {}
    training_views = model.capture.split("train")
    for edit, entry in bench.truth.edits.items():
        photo, recolored = bench.truth.reference(edit)
        view = next(v for v in training_views if v.stem == entry["reference_view"])
        frame = model.render_view(view, "photo")
        number = int(np.flatnonzero([v.stem == view.stem for v in training_views])[0])
        exact = [bench.truth.labels("train")[number] == bench.truth.names[name] for name in model.objects]
        rough = [bench.truth.coarse_mask(edit, name) for name in model.objects]
        edited = bench.edited(model, edit)
        inside = np.any([exact[model.objects.index(name)] for name in entry["objects"]], 0)
        ways = {
            "**ours**": frame,
            "rough 2-D masks as they are": with_masks(model, frame, np.stack(rough)),
            "true masks": with_masks(model, frame, np.stack(exact)),
        }
        pictures = {label: composed(model, way, edited, "delta") for label, way in ways.items()} | {"no edit": photo}
        for label, picture in pictures.items():
            score = score_recolor([picture], [recolored], [photo], [inside])
            rows.setdefault(label, []).append([score.ciede2000, score.psnr, score.mse_outside])
    cells = [[label, *(v[0] for v in values), *np.mean(values, 0).tolist()] for label, values in rows.items()]
    return Table(
        "In the marked photo",
        "The training photo that carries the rough masks: the same palettes and weights of the photo, in three kinds of "
        "masks. This is all that 2-D masks can do without 3-D: no other photo is marked. Columns as above.",
        recolor_columns(bench, "masks"),
        cells,
    )


def matched_table(bench: Bench) -> Table:
    """Swatches matched to the true recolor of one test photo, in the other ones."""
    scores = score_matches(bench.model, bench.truth)
    labels = {
        "no_edit": "no edit",
        "becomes": "*Becomes*: one color pair an object",
        "others": "**match**: one test photo's true recolor as the painted picture, in the others",
        "worst": "the same, the worst photo to paint on",
        "given": "the same, in the painted photo itself",
        "bound": "bound: the swatches that fit all true recolors best",
    }
    rows = []
    for name, label in labels.items():
        each = [getattr(score, name) for score in scores.values()]
        rows.append([label, *each, float(np.mean(each))])
    return Table(
        "Match a painted picture",
        "The true recolor of one test photo is given as what the artist has painted; swatches are fitted to it "
        "(`palettes/matching/painted.py`) and judged in the other test photos, by the mean CIEDE2000 inside the edited objects' true "
        "masks; then the mean over all choices of the painted photo. *Becomes* knows one color pair an object, read in a "
        "training view. The bound is fitted to all test photos at once, inside the true masks, by least squares in sRGB.",
        (("swatches by", ""), *((f"CIEDE2000 {name}", ".2f") for name in scores), ("CIEDE2000 mean", ".2f")),
        rows,
    )
