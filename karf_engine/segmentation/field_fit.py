"""Train F_s on surface labels, or on the masks alone as in the paper, and select the rays that it shows objects on."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import torch
from scipy.ndimage import binary_erosion
from torch import Tensor

from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..fields.fit import Checkpoint
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from ..heads.fields import SegmentationField
from ..heads.fit import fit_on_points, fit_on_rays
from ..heads.training_rays import BACKGROUND, MIN_INTERIOR_PIXELS, ObjectSurface
from ..io.color import to_bytes
from ..project.settings import SegmentationSettings
from .labels import LabelledSurface
from .views import CachedViews, RayVotes

NEAR_VOXELS = 8.0
BOX_MARGIN_VOXELS = 6.0
CONFIDENT = 0.9  # least probability of the class of an interior ray


def fit_segmentation(
    scene_field: Field,
    cached: CachedViews,
    votes: RayVotes,
    surface: LabelledSurface,
    settings: SegmentationSettings,
    runtime: Runtime,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> SegmentationField:
    """Return a frozen F_s, trained on labelled points; 0 outside a box around each object's points.

    With `settings.labels` of `masks` it is trained on the coarse masks as they are (paper, Eq. 12), without boxes; all
    rays of the marked views then count, whatever their opacity. Some points of `surface` must belong to an object.
    """
    device, voxel, points = runtime.device, scene_field.voxel, surface.points.positions
    from_masks = settings.labels == "masks"
    if from_masks:
        boxes = scene_field.bounds.expand(len(surface.objects), 2, 3).clone()
    else:
        boxes = torch.from_numpy(surface.boxes(BOX_MARGIN_VOXELS * voxel)).float().to(device)
    segmentation = SegmentationField(boxes, scene_field.n_features, settings).to(device)
    training = settings, runtime, progress, checkpoint
    if from_masks:
        marked = torch.from_numpy(np.flatnonzero(votes.marked)).to(device)
        targets = torch.from_numpy(votes.targets).float().to(device)[marked]
        cache = SurfaceCache(*[getattr(cached.cache, item.name)[marked] for item in fields(SurfaceCache)])
        fit_on_rays(segmentation, scene_field, cache, targets, *training)
    else:
        parts = points, surface.labels.margin
        positions, certainty = (torch.from_numpy(part).float().to(device) for part in parts)
        parts = surface.labels.classes, surface.near_objects(NEAR_VOXELS * voxel), surface.fixed
        classes, near, fixed = (torch.from_numpy(part).to(device) for part in parts)
        fit_on_points(segmentation, scene_field, positions, classes, certainty, near, fixed, *training)
    return segmentation.requires_grad_(False)


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
    """Return True for confident rays at least one pixel from the object's border, [n]; all of a very thin object."""
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
