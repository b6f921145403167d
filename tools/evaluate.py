"""The paper's tables on the demo capture: python3 tools/dev.py evaluate [TABLE ...] [--threads N] [--out DIR].

    segmentation   Table 1: IoU and accuracy, beside plain cross-entropy, other heads and the ceiling
    outside        Table 2: what an edit changes outside its objects
    consistency    Table 3: how alike two views show an edited surface
    ablations      Table 4 and Fig. 7, 8: layers, parts of Eq. 6, supervision, palettes
    sampling       the surface cache beside nearly dense samples
    decomposition  the 2-D weights that F_w is taught, beside LoCoPalettes'
    edits          recolors against the true ones, beside other ways to recolor
    marked_photo   the same in the one photo that is marked: rough 2-D masks against ours

Without names: all. The demo is learned once into DIR/project (kept between runs); every other way shares its geometry
and whatever stage it does not change. Writes docs/results/<table>.json, and from these docs/results.md and *.csv.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import results
from benchmark import machine
from evaluate_bench import ONE, THREE, Bench, Learned
from evaluate_recolors import (
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
from judging import (
    TestViews,
    score_objects,
    score_palettes_of,
)

from karf_engine.capture.capture import View
from karf_engine.consistency import Sight, carried_by_flow, correspond, flow_rmse, laenerf_error, mean_of_pairs
from karf_engine.edit.color import hue_shift
from karf_engine.edit.compositing import stack_palettes
from karf_engine.edit.metrics import mse_outside
from karf_engine.evaluation import PaletteScore, score_palettes, score_recolor
from karf_engine.kan.gated_block import count_parameters
from karf_engine.lpips import Lpips
from karf_engine.settings import PRESETS
from karf_engine.stages.recoloring import initial_palettes, object_rays
from karf_engine.stages.render import Frame, Renderer

PLAIN = "segmentation.labels=masks"
MLP_HEADS = ("segmentation.head=mlp", "recoloring.head=mlp")
# consistency: a path of cameras round the still life
PATH_VIEWS, PATH_STEP, PATH_CENTER = 24, np.radians(2.5), np.array([0.0, 0.02, 0.27])
SHORT, LONG = 1, 7
TRUE_VIEWS = 8
DENSE = 64  # samples a ray: so many of equal opacity hold nearly all that a voxel field's ray is made of

Row = list[Any]


@dataclass(frozen=True)
class Table:
    """A measured table: its texts, (title, format) of each column, and the rows."""

    title: str
    about: str
    columns: tuple[tuple[str, str], ...]
    rows: list[Row]


def main() -> None:
    options = parse_arguments()
    bench = Bench(options)
    for name in options.tables or TABLES:
        start = time.monotonic()
        table = TABLES[name](bench)
        show(name, table)
        if not options.dry:
            results.write_table(name, as_json(name, table, options, round(time.monotonic() - start)))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=", ".join(TABLES))
    parser.add_argument("--out", type=Path, default=Path("evaluate_out"), help="what is learned (default: %(default)s)")
    parser.add_argument("--preset", default="demo", choices=tuple(PRESETS))
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="STAGE.FIELD=VALUE")
    parser.add_argument("--seeds", type=int, default=2, help="seeds of every ablation (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads (default: %(default)s)")
    parser.add_argument(
        "--lpips", type=Path, nargs=2, metavar=("ALEXNET", "LINEAR"), help="weights for LPIPS, see karf_engine/lpips.py"
    )
    parser.add_argument("--dry", action="store_true", help="print the tables, and write nothing below docs/")
    options = parser.parse_args()
    unknown = [name for name in options.tables if name not in TABLES]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(TABLES)}")
    return options


def as_json(name: str, table: Table, options: argparse.Namespace, seconds: int) -> dict[str, Any]:
    """The table as `results` stores it."""
    facts = machine(options.threads)
    made = {
        "date": date.today().isoformat(),
        "command": f"python3 tools/dev.py evaluate {name}" + f" --seeds {options.seeds}" * (name == "ablations"),
        "preset": " ".join([options.preset, *options.overrides]),
        "machine": f"{facts['processor']}, {facts['threads']} of {facts['cores']} cores",
        "seconds": seconds,
    }
    columns = [{"title": title, "format": form} for title, form in table.columns]
    rows = [[float(f"{cell:.6g}") if isinstance(cell, float) else cell for cell in row] for row in table.rows]
    return {"title": table.title, "about": table.about, "made": made, "columns": columns, "rows": rows}


def show(name: str, table: Table) -> None:
    """Print a table."""
    print(f"\n--- {name}", flush=True)
    for row in [[title for title, _ in table.columns], *table.rows]:
        cells = [cell if isinstance(cell, str) else "-" if cell is None else f"{cell:.5g}" for cell in row]
        print("  ".join(f"{cell:>12}" for cell in cells), flush=True)


# ------------------------------------------------------------------------------------------------------------- Table 1
def segmentation_table(bench: Bench) -> Table:
    """Masks of the test views against the true ones."""
    equal = "segmentation.match=parameters"
    ways = {
        "**ours**, one mask": bench.ours(),
        "ours, three masks": bench.learned((), THREE).test,
        "ours, plain MLP head": bench.learned(MLP_HEADS, weights_from="field").test,
        "ours, plain MLP head of equal parameters": bench.learned(("segmentation.head=mlp", equal)).test,
        "ours, B-spline layers": bench.learned(("segmentation.layer=bspline",)).test,
        "plain cross-entropy (Eq. 12), one mask": bench.learned((PLAIN,), weights_from="field").test,
        "plain cross-entropy (Eq. 12), three masks": bench.learned((PLAIN,), THREE).test,
        "ceiling: true masks of all training views": bench.ceiling().test,
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


# ------------------------------------------------------------------------------------------------------------- Table 2
def outside_table(bench: Bench) -> Table:
    """What edits change outside their objects' true masks."""
    test = bench.ours()
    ways = {
        "delta, on the photo, weights from the photo": (lambda f: on_photo(test.renderer, f), "delta"),
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
        edited = bench.edited(bench.job, test.renderer, edit)
        for frame, shown, inside in zip(frames, bench.photos(), bench.truth.inside(edit), strict=True):
            result = composed(test.renderer, frame, edited, compositing)
            base.append(mse_outside(result, frame.base, inside))
            photo.append(mse_outside(result, shown, inside))
    return [float(np.mean(base)), float(np.mean(photo)), float(np.max(base))]


# ------------------------------------------------------------------------------------------------------------- Table 3
def consistency_table(bench: Bench) -> Table:
    """How alike views of a camera path show the edited objects."""
    renderer = bench.ours().renderer
    frames = path_frames(bench, renderer)
    per_frame = [on_photo(renderer, frame) for frame in frames]
    ways = {
        "not edited": None,
        "delta, weights from F_w": (frames, "delta"),
        "delta, weights from each frame's own colors": (per_frame, "delta"),
        "paper (Eq. 9), weights from F_w": (frames, "paper"),
        "paper (Eq. 9), weights from each frame's own colors": (per_frame, "paper"),
    }
    plain = [frame.base for frame in frames]
    figures: dict[str, list[list[float]]] = {label: [] for label in ways}
    for edit in bench.truth.edits:
        numbers = [renderer.objects.index(name) for name in bench.truth.edits[edit]["objects"]]
        sights = [sight_of(view, frame, numbers) for view, frame in zip(path_views(bench), frames, strict=True)]
        edited = bench.edited(bench.job, renderer, edit)
        for label, way in ways.items():
            shown = plain if way is None else [composed(renderer, frame, edited, way[1]) for frame in way[0]]
            figures[label].append(consistency_figures(sights, plain, shown, bench.lpips))
    mean = {label: np.mean(values, 0) for label, values in figures.items()}
    still = mean["not edited"]
    rows = [[label, *v[:2].tolist(), *(v / still)[:2].tolist(), *v[2:].tolist()] for label, v in mean.items()]
    if bench.lpips is None:
        rows = [[*row, "n/a", "n/a"] for row in rows]
    published = {"PaletteNeRF with LSeg": (0.136, 0.262), "LAENeRF": (0.131, 0.260), "KaRF": (0.127, 0.250)}
    rows += [[f"paper: {name}, mean of other captures", *[None] * 4, *v, *[None] * 4] for name, v in published.items()]
    return Table(
        "View consistency (Table 3)",
        f"RMSE between what two frames of a camera path show of the same surface points, {SHORT} and {LONG} frames apart "
        f"({PATH_VIEWS} frames, 2.5 degrees a frame), mean over pairs and both edits. The first four columns take "
        "points of the edited objects and carry them over by our own depth; hidden ones are left out where depths "
        "differ by 1 %. The ratio says what the edit adds: 1 is nothing. *By flow*: the protocol of Lai et al. 2018 on "
        "the whole picture, with OpenCV's DIS flow of the scene that is not edited instead of a network's. *By script*: "
        "what LAENeRF's published script computes (sums of squares, over hidden pixels), with the same flow. The paper's "
        "RMSE is by flow, with steps between views that it does not tell. Highlights "
        "move over the objects, so that even the scene that is not edited differs. A smaller figure is not always "
        "better: a flat color is perfectly consistent. LPIPS, of frames carried over by the flow, hidden pixels black, needs "
        "a network that is not part of this program (`--lpips`).",
        (
            ("recolored", ""),
            ("RMSE short", ".4f"),
            ("RMSE long", ".4f"),
            ("ratio short", ".2f"),
            ("ratio long", ".2f"),
            ("by flow, short", ".4f"),
            ("by flow, long", ".4f"),
            ("by script, short", ".4f"),
            ("by script, long", ".4f"),
            ("LPIPS short", ".4f"),
            ("LPIPS long", ".4f"),
        ),
        rows,
    )


def consistency_figures(
    sights: list[Sight], plain: list[np.ndarray], shown: list[np.ndarray], lpips: Lpips | None
) -> list[float]:
    """Short and long: RMSE by geometry, by flow, the script's error, and LPIPS where it was given.

    plain: the frames without the edit.
    """

    def by_geometry(a: int, b: int) -> float:
        return correspond(sights[a], sights[b]).rmse(shown[a], shown[b])

    def by_flow(a: int, b: int) -> float:
        return flow_rmse(plain[a], plain[b], shown[a], shown[b])

    def by_script(a: int, b: int) -> float:
        return laenerf_error(plain[a], plain[b], shown[a], shown[b])

    def by_network(a: int, b: int) -> float:
        carried, visible = carried_by_flow(plain[a], plain[b], shown[b])
        return lpips(shown[a] * visible[..., None], carried * visible[..., None])

    measures = (by_geometry, by_flow, by_script) + ((by_network,) if lpips else ())
    return [mean_of_pairs(len(shown), k, measure) for measure in measures for k in (SHORT, LONG)]


def path_views(bench: Bench) -> list[View]:
    """Cameras on an arc round the still life, from the first test camera on."""
    plate = bench.ours().plates[0]
    views = []
    for number in range(PATH_VIEWS):
        turn = np.eye(4)
        cosine, sine = np.cos(number * PATH_STEP), np.sin(number * PATH_STEP)
        turn[:2, :2] = [[cosine, -sine], [sine, cosine]]
        turn[:3, 3] = PATH_CENTER - turn[:3, :3] @ PATH_CENTER
        camera = plate.camera.without_distortion()
        moved = type(camera)(**vars(camera) | {"camera_to_world": turn @ camera.camera_to_world})
        views.append(View(f"path_{number}", f"path_{number}", moved, None, "test"))
    return views


def path_frames(bench: Bench, renderer: Renderer) -> list[Frame]:
    """The path as learned, without photos."""
    progress = bench.job.progress("path", PATH_VIEWS)
    frames = []
    for view in path_views(bench):
        frames.append(renderer.frame(view, None, "field"))
        progress.step()
    return frames


def sight_of(view: View, frame: Frame, numbers: list[int]) -> Sight:
    """What a frame sees of the objects with these numbers."""
    opacity, depth = frame.picture.opacity.cpu().numpy(), frame.picture.depth.cpu().numpy()
    return Sight(view.camera, depth, frame.masks[numbers].any(0) & (opacity > 0.95))


# ------------------------------------------------------------------------------------------------------------- Table 4
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
    "60 iterations: w/ All": ("recoloring.iterations=60",),
    "60 iterations: w/o All": ("recoloring.iterations=60", "recoloring.variant=none"),
    "60 iterations: MLP layers, equal parameters": ("recoloring.iterations=60", "recoloring.layer=mlp", EQUAL),
}


def ablations_table(bench: Bench) -> Table:
    """How well palettes and weights of F_w alone show the objects in test views."""
    rows = [ablation_row(bench, label, overrides) for label, overrides in ABLATIONS.items()]
    rows += [bound_row(bench)]
    return Table(
        "Ablations (Table 4, Fig. 7 and 8)",
        "The objects as palettes and F_w mix them (W P, Eq. 9) against the photos, mean over test views and, "
        "where there are several (`--seeds`), over seeds of the palette's and F_w's training on one segmentation; ± is "
        "the standard deviation over seeds. Frame: everything that is no object is black in both, as in the paper, which makes figures high. "
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
        scores.append(vars(score_palettes_of(learned.test, bench.truth.masks("test"))))
        seconds.append(learned.job.project.finished("recoloring")["seconds"])
    mean = {key: float(np.mean([score[key] for score in scores])) for key in scores[0]}
    spread = float(np.std([score["psnr_object"] for score in scores])) if bench.seeds > 1 else None
    size = count_parameters(learned.test.renderer.recoloring.head)
    return [label, *palette_cells(PaletteScore(**mean), spread), size, float(np.mean(seconds))]


def palette_cells(score: PaletteScore, spread: float | None) -> Row:
    return [score.psnr_frame, score.ssim_frame, score.psnr_object, spread, score.ssim_object]


def bound_row(bench: Bench) -> Row:
    """What the palettes allow: star weights of the test photos themselves, in the true masks."""
    test = bench.ours()
    masks = true_masks_of(bench, test.renderer)
    frames = [with_masks(test.renderer, frame, mask) for frame, mask in zip(test.frames, masks, strict=True)]
    weights, probabilities = [f.palette_weights for f in frames], [f.probabilities for f in frames]
    score = score_palettes(weights, probabilities, test.renderer.learned, bench.photos(), masks)
    return ["bound: star weights of the test photos, true masks", *palette_cells(score, None), None, None]


# ------------------------------------------------------------------------------------------------------------ sampling
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
    scores = score_objects(learned.test, truth)
    psnr = score_palettes_of(learned.test, truth).psnr_object
    seconds = [learned.job.project.finished(stage)["seconds"] for stage in ("segmentation", "recoloring")]
    return [count, 100 * scores["iou"]["mean"], 100 * scores["iou_border_excluded"]["mean"], psnr, *seconds]


# ------------------------------------------------------------------------------------------------------- decomposition
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
    palettes, field = initial_palettes(learned.job), learned.test.renderer.scene.field
    start = time.monotonic()
    rays = object_rays(learned.job, field, palettes)
    seconds = time.monotonic() - start
    weights, block = rays.weights.numpy(), rays.block.numpy()
    colors = stack_palettes([p.name for p in palettes], {p.name: p.colors for p in palettes})
    mixed = np.einsum("nm,nmc->nc", weights, colors[block])
    error = np.sqrt(((mixed - rays.colors.numpy()) ** 2).sum(1).mean())
    places = rays.positions[:, rays.positions.shape[1] // 2].numpy()
    spread = disagreement(weights, np.column_stack([block, np.floor(places / field.voxel)]), rays.view.numpy())
    taught = score_palettes_of(learned.test, bench.truth.masks("test")).psnr_object
    n_colors = float(np.mean([len(palette.colors) for palette in palettes]))
    return [n_colors, 255 * float(error), float((weights > 0.02).sum(1).mean()), spread, seconds, taught]


def disagreement(weights: np.ndarray, cells: np.ndarray, view: np.ndarray) -> float:
    """RMS deviation of weights [n, M] from their cell's mean, over cells [n, c] that several views [n] show."""
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    pairs = np.unique(np.column_stack([cell.ravel(), view]), axis=0)
    shared = (np.bincount(pairs[:, 0]) >= 2)[cell.ravel()]
    _, cell = np.unique(cell.ravel()[shared], return_inverse=True)
    values, count = weights[shared], np.bincount(cell)
    means = np.stack([np.bincount(cell, column) / count for column in values.T], 1)
    return float(np.sqrt(((values - means[cell]) ** 2).sum(1).mean()))


# --------------------------------------------------------------------------------------------------------------- edits
def edits_table(bench: Bench) -> Table:
    """Recolors of the test photos against the true ones."""
    ours, photos = Learned(bench.job, bench.ours()), bench.photos()
    true_masks = true_masks_of(bench, ours.test.renderer)
    own = [frame.masks for frame in ours.test.frames]
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
        "color pair an object, read in one training view, and solved by `edit/match.py` wherever a palette is edited. "
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


# -------------------------------------------------------------------------------------------------------- marked photo
def marked_photo_table(bench: Bench) -> Table:
    """The one photo that is marked and whose true recolor is known: rough masks as they are, against ours."""
    renderer, rows = bench.ours().renderer, {}
    for edit, facts in bench.truth.edits.items():
        photo, recolored = bench.truth.reference(edit)
        view = next(v for v in bench.job.capture().split("train") if v.stem == facts["reference_view"])
        frame = renderer.frame(view, bench.job.plates([view])[0], "photo")
        number = int(np.flatnonzero([v.stem == view.stem for v in bench.job.capture().split("train")])[0])
        exact = [bench.truth.labels("train")[number] == bench.truth.names[name] for name in renderer.objects]
        rough = [bench.truth.coarse_mask(edit, name) for name in renderer.objects]
        edited = bench.edited(bench.job, renderer, edit)
        inside = np.any([exact[renderer.objects.index(name)] for name in facts["objects"]], 0)
        ways = {
            "**ours**": frame,
            "rough 2-D masks as they are": with_masks(renderer, frame, np.stack(rough)),
            "true masks": with_masks(renderer, frame, np.stack(exact)),
        }
        pictures = {label: composed(renderer, way, edited, "delta") for label, way in ways.items()} | {"no edit": photo}
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


TABLES: dict[str, Callable[[Bench], Table]] = {
    "segmentation": segmentation_table,
    "outside": outside_table,
    "consistency": consistency_table,
    "ablations": ablations_table,
    "sampling": sampling_table,
    "decomposition": decomposition_table,
    "edits": edits_table,
    "marked_photo": marked_photo_table,
}

if __name__ == "__main__":
    main()
