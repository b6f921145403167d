"""The kinds of radiance fields. A new one is one file: a `Field`, a `Fit` of it, and a call of `register_field`, or an
entry point `karf.fields` that is a `FieldKind`."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.arguments import checked
from ..io.plugins import load_plugin, plugin_names
from ..project.settings import FIELD_KINDS, GeometrySettings
from .fit import Fit, FitInputs
from .nerf.field import NerfField
from .nerf.start import start_nerf_fit
from .protocol import Field
from .voxels.choice import prepare_kernels
from .voxels.field import VoxelField
from .voxels.start import start_voxel_fit

Wait = Callable[[Emit, Callable[[], bool]], None]  # receives events; is asked whether to stop


@dataclass(frozen=True)
class FieldKind:
    """One kind of field.

    Attributes:
        name: That `geometry.field` and files give it.
        start: A fresh fit from photos.
        restore: The field of a config and tensors (see `Field.restore`).
        prepare: Begins what may run while the photos are read; what it returns waits until that is done.
    """

    name: str
    start: Callable[[FitInputs], Fit]
    restore: Callable[[dict[str, Any], dict[str, Tensor], torch.device | str], Field]
    prepare: Callable[[GeometrySettings, torch.device], Wait] = lambda settings, device: lambda emit, should_stop: None


PLUGINS = "karf.fields"
_KINDS: dict[str, FieldKind] = {}


@checked
def register_field(kind: FieldKind) -> None:
    """Make a kind of field known: to the setting `geometry.field` and to `load_scene`.

    Raises:
        TypeError: It is no kind of field.
        BadRequest: Another kind has this name.
    """
    if _KINDS.setdefault(kind.name, kind) != kind:
        raise BadRequest(f"There is another kind of field {kind.name!r}.", "Choose another name.")
    if kind.name not in FIELD_KINDS:
        FIELD_KINDS.append(kind.name)


def field_kinds() -> list[str]:
    """Names of all kinds, those that installed packages bring among them."""
    return list(dict.fromkeys([*_KINDS, *plugin_names(PLUGINS)]))


def field_kind(name: str) -> FieldKind:
    """The kind that `geometry.field` and files name.

    Raises:
        BadRequest: It is not registered; the hint lists those that are.
        MissingDependency: An installed package brings it, and cannot be loaded.
    """
    if name not in _KINDS and name in plugin_names(PLUGINS):
        register_field(load_plugin(PLUGINS, name))
    if name not in _KINDS:
        raise BadRequest(f"geometry.field = {name!r:.200} is not allowed.", f"Use one of: {', '.join(field_kinds())}.")
    return _KINDS[name]


def start_fit(inputs: FitInputs) -> Fit:
    """A fresh fit of the kind of field that the settings name.

    Raises:
        BadRequest: That kind is not registered, or the capture does not suit the space asked for.
    """
    return field_kind(inputs.settings.field).start(inputs)


register_field(FieldKind(VoxelField.kind, start_voxel_fit, VoxelField.restore, prepare_kernels))
register_field(FieldKind(NerfField.kind, start_nerf_fit, NerfField.restore))
