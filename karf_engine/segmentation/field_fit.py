"""Train F_s on surface labels, or on the masks alone as in the paper, and select the rays that it shows objects on."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import torch
from scipy.ndimage import binary_erosion
from torch import Tensor

from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.training.checkpoint import Checkpoint
from ..heads.fields import SegmentationField
from ..heads.fit import fit_on_points, fit_on_rays
from ..heads.training_rays import BACKGROUND, MIN_INTERIOR_PIXELS, ObjectSurface
from ..io.color import to_bytes
from ..project.settings import SegmentationSettings
from .labels import LabelledSurface
from .views import CachedViews
from .votes import RayVotes

NEAR_VOXELS = 8.0
BOX_MARGIN_VOXELS = 6.0


def fit_to_labels(
    scene_field: Field,
    surface: LabelledSurface,
    settings: SegmentationSettings,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> SegmentationField:
    """Return a frozen F_s, trained by cross-entropy on labelled points, and 0 outside a box around each object's points.

    The arguments are those of `heads.fit.fit_on_points`; some points of `surface` must belong to an object.
    """
    positions, classes, voxel = surface.points.positions, surface.labels.classes, scene_field.voxel
    boxes = torch.from_numpy(surface.boxes(BOX_MARGIN_VOXELS * voxel)).float().to(runtime.device)
    segmentation = SegmentationField(boxes, scene_field.n_features, settings).to(runtime.device)
    fit_on_points(
        segmentation,
        scene_field,
        torch.from_numpy(positions).float().to(runtime.device),
        torch.from_numpy(classes).to(runtime.device),
        torch.from_numpy(surface.labels.margin).float().to(runtime.device),
        torch.from_numpy(surface.near_objects(NEAR_VOXELS * voxel)).to(runtime.device),
        torch.from_numpy(surface.fixed).to(runtime.device),
        settings,
        runtime,
        progress,
        checkpoint,
    )
    return segmentation.requires_grad_(False)


def fit_to_masks(
    scene_field: Field,
    n_objects: int,
    cache: SurfaceCache,
    votes: RayVotes,
    settings: SegmentationSettings,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> SegmentationField:
    """Return a frozen F_s, trained on the coarse masks as they are (paper, Eq. 12), without boxes around the objects.

    All rays of the marked views count, whatever their opacity. The arguments are those of `heads.fit.fit_on_rays`.
    """
    boxes = scene_field.bounds.expand(n_objects, 2, 3).clone()
    segmentation = SegmentationField(boxes, scene_field.n_features, settings).to(runtime.device)
    marked = torch.from_numpy(np.flatnonzero(votes.marked)).to(runtime.device)
    targets = torch.from_numpy(votes.targets).float().to(runtime.device)[marked]
    fit_on_rays(segmentation, scene_field, _select(cache, marked), targets, settings, runtime, progress, checkpoint)
    return segmentation.requires_grad_(False)


def _select(cache: SurfaceCache, rays: Tensor) -> SurfaceCache:
    return SurfaceCache(*[getattr(cache, item.name)[rays] for item in fields(SurfaceCache)])


CONFIDENT = 0.9  # least probability of the class of an interior ray


def object_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """Return the cached rays that end on an object. probabilities: [n, K+1], of the n rays as F_s renders them."""
    label = probabilities.argmax(1)
    on_object = torch.nonzero(label > 0).squeeze(1)
    return _select_rays(cached, on_object, label - 1, _interior_rays(cached, label, probabilities))


def whole_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """Return all cached rays, the sum of Eq. 11, all interior; rays without an object have the number `BACKGROUND`."""
    label = probabilities.argmax(1)
    everything = torch.arange(len(label), device=label.device)
    return _select_rays(cached, everything, torch.where(label > 0, label - 1, BACKGROUND), label >= 0)


def _select_rays(cached: CachedViews, rays: Tensor, owner: Tensor, interior: Tensor) -> ObjectSurface:
    """Return some cached rays. owner: [n] object number of every cached ray; interior: [n] bool."""
    cache, views = cached.cache, cached.views
    colors = torch.from_numpy(to_bytes(views.colors()))
    view = np.searchsorted(views.offsets, cache.index[rays].cpu().numpy(), side="right") - 1
    return ObjectSurface(
        positions=cache.positions[rays],
        viewdirs=cache.viewdirs[rays],
        colors=colors[cache.index[rays].cpu()],
        object=owner[rays].to(torch.uint8),
        interior=interior.cpu()[rays.cpu()],
        view=torch.from_numpy(view).to(torch.int16),
    )


def _interior_rays(cached: CachedViews, label: Tensor, probabilities: Tensor) -> Tensor:
    """Return True for confident rays at least one pixel from the object's border, [n].

    If an object is so thin that fewer than MIN_INTERIOR_PIXELS remain, all of its rays count.
    """
    classes = label.cpu().numpy()
    objects = range(1, len(cached.views.objects) + 1)
    eroded = [
        np.logical_or.reduce([binary_erosion(picture == k) for k in objects]).ravel()
        for picture in cached.pictures(classes)
    ]
    index = cached.cache.index.cpu().numpy()
    inside = np.concatenate(eroded)[index] & (probabilities.amax(1) > CONFIDENT).cpu().numpy()
    for k in objects:
        own = classes == k
        if (own & inside).sum() < MIN_INTERIOR_PIXELS:
            inside |= own
    return torch.from_numpy(inside)
