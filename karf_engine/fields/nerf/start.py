"""The start of a NeRF fit: its space and the range of its rays."""

from __future__ import annotations

import numpy as np
import torch

from ...capture.capture import SparsePoints, View
from ...compute.runtime import Runtime
from ...project.settings import NerfSettings
from ..extent import focus_point, max_depth, mean_frustum, min_depth, similarity, to_ndc
from ..fit import FitInputs
from ..rendering.rays import PixelDataset
from ..rendering.space import StraightSpace, space_to_device
from .field import NerfField, NerfNetwork, NerfSampling, NerfShape
from .fit import NerfFit

OBJECT_DISTANCE = 4.0  # mean camera distance in the units of a NeRF, as in NeRF-synthetic
OBJECT_RANGE = (0.5, 1.5)  # sampled range of an object, mean camera distances
OPEN_RANGE = (0.1, 20.0)  # sampled range of an open scene of unknown depth, mean camera distances
POINT_RANGE = (0.9, 1.1)  # sampled range, shares of the smallest and the largest depth


def start_nerf_fit(inputs: FitInputs) -> NerfFit:
    """Begin a fit of a NeRF that suits the cameras.

    Raises:
        BadRequest: The requested frustum needs the depth of the scene, which is unknown.
    """
    settings, kind = inputs.settings.nerf, inputs.background_kind
    space, sampling = choose_space_and_sampling(kind, inputs.space, inputs.views, inputs.points, settings)
    return fresh_fit(
        inputs.dataset, kind, space_to_device(space, inputs.runtime.device), sampling, settings, inputs.runtime
    )


def fresh_fit(
    dataset: PixelDataset,
    kind: str,
    space: StraightSpace,
    sampling: NerfSampling,
    settings: NerfSettings,
    runtime: Runtime,
) -> NerfFit:
    """Begin a fit of fresh networks in a space."""
    shape = NerfShape(
        depth=settings.depth,
        width=settings.width,
        view_width=settings.width // 2,
        position_frequencies=settings.position_frequencies,
        direction_frequencies=settings.direction_frequencies,
    )
    unit_box = torch.tensor([[-1.0] * 3, [1.0] * 3])
    field = NerfField(NerfNetwork(shape), NerfNetwork(shape), sampling, space, unit_box).to(runtime.device)
    return NerfFit(dataset, kind, settings, runtime, field)


def choose_space_and_sampling(
    kind: str, space_name: str, views: list[View], points: SparsePoints | None, settings: NerfSettings
) -> tuple[StraightSpace, NerfSampling]:
    """Choose the space of a NeRF and the sampling of its rays.

    Forward-facing cameras: NDC. Objects: at a mean camera distance of OBJECT_DISTANCE. Open scenes: at a mean camera
    distance of 1, with samples evenly spaced in disparity.
    """
    coarse, fine = settings.coarse_samples, settings.fine_samples
    if space_name == "frustum":
        return to_ndc(mean_frustum(views, points), views), NerfSampling(0.0, 1.0, False, coarse, fine)
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distances = np.array([np.linalg.norm(camera.position - center) for camera in cameras])
    is_open = kind == "opaque"
    near, far = _open_range(views, points, distances) if is_open else distances.mean() * np.array(OBJECT_RANGE)
    scale = (1.0 if is_open else OBJECT_DISTANCE) / distances.mean()
    space = similarity(scale, np.eye(3), center)
    return space, NerfSampling(settings.near or float(near), settings.far or float(far), is_open, coarse, fine)


def _open_range(views: list[View], points: SparsePoints | None, distances: np.ndarray) -> tuple[float, float]:
    """Return the sampled range of an open scene, world units."""
    near, far = min_depth(views, points), max_depth(views, points)
    near = distances.mean() * OPEN_RANGE[0] if near is None else near * POINT_RANGE[0]
    far = distances.mean() * OPEN_RANGE[1] if far is None else far * POINT_RANGE[1]
    return float(near), float(far)
