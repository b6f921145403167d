"""The registry of field kinds.

A new kind is one file: a `Field`, its `Fit`, and a call of `register_field`, or an entry point `karf.fields` that is a
`FieldKind`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.arguments import check_arguments
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import FIELD_KINDS, GeometrySettings
from .fit import Fit, FitInputs
from .nerf.field import NerfField
from .nerf.start import start_nerf_fit
from .protocol import Field
from .voxels.field import VoxelField
from .voxels.fit_open import start_voxel_fit
from .voxels.fused.preparing import prepare_kernels

Wait = Callable[[Emit, Callable[[], bool]], None]  # waits; receives `emit` and `should_stop`


@dataclass(frozen=True)
class FieldKind:
    """One kind of field.

    Attributes:
        name: In the setting `geometry.field` and in files.
        start: Begins a fresh fit from photos.
        restore: Restores a field from its config and tensors (see `Field.restore`).
        prepare: Starts preparations that run while photos are read; returns a function that waits for them.
    """

    name: str
    start: Callable[[FitInputs], Fit]
    restore: Callable[[dict[str, Any], dict[str, Tensor], torch.device | str], Field]
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


def start_fit(inputs: FitInputs) -> Fit:
    """Begin a fresh fit of the kind in the settings.

    Raises:
        BadRequest: No such kind, or the capture does not suit the requested space.
    """
    return field_kind(inputs.settings.field).start(inputs)


register_field(FieldKind(VoxelField.kind, start_voxel_fit, VoxelField.restore, prepare_kernels))
register_field(FieldKind(NerfField.kind, start_nerf_fit, NerfField.restore))
