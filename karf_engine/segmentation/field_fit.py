"""F_s from labels of the surface, or as in the paper from the masks alone."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import torch
from torch import Tensor

from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..fields.protocol import Field
from ..fields.rendering.surface_cache import SurfaceCache
from ..fields.training.checkpoint import Checkpoint
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
    """F_s, frozen, trained by cross-entropy on labelled surface points; 0 outside a box round each object's points.

    Args:
        scene_field: the frozen radiance field.
        surface: points with labels; each object has some.
        settings: of F_s and its training.
        runtime: device and random numbers.
        progress: counts iterations.
        checkpoint: resumes and saves the training; None trains from the start.
    """
    positions, classes, voxel = surface.points.positions, surface.labels.classes, scene_field.voxel
    boxes = torch.from_numpy(surface.boxes(BOX_MARGIN_VOXELS * voxel)).float().to(runtime.device)
    karf = SegmentationField(boxes, scene_field.n_features, settings).to(runtime.device)
    fit_on_points(
        karf,
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
    return karf.requires_grad_(False)


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
    """F_s, frozen, trained on the coarse masks as they are (paper, Eq. 12); nothing bounds the objects.

    Args:
        scene_field: the frozen radiance field.
        n_objects: K.
        cache: n rays with their surface samples.
        votes: of these rays; all rays of the marked views count, whatever their opacity.
        settings: of F_s and its training.
        runtime: device and random numbers.
        progress: counts iterations.
        checkpoint: resumes and saves the training; None trains from the start.
    """
    boxes = scene_field.bounds.expand(n_objects, 2, 3).clone()
    karf = SegmentationField(boxes, scene_field.n_features, settings).to(runtime.device)
    marked = torch.from_numpy(np.flatnonzero(votes.marked)).to(runtime.device)
    targets = torch.from_numpy(votes.targets).float().to(runtime.device)[marked]
    fit_on_rays(karf, scene_field, _select(cache, marked), targets, settings, runtime, progress, checkpoint)
    return karf.requires_grad_(False)


def _select(cache: SurfaceCache, rays: Tensor) -> SurfaceCache:
    return SurfaceCache(*[getattr(cache, item.name)[rays] for item in fields(SurfaceCache)])
