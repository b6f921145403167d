"""Rasterization of Gaussians, and the choice between its two back ends.

After Kerbl et al. 2023 ("3D Gaussian Splatting for Real-Time Radiance Field Rendering"), with the screen filter of
Mip-Splatting (Yu et al. 2024). `compiled` runs numba's kernels on the processor, `gsplat_view` gsplat's on a CUDA card.
"""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from functools import cache
from importlib.util import find_spec

import numpy as np
import torch

from ..capture.camera import Camera
from ..compute.kernels import has_kernels
from .gaussians import Gaussians
from .kernels.arrays import PIXEL_FILTER, Pinhole, ScreenFilter
from .view import RasterizedView, TrainedTable

Device = torch.device | str


def backend(device: Device) -> str | None:
    """Return what rasterizes for stages on this device: gsplat, numba (on the processor), or None."""
    if torch.device(device).type == "cuda" and torch.version.cuda and find_spec("gsplat") and _has_gsplat_kernels():
        return "gsplat"
    return "numba" if has_kernels() else None


@cache
def _has_gsplat_kernels() -> bool:
    """Load gsplat's kernels, which its source distribution compiles once, in minutes, by the CUDA toolkit."""
    try:
        with redirect_stdout(sys.stderr):  # where it tells of compiling; stdout is for events
            from gsplat.cuda import _backend  # pyright: ignore[reportMissingImports]
    except (ImportError, OSError, RuntimeError):  # no toolkit, another torch, or a compiler that fails
        return False
    return _backend._C is not None


def rasterize(
    gaussians: Gaussians, camera: Camera, confidence: np.ndarray | None = None, device: Device = "cpu"
) -> RasterizedView:
    """Rasterize Gaussians for a camera without its lens distortion. Raises OutOfMemory.

    confidence: [n] in [0, 1], fades colors to UNKNOWN_COLOR; None is the same as all 1, to the bit.
    """
    shown_by = pinhole(camera, gaussians.near, gaussians.screen_filter)
    if backend(device) == "gsplat":
        from .gsplat_view import GsplatView

        return GsplatView(torch.from_numpy(gaussians.table).to(device), shown_by, gaussians.background, confidence)
    from .compiled import CompiledView  # needs numba

    return CompiledView(gaussians.table, shown_by, gaussians.background, confidence)


def trained_table(gaussians: Gaussians, least: np.ndarray, device: Device = "cpu") -> TrainedTable:
    """Return a copy of the Gaussians' table for training. least: [n], log of the least scale."""
    if backend(device) == "gsplat":
        from .gsplat_view import GsplatTable

        return GsplatTable(gaussians, least, torch.device(device))
    from .compiled import CompiledTable  # needs numba

    return CompiledTable(gaussians, least)


def pinhole(camera: Camera, near: float, screen_filter: ScreenFilter = PIXEL_FILTER) -> Pinhole:
    """Return a camera for the back ends; lens distortion is ignored. near, screen_filter: see `Gaussians`."""
    world_to_camera = np.diag([1.0, -1, -1, 1]) @ np.linalg.inv(camera.camera_to_world)
    rotation, translation = world_to_camera[:3, :3].ravel(), world_to_camera[:3, 3]
    eye = camera.camera_to_world[:3, 3]
    rotation, translation, eye = (np.ascontiguousarray(each, np.float32) for each in (rotation, translation, eye))
    fx, fy, cx, cy = (np.float32(value) for value in (camera.fx, camera.fy, camera.cx, camera.cy))
    size = camera.width, camera.height
    return Pinhole(rotation, translation, eye, fx, fy, cx, cy, *size, np.float32(near), *screen_filter)
