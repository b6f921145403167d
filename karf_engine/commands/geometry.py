"""Stage 0: photos -> radiance field (geometry.safetensors).

Marked photos are always training photos: the project's marks and those of `options.masks`.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from dataclasses import asdict, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from ..capture import hold_out, in_space, open_capture
from ..capture.capture import (
    UNIT_GAINS,
    Capture,
    SparsePoints,
    capture_to_json,
    leave_out,
    with_gains,
    with_split,
    without_views,
)
from ..capture.reader_utils import read_bytes
from ..capture.training_images import TrainingImage, load_readable_views
from ..capture.triangulation import triangulate
from ..compute import cores
from ..compute.kernels import has_kernels
from ..compute.progress import Emit, Progress
from ..compute.runtime import ProcessGroup, current_group, start_runtime
from ..errors import Cancelled, DataError, KarfError
from ..fields.exposures import LONG_SIDE as EXPOSURE_LONG_SIDE
from ..fields.exposures import gains_from_render
from ..fields.extent import psnr_without_detail, typical_pixels_per_voxel
from ..fields.files import save_scene
from ..fields.nerf.field import NerfNetwork
from ..fields.nerf.importing import import_nerf, read_nerf
from ..fields.registry import background_kind_of, build_pixel_dataset, field_kind, make_fit_task
from ..fields.rendering.rays import PixelDataset
from ..fields.scene import Scene, psnr_of_views
from ..fields.voxels.fit import VoxelFit
from ..io.color_spaces import ColorSpace, color_space
from ..io.files import file_digest, write_json
from ..io.images import alpha_composite, write_png
from ..project import Project
from ..project import settings as settings_module
from ..segmentation.coarse_masks import find_masks, marked_views
from ..splats.formats.registry import read_captured_gaussians
from .job import Job, StageRun, make_job, run_stage
from .options import GeometryOptions

VALIDATION_VIEWS = 8
COMPARED_VIEWS, COMPARED_LONG_SIDE = 3, 200  # photos that align an imported NeRF
DETAIL_PHOTOS = 8  # photos that the loss of detail is measured on
MIN_KEPT_PSNR = 25.0  # dB of photos blurred to the voxels' detail; less is worth a warning
GOOD_PIXELS_PER_VOXEL = 2.0  # most photos keep about 29 dB
MAX_PSNR_DROP = 0.5  # dB that held-out views may lose from level to level without a warning


def run(options: GeometryOptions, emit: Emit, should_stop: Callable[[], bool], capture: Capture | None = None) -> None:
    """Learn the scene of a capture, opened or from `options.capture`, unless it is finished with the same inputs."""
    settings = settings_module.with_overrides(settings_module.preset(options.preset), list(options.overrides))
    space = None if options.photo_space is None else color_space(options.photo_space, options.ocio)
    nerf = options.nerf
    networks = None if nerf is None else read_nerf(nerf)
    capture = capture or open_capture(options.capture)
    for remark in capture.warnings:
        emit("warning", code="capture", sentence=remark)
    if options.masks is not None:
        find_masks(options.masks, capture)  # refuse masks without a photo before learning
    project = Project(options.project)
    project.create(str(options.capture.absolute()))
    capture = hold_out(capture, project.holdout() if options.holdout is None else options.holdout)
    without = project.left_out() if options.without is None else tuple(filter(None, options.without))
    capture = leave_out(capture, without)
    if space is None and project.state_file.exists():  # by the summary: capture.json may be damaged
        learned_in = (project.finished("geometry") or {}).get("color_space")
        space = None if learned_in is None else ColorSpace(**learned_in)
    capture = in_space(capture, space)
    job = make_job(project, options, settings, emit, should_stop)
    with run_stage(job, "geometry", *_inputs(capture, nerf)) as run:
        if run is None:
            project.set_settings(settings_module.to_dict(settings))
            return
        run.summary.update(holdout=capture.holdout, without=sorted(without))
        if capture.views[0].space is not None:
            run.summary["color_space"] = asdict(capture.views[0].space)
        capture = with_marked_in_training(project, capture, options.masks)
        n_photos = len(capture.split("train"))
        if n_photos < 3:
            raise DataError(
                "{path} has {count} training photos.",
                "A scene needs at least three.",
                path=capture.source,
                count=n_photos,
            )
        if nerf is None or networks is None:
            scene, capture = learn(job, capture, run)
        else:
            scene = import_scene(job, capture, nerf, networks, run.summary)
        write_json(run.output(project.capture_file), capture_to_json(capture, run.folder))
        save_scene(scene, run.output(project.geometry_file))
    job.artifact("geometry", project.geometry_file)


def with_marked_in_training(project: Project, capture: Capture, masks: Path | None) -> Capture:
    """Return the capture with all photos that the project or `masks` marks in the training split.

    The marks are not part of the fingerprint.
    """
    folders = [folder for folder in (project.masks_folder, project.corrections_folder, masks) if folder is not None]
    marked = set().union(*(marked_views(project.check_inside(folder), capture) for folder in folders))
    return with_split(capture, marked, "train")


def _inputs(capture: Capture, nerf: Path | None) -> list:
    """Return the inputs for the fingerprint, as JSON values."""
    inputs = [capture_to_json(capture), [file_digest(view.image) for view in capture.views if view.image]]
    if capture.points is not None:
        inputs.append(hashlib.sha256(capture.points.positions.tobytes() + capture.points.point.tobytes()).hexdigest())
    if capture.splats is not None:
        inputs.append(file_digest(capture.splats.path))
    if nerf is not None:
        inputs.append(hashlib.sha256(read_bytes(nerf)).hexdigest())
    return inputs


def learn(job: Job, capture: Capture, run: StageRun) -> tuple[Scene, Capture]:
    """Fit or resume the field, with previews, and estimate the photos' exposures."""
    settings = job.settings.geometry
    if not has_kernels() and job.runtime.device.type == "cpu":
        job.emit(
            "warning",
            code="numba",
            sentence="Without the package numba the scene is learned by torch, in about twice the time and with other "
            "rounding, and no splats are learned: other cameras are rendered from the voxels.",
        )
    wait_until_ready = field_kind(settings.field).prepare(settings, job.runtime.device)
    capture, training_images = load_photos(job, capture)
    views = [image.view for image in training_images]
    kind = background_kind_of(training_images)
    points = training_points(job, capture, training_images, kind)
    task = make_fit_task(views, training_images, kind, points, settings, job.settings.seed, job.runtime.device)
    job.emit("stage", name="geometry", text=f"{task.space}, {0 if points is None else len(points)} sparse points")
    wait_until_ready(job.emit, job.should_stop)
    process_group = current_group()
    process_group.share(task)
    fit = task.start(replace(job.runtime, process_group=process_group))
    progress = job.progress("geometry", fit.iterations)
    run.checkpoint.attach(fit, progress)
    process_group.share(fit.state() if fit.done else None)
    held_out, scores = validation_pixels(job, capture), run.checkpoint.notes.setdefault("held_out", [])
    for scene in fit.scenes(progress, run.checkpoint):
        preview(job, scene, task.training_images[0])
        if held_out is not None:
            validate(job, scene, held_out, scores)
    run.summary.update(background=task.kind, space=task.space, **scene.field.summary(), held_out=scores)
    if isinstance(fit, VoxelFit):
        pixels = typical_pixels_per_voxel(scene.field.space, scene.field.voxel, task.views, task.points)
        run.summary["pixels_per_voxel"] = round(pixels, 2)
        warn_of_lost_detail(job, pixels, task.training_images, task.space)
        gains = {view.name: tuple(own) for view, own in zip(views, fit.gains, strict=True)}
        if any(own != UNIT_GAINS for own in gains.values()):
            others = [view for view in capture.views if view.split != "train" and view.image is not None]
            for image in job.training_images(others, EXPOSURE_LONG_SIDE):  # these photos are recolored too
                gains[image.view.name] = gains_from_render(scene, image.camera, image.color)
        capture = with_gains(capture, gains)
    return scene, capture


def load_photos(job: Job, capture: Capture) -> tuple[Capture, list[TrainingImage]]:
    """Load the training photos; return the capture without photos that cannot be decoded, and warn of them."""
    others = [view for view in capture.views if view.split != "train" and view.image is not None]
    training_images, errors = load_readable_views(capture.split("train"), job.settings.geometry.long_side)
    errors |= load_readable_views(others, COMPARED_LONG_SIDE)[1]
    if errors:
        first = next(iter(errors.values()))
        sentence = f"{len(errors)} of {len(capture.views)} photos were left out: {first.sentence}"
        job.emit("warning", code="capture", sentence=sentence)
    return without_views(capture, errors), training_images


def help_to_learn(process_group: ProcessGroup) -> None:
    """Take part in the fits of rank 0 until there are no more. Writes and emits nothing."""
    while (task := process_group.share()) is not None:
        fit = task.start(replace(start_runtime(task.seed, task.threads, task.device), process_group=process_group))
        state = process_group.share()
        if state is not None:
            fit.resume(state)
        for _ in fit.scenes(Progress(lambda *_, **__: None, lambda: False, "geometry", fit.iterations)):
            pass


def import_scene(
    job: Job, capture: Capture, path: Path, networks: tuple[NerfNetwork, NerfNetwork], summary: dict
) -> Scene:
    """Import the NeRF of another program, and check that it reproduces some training photos."""
    views = capture.split("train")
    training_images = job.training_images(
        views[:: max(1, len(views) // COMPARED_VIEWS)][:COMPARED_VIEWS], COMPARED_LONG_SIDE
    )
    kind = background_kind_of(training_images)
    grays = {"alpha": 1.0, "black": 0.0} if kind == "alpha" else {kind: 0.0}
    device = job.runtime.device
    datasets = {}
    for name, gray in grays.items():  # without mattes
        flat = [replace(p, color=alpha_composite(p.color, p.alpha, gray), alpha=None) for p in training_images]
        datasets[name] = build_pixel_dataset(flat, "opaque", device)
    job.emit("stage", name="geometry", text=f"comparing {path.name} with {len(training_images)} photos")
    scene, alignment, psnr = import_nerf(
        networks, list(capture.views), datasets, job.settings.geometry.nerf, str(path), device, job.settings.seed
    )
    job.emit("stage", name="geometry", text=f"{path.name} is placed {alignment!r} and shows them at {psnr:.1f} dB")
    preview(job, scene, training_images[0])
    summary |= {"background": scene.background_kind, "space": alignment, **scene.field.summary()}
    summary |= {"nerf": str(path), "psnr": round(psnr, 2)}
    return scene


def preview(job: Job, scene: Scene, training_image: TrainingImage) -> None:
    """Render the view of a training image to preview.png."""
    path = job.project.path("preview.png")
    write_png(path, scene.render(training_image.camera, 1).color.cpu().numpy())
    job.emit("preview", path=str(path))


def validation_pixels(job: Job, capture: Capture) -> PixelDataset | None:
    """Return the pixels of some evenly chosen test views; None without test views or with a matte."""
    views = capture.split("test")
    training_images = job.training_images(views[:: max(1, len(views) // VALIDATION_VIEWS)])
    if not training_images:
        text = "no photo is held out: how well new views are rendered is not measured"
        job.emit("stage", name="geometry", text=text)
        return None
    if any(training_image.alpha is not None for training_image in training_images):
        return None
    return build_pixel_dataset(training_images, "opaque", job.runtime.device)


def validate(job: Job, scene: Scene, held_out: PixelDataset, scores: list[list[float]]) -> None:
    """Append the mean and worst PSNR of held-out views in dB to `scores`, and warn where the mean has dropped."""
    values = psnr_of_views(scene, held_out, seed=job.settings.seed)
    mean, worst = round(sum(values) / len(values), 2), round(min(values), 2)
    job.emit("stage", name="geometry", text=f"held-out views {mean} dB, the worst {worst} dB")
    if scores and mean < scores[-1][0] - MAX_PSNR_DROP:
        job.emit(
            "warning",
            code="held_out",
            sentence=f"Held-out views became worse in the last level, from {scores[-1][0]} to {mean} dB: "
            "the photos do not settle the geometry. More photos between these, or fewer iterations, would.",
        )
    scores.append([mean, worst])


def warn_of_lost_detail(job: Job, pixels: float, training_images: list[TrainingImage], space: str) -> None:
    """Warn where voxels that span this many pixels lose most of the photos' detail, and name a sufficient resolution."""
    some = training_images[:: max(1, len(training_images) // DETAIL_PHOTOS)]
    kept = float(np.mean(psnr_without_detail([image.color for image in some], pixels)))
    if kept >= MIN_KEPT_PSNR:
        return
    settings = job.settings.geometry
    name, levels = (
        ("geometry.levels", settings.levels) if space == "box" else ("geometry.open.levels", settings.open.levels)
    )
    voxels = levels[-1].voxels
    job.emit(
        "warning",
        code="detail",
        sentence=f"A voxel spans {pixels:.1f} pixels where the photos look, and without so much detail the photos "
        f"themselves are {kept:.1f} dB from what they were: what is finer is blurred. {name} ends at {voxels} voxels; "
        f"{math.ceil(voxels * pixels / GOOD_PIXELS_PER_VOXEL)} would do, with more memory and time.",
    )


def training_points(job: Job, capture: Capture, training_images: list[TrainingImage], kind: str) -> SparsePoints | None:
    """Return sparse points observed by the training photos: the capture's, or triangulated; None where not needed."""
    if kind != "opaque" or job.settings.geometry.space == "box":
        return None
    if capture.splats is not None and has_kernels():
        from ..splats.visibility import sample_surface_points

        cameras = [training_image.camera for training_image in training_images]
        gaussians = read_captured_gaussians(capture.splats, cameras, job.emit)
        return sample_surface_points(gaussians, cameras, job.progress("points", len(cameras)).step)
    if capture.points is not None and len(capture.points.view):
        return capture.points.seen_by([n for n, view in enumerate(capture.views) if view.split == "train"])
    if find_spec("pycolmap") is None:
        job.emit(
            "warning",
            code="points",
            sentence="The capture has no sparse points, and without the package pycolmap none can be found: "
            "nothing but the photos tells where space is empty. Install it for a better scene.",
        )
        return None
    try:
        return triangulate(training_images, cores.core_count(), job.progress("points", len(training_images)))
    except Cancelled:
        raise
    except KarfError as error:
        job.emit("warning", code="points", sentence=f"No sparse points: {error.sentence}")
        return None
