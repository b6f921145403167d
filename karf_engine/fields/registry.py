"""The registry of field kinds, and the task of fitting a field to photos, which each process of a group can begin.

A new kind is one file: a `Field`, its `Fit`, and a call of `register_field`, or an entry point `karf.fields` that is a
`FieldKind`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ..capture.capture import SparsePoints, View
from ..capture.training_images import TrainingImage, background_kind, solid_pixels
from ..compute import cores
from ..compute.progress import Emit
from ..compute.runtime import Runtime
from ..errors import BadRequest
from ..io.arguments import check_arguments
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import FIELD_KINDS, GeometrySettings
from .extent import choose_space
from .fit import Fit, FitInputs
from .nerf.field import NerfField
from .nerf.fit import start_nerf_fit
from .protocol import Field
from .rendering.rays import PixelDataset
from .voxels.field import VoxelField
from .voxels.renderers import prepare_kernels
from .voxels.start import start_voxel_fit

Wait = Callable[[Emit, Callable[[], bool]], None]  # waits; receives `emit` and `should_stop`


@dataclass(frozen=True)
class FieldKind:
    """One kind of field."""

    name: str  # in the setting `geometry.field` and in files
    start: Callable[[FitInputs], Fit]  # begins a fresh fit from photos
    restore: Callable[[dict[str, Any], dict[str, Tensor], torch.device | str], Field]  # see `Field.restore`
    # starts preparations that run while photos are read; returns a function that waits for them
    prepare: Callable[[GeometrySettings, torch.device], Wait] = lambda settings, device: lambda emit, should_stop: None


PLUGINS = "karf.fields"
_KINDS: dict[str, FieldKind] = {}


@check_arguments
def register_field(kind: FieldKind) -> None:
    """Register a kind of field for the setting `geometry.field` and for `load_scene`.

    Raises:
        TypeError: `kind` is not a FieldKind.
        BadRequest: Another kind has this name.
    """
    if _KINDS.setdefault(kind.name, kind) != kind:
        raise BadRequest(f"There is another kind of field {kind.name!r}.", "Choose another name.")
    if kind.name not in FIELD_KINDS:
        FIELD_KINDS.append(kind.name)


def field_kinds() -> list[str]:
    """Return the names of all kinds, including those of installed packages."""
    return list(dict.fromkeys([*_KINDS, *plugin_names(PLUGINS)]))


def field_kind(name: str) -> FieldKind:
    """Return the kind with this name.

    Raises:
        BadRequest: No such kind; the hint lists all kinds.
        MissingDependency: The package that brings it cannot be loaded.
    """
    if name not in _KINDS and name in plugin_names(PLUGINS):
        register_field(load_plugin(PLUGINS, name))
    if name not in _KINDS:
        raise BadRequest(f"geometry.field = {name!r:.200} is not allowed.", f"Use one of: {', '.join(field_kinds())}.")
    return _KINDS[name]


@dataclass(frozen=True)
class FitTask:
    """All that each process of a group needs to begin the same fit."""

    training_images: list[TrainingImage]  # with cameras of their sizes
    kind: str  # background of the photos
    space: str
    views: list[View]
    points: SparsePoints | None
    settings: GeometrySettings
    seed: int  # of all random numbers
    threads: int  # of each process
    device: str  # type of device

    def start(self, runtime: Runtime) -> Fit:
        """Begin the fit on this process's device.

        Raises:
            BadRequest: The capture does not suit the requested space.
        """
        dataset = build_pixel_dataset(self.training_images, self.kind, runtime.device)
        inputs = FitInputs(dataset, self.kind, self.space, self.views, self.points, self.settings, runtime)
        return field_kind(self.settings.field).start(inputs)


def make_fit_task(
    views: list[View],
    training_images: list[TrainingImage],
    kind: str,
    points: SparsePoints | None,
    settings: GeometrySettings,
    seed: int,
    device: torch.device,
) -> FitTask:
    """Build the task of fitting these views, in the space that suits them, with this process's threads."""
    views = [replace(view, camera=image.camera) for view, image in zip(views, training_images, strict=True)]
    space = choose_space(kind, views, points, settings)
    return FitTask(training_images, kind, space, views, points, settings, seed, cores.core_count(), device.type)


def background_kind_of(training_images: list[TrainingImage]) -> str:
    """Return the background of the training images: alpha, black, white or opaque."""
    return background_kind(
        [image.color if image.alpha is None else np.dstack([image.color, image.alpha]) for image in training_images]
    )


def build_pixel_dataset(training_images: list[TrainingImage], kind: str, device: torch.device) -> PixelDataset:
    """Build the dataset of the training images, with the opacity that the kind of background implies."""
    alphas = solids = valid = None
    if kind == "alpha":
        alphas = [np.ones(image.color.shape[:2]) if image.alpha is None else image.alpha for image in training_images]
    if kind in ("black", "white"):
        solids = [solid_pixels(image.color, kind) for image in training_images]
    if any(image.valid is not None for image in training_images):
        valid = [
            np.ones(image.color.shape[:2], bool) if image.valid is None else image.valid for image in training_images
        ]
    cameras, colors = [image.camera for image in training_images], [image.color for image in training_images]
    return PixelDataset(cameras, colors, alphas, solids, valid, device)


register_field(FieldKind(VoxelField.kind, start_voxel_fit, VoxelField.restore, prepare_kernels))
register_field(FieldKind(NerfField.kind, start_nerf_fit, NerfField.restore))
