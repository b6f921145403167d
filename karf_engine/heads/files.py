"""Save and load F_s, F_w and the objects' rays, as safetensors with the settings in the header."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor

from ..fields.rendering.space import Space
from ..io.checkpoints import damage_as_data_error, load_tensors, save_tensors
from ..io.names import check_names
from ..palettes.palette import Palette
from ..project.settings import RecoloringSettings, SegmentationSettings, from_dict, to_dict
from .fields import RecoloringField, SegmentationField, Volumes
from .training_rays import ObjectSurface

SEGMENTATION_SCHEMA = "karf-segmentation/1"
SURFACE_SCHEMA = "karf-surface/1"
RECOLORING_SCHEMA = "karf-recoloring/1"
# attribute: name in the file, dtype and number of axes, the last of several being of size 3
SURFACE = {
    "positions": ("positions", torch.float32, 3),
    "viewdirs": ("viewdirs", torch.float32, 2),
    "colors": ("colors", torch.uint8, 2),
    "object": ("object", torch.uint8, 1),
    "interior": ("sure", torch.bool, 1),
    "view": ("view", torch.int16, 1),
}


def save_segmentation(
    path: Path, segmentation: SegmentationField, objects: list[str], settings: SegmentationSettings
) -> None:
    """Write F_s with the names of its classes 1..K and its settings, atomically."""
    save_tensors(
        path, segmentation.state_dict(), SEGMENTATION_SCHEMA, {"objects": objects, "settings": to_dict(settings)}
    )


def load_segmentation(
    path: Path, n_features: int, device: torch.device | str = "cpu", space: Space | None = None
) -> tuple[SegmentationField, list[str]]:
    """Return a frozen F_s for a field of `n_features`, and the names of its classes 1..K.

    space: of the field; None where F_s is not evaluated. Raises DataError where the file is damaged or of another
    field.
    """
    tensors, facts = load_tensors(path, SEGMENTATION_SCHEMA, device)
    with damage_as_data_error(path):
        objects = check_names(facts["objects"], path, "an object")
        if tensors["boxes"].shape != (len(objects), 2, 3):
            raise ValueError(f"{len(objects)} objects, boxes {tuple(tensors['boxes'].shape)}")
        settings = from_dict(facts["settings"], SegmentationSettings)
        volumes = _volumes_of(tensors, len(objects))
        segmentation = SegmentationField(tensors["boxes"], n_features, settings, volumes, space).to(device)
        segmentation.load_state_dict(tensors)
    return segmentation.requires_grad_(False), objects


def _volumes_of(tensors: Mapping[str, Tensor], n_objects: int) -> Volumes | None:
    if "volumes.rules" not in tensors:
        return None
    faces, volume_of_face, rules = (tensors[f"volumes.{name}"] for name in ("faces", "volume_of_face", "rules"))
    shapes = [tuple(each.shape) for each in (faces, volume_of_face, rules)]
    fits = shapes == [(len(faces), 4), (len(faces),), (len(rules), 2)]
    fits = fits and set(volume_of_face.tolist()) == set(range(len(rules)))
    if not (fits and set(rules[:, 0].tolist()) <= set(range(n_objects))):
        raise ValueError(f"volumes of {shapes}")
    return Volumes(faces, volume_of_face, rules)


def save_recoloring(path: Path, recoloring: RecoloringField, sizes: list[int], settings: RecoloringSettings) -> None:
    """Write F_w with the sizes of its palettes and its settings, atomically."""
    save_tensors(path, recoloring.state_dict(), RECOLORING_SCHEMA, {"sizes": sizes, "settings": to_dict(settings)})


def load_recoloring(
    path: Path, bounds: Tensor, n_features: int, palettes: Sequence[Palette], device: torch.device | str = "cpu"
) -> RecoloringField:
    """Return a frozen F_w. bounds: of F_s. n_features: of the scene's field. palettes: one per object.

    Raises DataError where the file is damaged or belongs to other palettes.
    """
    tensors, facts = load_tensors(path, RECOLORING_SCHEMA, device)
    with damage_as_data_error(path):
        sizes, own = facts["sizes"], [len(palette.colors) for palette in palettes]
        if sizes != own and sizes * len(own) != own:  # a single block serves all objects
            raise ValueError(f"palettes of {sizes} colors instead of {own}")
        settings = from_dict(facts["settings"], RecoloringSettings)
        recoloring = RecoloringField(bounds, n_features, sizes, settings).to(device)
        recoloring.load_state_dict(tensors)
    return recoloring.requires_grad_(False)


def save_surface(path: Path, surface: ObjectSurface, objects: list[str], settings: SegmentationSettings) -> None:
    """Write the objects' rays with the objects' names and the settings of segmentation, atomically."""
    tensors = {name: getattr(surface, attribute) for attribute, (name, _, _) in SURFACE.items()}
    save_tensors(path, tensors, SURFACE_SCHEMA, {"objects": objects, "settings": to_dict(settings)})


def load_surface(path: Path, device: torch.device | str = "cpu") -> tuple[ObjectSurface, list[str]]:
    """Return the objects' rays and names. Raises DataError where the file is damaged."""
    tensors, facts = load_tensors(path, SURFACE_SCHEMA, device)
    with damage_as_data_error(path):
        objects = check_names(facts["objects"], path, "an object")
        n_rays = len(tensors["object"])
        for name, kind, n_dimensions in SURFACE.values():
            tensor = tensors[name]
            columns = tensor.shape[-1] if n_dimensions > 1 else 3
            if (tensor.dtype, tensor.ndim, len(tensor), columns) != (kind, n_dimensions, n_rays, 3):
                raise ValueError(f"{name} {tensor.dtype} {tuple(tensor.shape)}")
        owners, views = tensors["object"].tolist(), tensors["view"].tolist()
        if max(owners, default=0) >= len(objects) or min(views, default=0) < 0 or 0 in tensors["positions"].shape[1:]:
            raise ValueError("rays of no object, of no view or without samples")
        surface = ObjectSurface(**{attribute: tensors[name] for attribute, (name, _, _) in SURFACE.items()})
    return surface, objects
