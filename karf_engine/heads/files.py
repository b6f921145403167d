"""F_s, F_w and the objects' rays on disk, as safetensors with their settings in the header."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import torch
from torch import Tensor

from ..fields.rendering.space import Space
from ..io.checkpoints import load_tensors, restoring, save_tensors
from ..io.names import check_names
from ..palettes.palette import Palette
from ..project.settings import RecoloringSettings, SegmentationSettings, from_dict, to_dict
from .fields import RecoloringField, SegmentationField
from .object_surface import ObjectSurface
from .volumes import Volumes

SEGMENTATION_SCHEMA = "karf-segmentation/1"
SURFACE_SCHEMA = "karf-surface/1"
RECOLORING_SCHEMA = "karf-recoloring/1"
SURFACE = {  # name in the file, type and dimensions, the last of several being x, y, z or red, green, blue
    "positions": ("positions", torch.float32, 3),
    "viewdirs": ("viewdirs", torch.float32, 2),
    "colors": ("colors", torch.uint8, 2),
    "object": ("object", torch.uint8, 1),
    "interior": ("sure", torch.bool, 1),
    "view": ("view", torch.int16, 1),
}


def save_segmentation(path: Path, karf: SegmentationField, objects: list[str], settings: SegmentationSettings) -> None:
    """Write F_s with the names of its classes 1..K and the settings that it was trained with, atomically."""
    save_tensors(path, karf.state_dict(), SEGMENTATION_SCHEMA, {"objects": objects, "settings": to_dict(settings)})


def load_segmentation(
    path: Path, n_features: int, device: torch.device | str = "cpu", space: Space | None = None
) -> tuple[SegmentationField, list[str]]:
    """F_s, frozen, and the names of its classes 1..K.

    Args:
        path: what `save_segmentation` wrote.
        n_features: prior features of the scene's field.
        device: where F_s will be.
        space: of the scene's field; None where F_s is not asked.

    Raises:
        DataError: the file is damaged or belongs to another field.
    """
    tensors, facts = load_tensors(path, SEGMENTATION_SCHEMA, device)
    with restoring(path):
        objects = check_names(facts["objects"], path, "an object")
        if tensors["boxes"].shape != (len(objects), 2, 3):
            raise ValueError(f"{len(objects)} objects, boxes {tuple(tensors['boxes'].shape)}")
        settings = from_dict(facts["settings"], SegmentationSettings)
        volumes = _volumes_of(tensors, len(objects))
        karf = SegmentationField(tensors["boxes"], n_features, settings, volumes, space).to(device)
        karf.load_state_dict(tensors)
    return karf.requires_grad_(False), objects


def _volumes_of(tensors: Mapping[str, Tensor], n_objects: int) -> Volumes | None:
    """The volumes of F_s; None where it has none. Raises ValueError where they contradict each other."""
    if "volumes.rules" not in tensors:
        return None
    faces, volume_of_face, rules = (tensors[f"volumes.{name}"] for name in ("faces", "volume_of_face", "rules"))
    shapes = [tuple(each.shape) for each in (faces, volume_of_face, rules)]
    known = set(volume_of_face.tolist()) == set(range(len(rules))) and set(rules[:, 0].tolist()) <= set(
        range(n_objects)
    )
    if shapes != [(len(faces), 4), (len(faces),), (len(rules), 2)] or not known:
        raise ValueError(f"volumes of {shapes}")
    return Volumes(faces, volume_of_face, rules)


def save_recoloring(path: Path, karf: RecoloringField, sizes: list[int], settings: RecoloringSettings) -> None:
    """Write F_w with the sizes of its palettes and the settings that it was trained with."""
    save_tensors(path, karf.state_dict(), RECOLORING_SCHEMA, {"sizes": sizes, "settings": to_dict(settings)})


def load_recoloring(
    path: Path, bounds: Tensor, n_features: int, palettes: Sequence[Palette], device: torch.device | str = "cpu"
) -> RecoloringField:
    """F_w, frozen.

    Args:
        path: what `save_recoloring` wrote.
        bounds: those of F_s, [2, 3], grid coordinates.
        n_features: prior features of the scene's field.
        palettes: that it was trained for, one an object.
        device: where F_w will be.

    Raises:
        DataError: the file is damaged or belongs to other palettes.
    """
    tensors, facts = load_tensors(path, RECOLORING_SCHEMA, device)
    with restoring(path):
        sizes, own = facts["sizes"], [len(palette.colors) for palette in palettes]
        if sizes != own and sizes * len(own) != own:  # one block may serve all
            raise ValueError(f"palettes of {sizes} colors instead of {own}")
        settings = from_dict(facts["settings"], RecoloringSettings)
        karf = RecoloringField(bounds, n_features, sizes, settings).to(device)
        karf.load_state_dict(tensors)
    return karf.requires_grad_(False)


def save_surface(path: Path, surface: ObjectSurface, objects: list[str], settings: SegmentationSettings) -> None:
    """Write the objects' rays with the objects' names and the settings of the segmentation that found them."""
    tensors = {name: getattr(surface, attribute) for attribute, (name, _, _) in SURFACE.items()}
    save_tensors(path, tensors, SURFACE_SCHEMA, {"objects": objects, "settings": to_dict(settings)})


def load_surface(path: Path, device: torch.device | str = "cpu") -> tuple[ObjectSurface, list[str]]:
    """The objects' rays, and the objects' names. Raises DataError where the file is damaged."""
    tensors, facts = load_tensors(path, SURFACE_SCHEMA, device)
    with restoring(path):
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
