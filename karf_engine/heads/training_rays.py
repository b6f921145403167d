"""The rays that end on objects: training data of palettes, and with target weights for their photo colors of F_w."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..compute.progress import Progress
from ..errors import DataError
from ..fields.protocol import Field
from ..palettes.palette import Palette
from ..palettes.palette_weights import loco_weights, star_weights
from ..project.settings import RecoloringSettings
from .fit import ObjectRays

MIN_INTERIOR_PIXELS = 50  # of an object in all views, for a palette
UNSEEN = np.full((1, 3), 0.5, np.float32)  # color of an object without pixels
BACKGROUND = 255  # object number of rays without an object


@dataclass(frozen=True)
class ObjectSurface:
    """n rays of the cached views that end on an object, with S surface samples each."""

    positions: Tensor  # [n, S, 3] float32, grid coordinates
    viewdirs: Tensor  # [n, 3] float32, unit length
    colors: Tensor  # [n, 3] uint8 sRGB of the photo
    object: Tensor  # [n] uint8, index of the object
    interior: Tensor  # [n] bool, well inside the object
    view: Tensor  # [n] int16, index of the cached view


def object_pixels(surface: ObjectSurface, objects: list[str]) -> list[list[np.ndarray]]:
    """Return the interior photo colors of each object, one array [n, 3] float32 sRGB in [0, 1] per view.

    An object with too few pixels for a palette (`objects_with_few_pixels`) has their mean only, or gray without pixels.
    """
    colors = surface.colors.cpu().numpy().astype(np.float32) / 255
    owner, view, interior = (values.cpu().numpy() for values in (surface.object, surface.view, surface.interior))
    scarce, pixels = objects_with_few_pixels(surface, objects), []
    for k, name in enumerate(objects):
        chosen = (owner == k) & interior
        if name in scarce:
            pixels.append([colors[chosen].mean(0, keepdims=True) if chosen.any() else UNSEEN])
        else:
            pixels.append([colors[chosen & (view == v)] for v in np.unique(view[chosen])])
    return pixels


def objects_with_few_pixels(surface: ObjectSurface, objects: list[str]) -> dict[str, int]:
    """Return the number of interior pixels of each object that has too few for a palette."""
    counts = np.bincount(surface.object[surface.interior].cpu().numpy(), minlength=len(objects)).tolist()
    return {name: count for name, count in zip(objects, counts, strict=True) if count < MIN_INTERIOR_PIXELS}


def training_rays(
    scene_field: Field,  # frozen
    surface: ObjectSurface,
    blocks: Sequence[Palette],  # for each object, or one for all
    settings: RecoloringSettings,
    masked_views: Sequence[int] = (),  # indices of the cached views with masks, for `supervision="reference"`
    cameras: Sequence[Camera] = (),  # of the cached views, for `targets="loco"`
    start_progress: Callable[[str, int], Progress] | None = None,  # for `targets="loco"`
    opacity: Tensor | None = None,  # [n] in [0, 1], of the surface's rays; None for opaque rays
) -> ObjectRays:
    """Return the interior rays with their target weights W over the objects' palettes (Eq. 13).

    Rays without an object are black with the weight of black, and are assigned to the palettes in turn. Raises DataError
    where no object has surface points.
    """
    if not surface.interior.any():
        raise DataError(
            "The segmentation has no surface points of {names}.",
            "Mark it in another photo, or check that its mask covers it.",
            names=", ".join(repr(palette.name) for palette in blocks),
        )
    interior = surface.interior
    positions, view = surface.positions[interior], surface.view[interior].long()
    owner = surface.object[interior].long()
    is_object = owner != BACKGROUND
    colors = surface.colors[interior].float() / 255 * is_object[:, None]
    block = torch.where(is_object, owner, torch.arange(len(owner), device=owner.device)) % len(blocks)
    supervised = torch.ones_like(block, dtype=torch.bool)
    if settings.supervision == "reference":
        supervised = torch.isin(view, torch.tensor(masked_views, dtype=torch.long).to(colors.device))
    n_colors = max(len(palette.colors) for palette in blocks)
    weights = torch.zeros(len(colors), n_colors, device=colors.device)
    weights[:, 0] = (supervised & ~is_object).float()

    def loco_targets(own: Tensor, palette: Palette) -> np.ndarray:
        """Return LoCoPalettes' weights [m, M], photo by photo."""
        surface = positions[own][:, positions.shape[1] // 2]
        features = scene_field.features(surface).cpu().numpy()
        world = scene_field.space.to_world(surface).cpu().double().numpy()
        rgb, number = colors[own].cpu().numpy(), view[own].cpu().numpy()
        result = np.zeros((len(rgb), len(palette.colors)), np.float32)
        progress = start_progress("loco", len(np.unique(number))) if start_progress else None
        for n in np.unique(number):
            here = number == n
            camera = cameras[n].without_distortion()
            pixels = camera.project(world[here])[0] / max(camera.width, camera.height)
            result[here] = loco_weights(rgb[here], pixels, palette.colors, features[here])
            if progress:
                progress.step()
        return result

    for k, palette in enumerate(blocks):
        own = supervised & is_object & (block == k)
        if settings.targets == "loco":
            targets = loco_targets(own, palette)
        else:
            targets = star_weights(colors[own].cpu().numpy(), palette.colors)
        weights[own, : targets.shape[1]] = torch.from_numpy(targets).to(colors.device)
    opacity = torch.ones_like(colors[:, 0]) if opacity is None else opacity[interior]
    return ObjectRays(positions, surface.viewdirs[interior], colors, view, block, weights, supervised, opacity)
