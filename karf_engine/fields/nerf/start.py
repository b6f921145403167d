"""A fresh fit of a NeRF: where it lies in the world, and where its rays are sampled."""

from __future__ import annotations

import numpy as np
import torch

from ...capture.capture import SparsePoints, View
from ...compute.runtime import Runtime
from ...project.settings import NerfSettings
from ..extent import farthest_depth, focus_point, nearest_depth
from ..fit import FitInputs
from ..rendering.rays import PixelDataset
from ..rendering.space import StraightSpace
from ..rendering.space_values import space_on
from ..spaces import middle_frustum, ndc, similarity
from .field import NerfField, NerfNetwork, NerfSampling, NerfShape
from .fit import NerfFit

OBJECT_DISTANCE = 4.0  # distance of the cameras in a NeRF's own units: that of the NeRF-synthetic captures
OBJECT_RANGE = (0.5, 1.5)  # of that distance is sampled: 2 to 6 there
OPEN_RANGE = (0.1, 20.0)  # of it, where how near and far the scene is is not known
POINT_RANGE = (0.9, 1.1)  # of the nearest and farthest sparse point


def start_nerf_fit(inputs: FitInputs) -> NerfFit:
    """A fresh fit of a NeRF that suits the cameras.

    Raises:
        BadRequest: A frustum was asked for, and how near the scene is is not known.
    """
    settings, kind = inputs.settings.nerf, inputs.background_kind
    space, sampling = place_nerf(kind, inputs.space, inputs.views, inputs.points, settings)
    return fresh_fit(inputs.dataset, kind, space_on(space, inputs.runtime.device), sampling, settings, inputs.runtime)


def fresh_fit(
    dataset: PixelDataset,
    kind: str,
    space: StraightSpace,
    sampling: NerfSampling,
    settings: NerfSettings,
    runtime: Runtime,
) -> NerfFit:
    """Fresh networks in a space."""
    shape = NerfShape(
        depth=settings.depth,
        width=settings.width,
        view_width=settings.width // 2,
        position_frequencies=settings.position_frequencies,
        direction_frequencies=settings.direction_frequencies,
    )
    nothing = torch.tensor([[-1.0] * 3, [1.0] * 3])
    field = NerfField(NerfNetwork(shape), NerfNetwork(shape), sampling, space, nothing).to(runtime.device)
    return NerfFit(dataset, kind, settings, runtime, field)


def place_nerf(
    kind: str, space_name: str, views: list[View], points: SparsePoints | None, settings: NerfSettings
) -> tuple[StraightSpace, NerfSampling]:
    """Where a NeRF lies in the world, and where its rays are sampled.

    Cameras that look one way: NDC. Objects: the cameras stand OBJECT_DISTANCE round them. Scenes that extend all round:
    the cameras stand at a distance of 1, and samples are even in disparity up to the farthest point.
    """
    counts = {"coarse": settings.coarse_samples, "fine": settings.fine_samples}
    if space_name == "frustum":
        return ndc(middle_frustum(views, points), views), NerfSampling(0.0, 1.0, **counts)
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distances = np.array([np.linalg.norm(camera.position - center) for camera in cameras])
    is_open = kind == "opaque"
    near, far = _open_range(views, points, distances) if is_open else distances.mean() * np.array(OBJECT_RANGE)
    scale = (1.0 if is_open else OBJECT_DISTANCE) / distances.mean()
    space = similarity(scale, np.eye(3), center)
    return space, NerfSampling(settings.near or float(near), settings.far or float(far), is_open, **counts)


def _open_range(views: list[View], points: SparsePoints | None, distances: np.ndarray) -> tuple[float, float]:
    """Nearest and farthest distance at which an open scene is looked for, world units."""
    near, far = nearest_depth(views, points), farthest_depth(views, points)
    near = distances.mean() * OPEN_RANGE[0] if near is None else near * POINT_RANGE[0]
    far = distances.mean() * OPEN_RANGE[1] if far is None else far * POINT_RANGE[1]
    return float(near), float(far)
