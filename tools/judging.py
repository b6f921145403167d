"""What the judges of learned projects share: held-out frames, their scores, a scratch project, and contact sheets.

Pictures are float [H, W, 3] in [0, 1], masks bool [H, W], both at the project's working size. Only test views count.
Runs in the engine's environment; the caller puts the repository's root on the path.
"""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from karf_engine import settings as settings_module
from karf_engine.files import write_json
from karf_engine.images import write_png
from karf_engine.metrics.scores import PaletteScore, score_masks, score_palettes, score_pictures
from karf_engine.model import Frame, Model
from karf_engine.plates import Plate
from karf_engine.progress import TerminalEmit
from karf_engine.project import STAGE_ORDER, Project
from karf_engine.stages.dispatch import run_request
from karf_engine.stages.job import Job, open_job
from karf_engine.wire import Request

SHEET_ROWS = 4
MASK_COLORS = np.array([(1, 0, 0), (0, 0, 1), (0, 1, 0), (1, 1, 0), (1, 0, 1), (0, 1, 1)], np.float32)
STAGE_FILES = {  # what a later stage reads of each
    "geometry": ("geometry_file", "capture_file"),
    "segmentation": ("segmentation_file", "surface_file", "segmentation_report", "masks_folder"),
    "palette": ("palette_file", "object_colors_file"),
}
TOO_MUCH, MISSED = np.array([1.0, 0.2, 0.1]), np.array([0.2, 0.5, 1.0])


@dataclass(frozen=True)
class TestViews:
    """The test views of a project, and what it shows there. frames: one for each plate."""

    model: Model
    plates: list[Plate]
    frames: list[Frame]

    def masks(self, object_name: str) -> list[np.ndarray]:
        """The masks of one object, view by view."""
        number = self.model.objects.index(object_name)
        return [frame.masks[number] for frame in self.frames]


def open_project(folder: Path, threads: int | None) -> Job:
    """A job on a learned project; progress goes to the terminal."""
    return open_job(Request("render", folder, {"threads": threads}), TerminalEmit(), lambda: False)


def render_test_views(job: Job) -> TestViews:
    """Render every test view as learned; a frame's base is its photo, of a matte capture over white."""
    model = Model(job.project, job.runtime.device)
    views = job.capture().split("test")
    plates = job.plates(views)
    progress = job.progress("judge", len(views))
    frames = []
    for plate in plates:
        frames.append(model.render_plate(plate, "field"))
        progress.step()
    return TestViews(model, plates, frames)


def learn_again(job: Job, folder: Path, overrides: list[str], stages: Sequence[str], masks: Path | None = None) -> Job:
    """Learn these stages in another way, in a scratch project that keeps what the stages before them made.

    overrides: settings as `stage.field=value`. masks: for segmentation. With labels=votes and the true masks of all
    training views, segmentation is the ceiling.
    """
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    kept = STAGE_ORDER[: STAGE_ORDER.index(stages[0])]
    scratch = Project(folder)
    for name in (name for stage in kept for name in STAGE_FILES[stage]):
        source, target = getattr(job.project, name), getattr(scratch, name)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, target)
    state = job.project.state()
    changed = settings_module.with_overrides(job.settings, overrides)
    # without checksums: a kept palette may be as recoloring has learned it
    done = {name: {key: value for key, value in state["stages"][name].items() if key != "files"} for name in kept}
    state |= {"stages": done, "settings": settings_module.to_dict(changed)}
    write_json(scratch.state_file, state)
    options = {"masks": masks and str(masks), "threads": job.options.get("threads")}
    for stage in stages:
        run_request(Request(stage, folder, options), job.emit, job.should_stop)
    return open_project(folder, options["threads"])


def look_again(test: TestViews, job: Job, weights_from: str = "field") -> TestViews:
    """The same pictures of the same geometry, as the fields of another project see them."""
    model = Model(job.project, job.runtime.device)
    frames = [model.frame_of(frame.picture, frame.base, weights_from == "field") for frame in test.frames]
    return TestViews(model, test.plates, frames)


# --------------------------------------------------------------------------------------------------------------- figures
def stage_facts(project: Project) -> dict:
    """What the stages noted of themselves: seconds and peak memory, bytes."""
    stages = project.state()["stages"]
    return {
        "stage_seconds": {name: facts["seconds"] for name, facts in stages.items()},
        "peak_memory": max(facts["peak_memory"] for facts in stages.values()),
    }


def score_renders(test: TestViews) -> dict[str, float]:
    """How near the learned scene is to the photos."""
    scores = score_pictures([frame.color for frame in test.frames], [f.base for f in test.frames])
    return {"psnr_full": scores["psnr"], "psnr_full_worst": scores["worst"], "ssim_full": scores["ssim"]}


def score_objects(test: TestViews, truth: dict[str, list[np.ndarray]], suffix: str = "") -> dict[str, dict[str, float]]:
    """All of `MaskScore` for each object, and its means; suffix ends the keys."""
    scores = {name: asdict(score_masks(test.masks(name), truth[name])) for name in test.model.objects}
    table = {}
    for key, title in (
        ("iou", "iou"),
        ("iou_border_excluded", "iou_border_excluded"),
        ("worst", "iou_worst_view"),
        ("pooled", "iou_pooled"),
        ("accuracy", "accuracy"),
    ):
        column = {name: score[key] for name, score in scores.items()}
        table[title + suffix] = column | {"mean": float(np.mean(list(column.values())))}
    return table


def score_palettes_of(test: TestViews, truth: dict[str, list[np.ndarray]]) -> PaletteScore:
    """How well the learned palettes with the frames' weights show the objects; truth: masks, object by object."""
    masks = [np.stack(views) for views in zip(*(truth[name] for name in test.model.objects), strict=True)]
    weights = [frame.palette_weights for frame in test.frames]
    probabilities = [frame.probabilities for frame in test.frames]
    return score_palettes(weights, probabilities, test.model.learned_colors, [f.base for f in test.frames], masks)


def rounded(value):
    """Five significant digits: more would pretend to precision."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return float(f"{value:.5g}") if isinstance(value, float) else value


def print_common(summary: dict) -> None:
    """Print what both judges know: the render and the masks."""
    print(f"render             {summary['psnr_full']} dB (worst view {summary['psnr_full_worst']})")
    for key in [key for key in summary if key.startswith("iou")]:
        print(f"{key:36} " + "  ".join(f"{name} {value:.3f}" for name, value in summary[key].items()))


# -------------------------------------------------------------------------------------------------------- contact sheets
def sheet_numbers(n_views: int) -> list[int]:
    """Which views a contact sheet shows, spread over all."""
    return np.linspace(0, n_views - 1, min(SHEET_ROWS, n_views)).astype(int).tolist()


def tinted(photo: np.ndarray, masks: np.ndarray) -> np.ndarray:
    """Masks [K, H, W] in plain colors over a dark photo."""
    picture = photo * 0.35
    for number, mask in enumerate(masks):
        picture[mask] += 0.65 * MASK_COLORS[number % len(MASK_COLORS)]
    return picture


def difference(photo: np.ndarray, masks: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Over a dark gray photo, what masks [K, H, W] cover too much of in red, and what they miss in blue."""
    picture = np.repeat(photo.mean(-1, keepdims=True) * 0.35, 3, -1)
    too_much, missed = (masks & ~truth).any(0), (truth & ~masks).any(0)
    picture[too_much] = TOO_MUCH
    picture[missed] = MISSED
    return picture


def write_sheet(path: Path, rows: list[list[np.ndarray]]) -> None:
    """Write rows of equally large pictures as one."""
    write_png(path, np.concatenate([np.concatenate(row, 1) for row in rows], 0))
