"""Stage 1: coarse masks -> F_s (segmentation.safetensors), the objects' rays (surface.safetensors) and a report.

Options: masks (folder MASKS/<object>/<photo stem>.png; the project's own masks by default).
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from scipy.ndimage import binary_erosion
from scipy.spatial import cKDTree
from torch import Tensor

from ..capture.capture import View
from ..color import srgb_to_lab, to_bytes
from ..errors import DataError
from ..fields.files import load_scene
from ..fields.scene import Scene
from ..files import read_json, write_json
from ..heads.fields import SegmentationField
from ..heads.files import ObjectSurface, save_segmentation, save_surface
from ..heads.fit import fit_on_points, fit_on_rays
from ..heads.rendering import segment_cache
from ..metrics.images import iou
from ..names import check_names
from ..plates import Plate
from ..progress import Emit
from ..rendering.rays import camera_rays
from ..rendering.surface_cache import SurfaceCache, cache_surface, join_caches
from ..segmentation.coarse_masks import CoarseMask, copy_masks, find_masks, load_mask
from ..segmentation.label_solve import Labels, has_seeds, solve_labels
from ..segmentation.surface_points import SurfacePoints, merge_samples
from ..segmentation.votes import mask_confidence, mask_targets, vote_on_points
from ..training.unfinished import Unfinished
from ..wire import Request
from .job import Job, StageRun, open_job, run_stage

VERSION = 1
MOST_POINTS = 60_000  # of a label solve, about: finer ones have few votes each, and colors outvote their neighbors
LABEL_SAMPLES = 3  # a ray: labels are of the surface, and the first and last of many samples lie off it
CACHE_STEP = 1.0  # voxels; the later stages need where a ray ends, not the last digit of its color
NEAR_VOXELS = 8.0
BOX_MARGIN_VOXELS = 6.0
LOW_PRECISION = 0.6
SURE = 0.9
MIN_SURE_PIXELS = 50


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Segment the objects of the given masks in the whole capture."""
    job = open_job(request, emit, should_stop)
    job.project.require("geometry")
    capture = job.capture()
    folder = Path(job.options.get("masks") or job.project.masks_folder)
    masks = find_masks(folder, capture)
    digests = [[m.object_name, m.view.name, hashlib.sha256(m.path.read_bytes()).hexdigest()] for m in masks]
    with run_stage(job, "segmentation", VERSION, digests) as run:
        if run is None:
            return
        scene = load_scene(job.project.checked(job.project.geometry_file), job.runtime.device)
        cached = cache_views(job, scene, masks, list(capture.split("train")))
        report = segment(job, scene, cached, run)
        run.facts["objects"] = report["objects"]
        write_json(run.output(job.project.segmentation_report), report)
        if folder.resolve() != job.project.masks_folder.resolve():
            copy_masks(masks, run.output(job.project.masks_folder))
    job.artifact("segmentation", job.project.segmentation_file)


@dataclass(frozen=True)
class CachedViews:
    """Plates, their surface samples, and the coarse masks: masks[v] = {class number: bool [H, W]} of plate v."""

    objects: list[str]
    plates: list[Plate]
    masks: list[dict[int, np.ndarray]]
    cache: SurfaceCache
    first: list[int]  # of each plate's pixels in the cache's index

    def targets(self) -> tuple[np.ndarray, np.ndarray]:
        """Votes [N, K+1] and confidence [N] of all pixels; confidence 0 in views without masks."""
        n_classes = len(self.objects) + 1
        n_pixels = self.first[-1]
        votes, confidence = np.full((n_pixels, n_classes), 1.0 / n_classes), np.zeros(n_pixels)
        for number, masks in enumerate(self.masks):
            if masks:
                pixels = slice(self.first[number], self.first[number + 1])
                votes[pixels] = mask_targets(masks, n_classes).reshape(-1, n_classes)
                confidence[pixels] = mask_confidence(masks).ravel()
        return votes, confidence

    def colors(self) -> np.ndarray:
        """Photo colors of all pixels, [N, 3]."""
        return np.concatenate([plate.color.reshape(-1, 3) for plate in self.plates])


def cache_views(job: Job, scene: Scene, masks: list[CoarseMask], views: list[View]) -> CachedViews:
    """Load masks, choose views spread round the scene, and cache their surface."""
    settings = job.settings.segmentation
    objects = sorted({mask.object_name for mask in masks})
    marked = list(dict.fromkeys(mask.view.name for mask in masks))
    chosen = spread_views(views, marked, settings.cache_views)
    # unmarked views only have to show colors: a smaller picture of them does
    plates = [job.plates([v], None if v.name in marked else settings.cache_long_side)[0] for v in chosen]
    per_view: list[dict[int, np.ndarray]] = [{} for _ in chosen]
    names = [view.name for view in chosen]
    for mask in masks:
        number = names.index(mask.view.name)
        per_view[number][objects.index(mask.object_name) + 1] = load_mask(mask, plates[number])

    sizes = [plate.camera.width * plate.camera.height for plate in plates]
    first = [0, *np.cumsum(sizes).tolist()]
    progress = job.progress("surface", first[-1])
    parts = []
    for plate in plates:
        rays = camera_rays(plate.camera, job.runtime.device)
        parts.append(cache_surface(scene.field, rays, settings.samples_per_ray, CACHE_STEP, progress))
    shifted = [
        SurfaceCache(p.positions, p.distances, p.viewdirs, p.opacity, p.index + start)
        for p, start in zip(parts, first[:-1], strict=True)
    ]
    return CachedViews(objects, plates, per_view, join_caches(shifted), first)


def spread_views(views: list[View], first: list[str], count: int) -> list[View]:
    """`count` views: those named in `first`, then always the one whose camera is farthest from all chosen."""
    positions = np.stack([view.camera.position for view in views])
    chosen = [number for number, view in enumerate(views) if view.name in first] or [0]
    while len(chosen) < min(count, len(views)):
        distance = np.linalg.norm(positions[:, None] - positions[chosen], axis=2).min(1)
        chosen.append(int(distance.argmax()))
    return [views[number] for number in chosen]


def segment(job: Job, scene: Scene, cached: CachedViews, run: StageRun) -> dict:
    """Labels, F_s (resumed where it is unfinished), and the objects' rays; returns the report."""
    settings, cache = job.settings.segmentation, cached.cache
    votes, confidence = cached.targets()
    if not len(cache):
        raise DataError("The learned scene shows nothing solid in any photo.", "Learn it again, with other settings.")
    index = cache.index.cpu().numpy()
    votes, confidence = votes[index], confidence[index] * (cache.opacity > 0.3).cpu().numpy()
    opacity = cache.opacity.cpu().numpy()

    points = _surface_points(cached, scene.field.voxel)
    if settings.labels == "surface":
        labels = _solve(job, scene, cached.objects, points, votes, confidence * opacity)
    else:
        labels = _votes_only(points, votes, (confidence > 0) * opacity)
    _warn_of_low_precision(job, cached.objects, labels)
    karf = _fit(job, scene, cached, points, labels, votes, confidence, run.unfinished)
    probabilities = segment_cache(karf, scene.field, cache)
    _save(job, karf, cached, probabilities, run)
    return _report(cached, labels, probabilities)


def _surface_points(cached: CachedViews, voxel: float) -> SurfacePoints:
    """The surface in points as fine as the voxels, or coarser where these are so fine that few rays meet in one."""
    points = _merged(cached, voxel)
    if len(points) <= MOST_POINTS:
        return points
    return _merged(cached, voxel * math.sqrt(len(points) / MOST_POINTS))


def _merged(cached: CachedViews, grain: float) -> SurfacePoints:
    cache = cached.cache.thinned(LABEL_SAMPLES)
    lab = srgb_to_lab(cached.colors()[cache.index.cpu().numpy()])
    # samples of a silhouette ray lie far apart, and its color is a mixture
    confidence = torch.exp(-cache.spread / (4 * grain)) * cache.opacity
    return merge_samples(cache.positions.cpu().numpy(), lab, confidence.cpu().numpy(), grain)


def _solve(
    job: Job, scene: Scene, objects: list[str], points: SurfacePoints, votes: np.ndarray, confidence: np.ndarray
) -> Labels:
    field = scene.field
    targets, strength = vote_on_points(points.point_of_sample, votes, confidence, len(points))
    _require_all(objects, has_seeds(targets, strength))
    positions = torch.from_numpy(points.positions).float().to(job.runtime.device)
    normals = field.normals(positions).cpu().numpy()
    random = np.random.default_rng(job.settings.seed)
    job.emit("stage", name="labels", text=f"{len(points)} surface points")
    return solve_labels(
        points.positions, points.lab, normals, points.grain, targets, strength, job.settings.segmentation.rounds, random
    )


def _require_all(objects: list[str], is_there: Sequence[bool]) -> None:
    """Raise DataError for the first object of which there is nothing."""
    for name, found in zip(objects, is_there, strict=True):
        if not found:
            raise DataError(
                f"Nothing in the scene belongs to {name!r}.", "Mark it more generously, or in another view."
            )


def _votes_only(points: SurfacePoints, votes: np.ndarray, confidence: np.ndarray) -> Labels:
    """The masks' votes on the surface as they are: the ceiling, when the masks are true ones."""
    targets, strength = vote_on_points(points.point_of_sample, votes, confidence, len(points))
    targets[strength == 0] = np.eye(votes.shape[1])[0]
    return Labels(targets, np.ones(votes.shape[1] - 1))


def _warn_of_low_precision(job: Job, objects: list[str], labels: Labels) -> None:
    for name, precision in zip(objects, labels.precision, strict=True):
        if precision < LOW_PRECISION:
            job.emit(
                "warning",
                code="precision",
                sentence=f"Only {precision:.0%} of what looks like {name!r} is marked as it: "
                "add a mask from another view, or mark it more tightly.",
            )


def _fit(
    job: Job,
    scene: Scene,
    cached: CachedViews,
    points: SurfacePoints,
    labels: Labels,
    votes: np.ndarray,
    confidence: np.ndarray,
    unfinished: Unfinished,
) -> SegmentationField:
    settings, device = job.settings.segmentation, job.runtime.device
    classes = labels.classes
    _require_all(cached.objects, [(classes == number).any() for number in range(1, len(cached.objects) + 1)])
    margin = BOX_MARGIN_VOXELS * scene.field.voxel
    if settings.labels == "masks":  # as in the paper, nothing bounds the objects
        boxes = scene.field.bounds.expand(len(cached.objects), 2, 3).clone()
    else:
        boxes = _object_boxes(points.positions, classes, len(cached.objects), margin).to(device)
    karf = SegmentationField(boxes, scene.field.n_features, settings).to(device)
    progress = job.progress("segmentation", settings.iterations)
    if settings.labels == "masks":
        marked = torch.from_numpy(np.flatnonzero(confidence > 0)).to(device)
        targets = torch.from_numpy(votes).float().to(device)[marked]
        rays = _select(cached.cache, marked)
        fit_on_rays(karf, scene.field, rays, targets, settings, job.runtime, progress, unfinished)
        return karf.requires_grad_(False)
    top_two = np.sort(labels.probabilities, 1)[:, -2:]
    positions = torch.from_numpy(points.positions).float().to(device)
    fit_on_points(
        karf,
        scene.field,
        positions,
        torch.from_numpy(classes).to(device),
        torch.from_numpy(top_two[:, 1] - top_two[:, 0]).float().to(device),
        torch.from_numpy(_near_objects(points.positions, classes, NEAR_VOXELS * scene.field.voxel)).to(device),
        settings,
        job.runtime,
        progress,
        unfinished,
    )
    return karf.requires_grad_(False)


def _select(cache: SurfaceCache, index: Tensor) -> SurfaceCache:
    return SurfaceCache(
        cache.positions[index], cache.distances[index], cache.viewdirs[index], cache.opacity[index], cache.index[index]
    )


def _object_boxes(positions: np.ndarray, classes: np.ndarray, n_objects: int, margin: float) -> Tensor:
    boxes = []
    for k in range(1, n_objects + 1):
        own = positions[classes == k]
        boxes.append(np.stack([own.min(0) - margin, own.max(0) + margin]))
    return torch.from_numpy(np.stack(boxes)).float()


def _near_objects(positions: np.ndarray, classes: np.ndarray, reach: float) -> np.ndarray:
    """True for points within about `reach` of an object's point, [p]."""
    tree = cKDTree(positions[classes > 0], balanced_tree=False, compact_nodes=False)
    return np.isfinite(tree.query(positions, distance_upper_bound=reach)[0])


def _save(job: Job, karf: SegmentationField, cached: CachedViews, probabilities: Tensor, run: StageRun) -> None:
    """Write F_s, and the object rays that the palette and recoloring stages learn from."""
    settings = job.settings.segmentation
    save_segmentation(run.output(job.project.segmentation_file), karf, cached.objects, settings)
    cache = cached.cache
    label = probabilities.argmax(1)
    rays = torch.nonzero(label > 0).squeeze(1)
    sure = _interior(cached, label, probabilities)
    colors = torch.from_numpy(to_bytes(cached.colors()))
    view = np.searchsorted(cached.first, cache.index[rays].cpu().numpy(), side="right") - 1
    surface = ObjectSurface(
        positions=cache.positions[rays],
        viewdirs=cache.viewdirs[rays],
        colors=colors[cache.index[rays].cpu()],
        object=(label[rays] - 1).to(torch.uint8),
        sure=sure[rays.cpu()],
        view=torch.from_numpy(view).to(torch.int16),
    )
    save_surface(run.output(job.project.surface_file), surface, cached.objects, settings)


def _interior(cached: CachedViews, label: Tensor, probabilities: Tensor) -> Tensor:
    """True for cached rays well inside an object: surely it, and one pixel from its border, [n]."""
    n_pixels = cached.first[-1]
    index = cached.cache.index.cpu().numpy()
    picture_label = np.zeros(n_pixels, np.int64)
    picture_label[index] = label.cpu().numpy()
    inside = np.zeros(n_pixels, bool)
    for number, plate in enumerate(cached.plates):
        pixels = slice(cached.first[number], cached.first[number + 1])
        labels = picture_label[pixels].reshape(plate.camera.height, plate.camera.width)
        for k in range(1, len(cached.objects) + 1):
            inside[pixels] |= binary_erosion(labels == k).ravel()
    inside = inside[index] & (probabilities.amax(1) > SURE).cpu().numpy()
    for k in range(1, len(cached.objects) + 1):
        own = picture_label[index] == k
        # an object too thin to have an inside speaks with all its pixels
        if (own & inside).sum() < MIN_SURE_PIXELS:
            inside |= own
    return torch.from_numpy(inside)


def view_names(job: Job, which: str) -> list[str]:
    """The `views` that segmentation looked at, in the order that the objects' rays number them by, or the `marked` ones."""
    path = job.project.checked(job.project.segmentation_report)
    report = read_json(path, "report")
    return check_names(report.get(which) if isinstance(report, dict) else None, path, "a view")


def _report(cached: CachedViews, labels: Labels, probabilities: Tensor) -> dict:
    """How well the result agrees with the marks it came from, for the user."""
    picture_label = np.zeros(cached.first[-1], np.int64)
    picture_label[cached.cache.index.cpu().numpy()] = probabilities.argmax(1).cpu().numpy()
    agreement: dict[str, list[float]] = {name: [] for name in cached.objects}
    for number, masks in enumerate(cached.masks):
        pixels = picture_label[cached.first[number] : cached.first[number + 1]]
        for k, mask in masks.items():
            agreement[cached.objects[k - 1]].append(round(iou(pixels.reshape(mask.shape) == k, mask), 4))
    return {
        "objects": cached.objects,
        "precision": {n: round(float(p), 4) for n, p in zip(cached.objects, labels.precision, strict=True)},
        "iou_with_marks": agreement,
        "views": [plate.view.name for plate in cached.plates],
        "marked": [plate.view.name for plate, masks in zip(cached.plates, cached.masks, strict=True) if masks],
        "surface_points": len(labels.probabilities),
    }
