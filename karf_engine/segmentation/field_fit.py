"""Train F_s on surface labels, or on the masks alone as in the paper."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import torch
from torch import Tensor

from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..fields.fit import Checkpoint
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from ..heads.fields import SegmentationField
from ..heads.fit import fit_on_points, fit_on_rays
from ..project.settings import SegmentationSettings
from .labels import LabelledSurface
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
