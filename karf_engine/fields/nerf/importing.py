"""Import of NeRFs trained elsewhere: alignment of their world with the capture's.

Checkpoints do not record how a program has moved and scaled the poses. Import tries the known alignments and keeps the
one that renders the photos best.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from ...capture.camera import Camera
from ...capture.capture import View
from ...errors import DataError
from ...project.settings import NerfSettings
from ..extent import focus_point, mean_frustum, mean_pose, similarity, to_ndc
from ..rendering.rays import PixelDataset
from ..rendering.space import Box, StraightSpace, space_to_device
from ..scene import Scene, psnr_of_views
from .field import NerfField, NerfNetwork, NerfSampling
from .fit import MEASURED_RAYS, surface_bounds
from .start import OBJECT_DISTANCE

SYNTHETIC_RANGE = (2.0, 6.0)  # near and far depth of NeRF-synthetic
LLFF_NEAR = 0.9  # near depth of LLFF outside NDC, share of the smallest depth
MIN_PSNR = 20.0
TRIED_PIXELS = 600  # per photo


@dataclass(frozen=True)
class Alignment:
    """A candidate space of a NeRF, with the range of its rays (see `NerfSampling`)."""

    name: str
    space: StraightSpace
    near: float
    far: float
    in_disparity: bool = False


def candidate_alignments(views: list[View], settings: NerfSettings) -> list[Alignment]:
    """Return the known alignments of all views; those of LLFF if depth bounds are declared."""
    found = []
    if settings.near and settings.far:
        found.append(Alignment("as it is, near and far as set", Box(), settings.near, settings.far))
    found.append(Alignment("as it is, near 2 and far 6", Box(), *SYNTHETIC_RANGE))
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distance = float(np.mean([np.linalg.norm(camera.position - center) for camera in cameras]))
    scale = OBJECT_DISTANCE / distance
    near, far = (value / scale for value in SYNTHETIC_RANGE)
    found.append(Alignment("scaled", similarity(scale, np.eye(3), center), near, far))
    bounds = [view.depth_bounds for view in views if view.depth_bounds]
    if not bounds:
        return found
    near, far = LLFF_NEAR * min(low for low, _ in bounds), max(high for _, high in bounds)
    found.append(Alignment("as it is, LLFF's bounds", Box(), near, far))
    frustum = mean_frustum(views, None)
    found.append(Alignment("LLFF in NDC", to_ndc(frustum, views), 0.0, 1.0))
    middle = mean_pose(cameras)
    scale = 1 / frustum.near  # the smallest depth becomes 1 / 0.75
    found.append(Alignment("LLFF recentered", similarity(scale, middle[:3, :3].T, middle[:3, 3]), near, far))
    found.append(Alignment("LLFF spherified", spherify_alignment(cameras), near, far, in_disparity=True))
    return found


def spherify_alignment(cameras: list[Camera]) -> StraightSpace:
    """Return LLFF's alignment of surrounding cameras: on a unit sphere, with up away from the focus point."""
    middle = mean_pose(cameras)
    # the constant vector below is in the axes of the mean pose
    to_middle = middle[:3, :3].T
    positions = np.stack([to_middle @ (camera.position - middle[:3, 3]) for camera in cameras])
    focus = to_middle @ (focus_point(cameras).numpy() - middle[:3, 3])
    up = (positions - focus).mean(0)
    up /= np.linalg.norm(up)
    right = np.cross([0.1, 0.2, 0.3], up)
    right /= np.linalg.norm(right)
    to_sphere = np.stack([right, np.cross(up, right), up]) @ to_middle
    center = focus_point(cameras).numpy()
    radius = np.sqrt(np.mean([np.sum((camera.position - center) ** 2) for camera in cameras]))
    return similarity(1 / radius, to_sphere, center)


def import_nerf(
    networks: tuple[NerfNetwork, NerfNetwork],
    views: list[View],
    datasets: dict[str, PixelDataset],
    settings: NerfSettings,
    source: str,
    device: torch.device,
    seed: int = 0,
) -> tuple[Scene, str, float]:
    """Align networks with a capture.

    Args:
        networks: Coarse and fine.
        views: All views of the capture.
        datasets: Some training photos, by the kind of background.
        settings: Samples per ray, and near and far if set.
        source: Name of the networks in errors.
        device: Device of the scene.
        seed: Of the compared pixels and of the rays that measure the bounds.

    Returns:
        The scene, the name of the alignment, and its mean PSNR in dB.

    Raises:
        DataError: No alignment reaches MIN_PSNR.
    """
    coarse, fine = networks
    tried = []
    for alignment in candidate_alignments(views, settings):
        near, far, in_disparity = alignment.near, alignment.far, alignment.in_disparity
        sampling = NerfSampling(near, far, in_disparity, settings.coarse_samples, settings.fine_samples)
        space = space_to_device(alignment.space, device)
        field = NerfField(coarse, fine, sampling, space, torch.zeros(2, 3)).to(device).requires_grad_(False)
        for kind, dataset in datasets.items():
            scene = Scene(field, None, kind, 1.0)
            psnr = float(np.mean(psnr_of_views(scene, dataset, TRIED_PIXELS, seed)))
            tried.append((psnr if np.isfinite(psnr) else 0.0, alignment.name, field, scene))
    psnr, name, field, scene = max(tried, key=lambda entry: entry[0])
    if psnr < MIN_PSNR:
        names = ", ".join(dict.fromkeys(f"{entry[1]!r}" for entry in tried))
        raise DataError(
            f"{source} does not show this capture: of {names} the best, {name!r}, reaches {psnr:.1f} dB of the "
            f"{MIN_PSNR:g} dB needed.",
            "Give the capture it was trained on, as it was given to that program; geometry.nerf.near and .far may help.",
        )
    dataset = datasets[scene.background_kind]
    index = torch.randint(len(dataset), (MEASURED_RAYS,), generator=torch.Generator().manual_seed(seed))
    field.bounds = surface_bounds(field, dataset.rays(index.to(dataset.color.device)))
    return scene, name, psnr
