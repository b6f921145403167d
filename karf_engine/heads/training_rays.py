"""What F_w learns from: rays well inside the objects, with the palette weights that their photo colors ask for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch
from torch import Tensor

from ..capture.camera import Camera
from ..compute.progress import Progress
from ..fields.protocol import Field
from ..palettes.extraction.barycentric_weights import star_weights
from ..palettes.extraction.loco_weights import loco_weights
from ..palettes.palette import Palette
from ..project.settings import RecoloringSettings
from .fit import ObjectRays
from .object_surface import BACKGROUND, ObjectSurface


def training_rays(
    scene_field: Field,
    surface: ObjectSurface,
    blocks: Sequence[Palette],
    settings: RecoloringSettings,
    masked_views: Sequence[int] = (),
    cameras: Sequence[Camera] = (),
    start_progress: Callable[[str, int], Progress] | None = None,
    opacity: Tensor | None = None,
) -> ObjectRays:
    """The rays well inside the objects, with the weights W of their photo colors over the objects' palettes (Eq. 13).

    Rays of no object are black, and are asked for black alone, in one palette after the other.

    Args:
        scene_field: the frozen radiance field.
        surface: the objects' rays.
        blocks: a palette for each object, or one for all.
        settings: which rays W is asked of (`supervision`), and which weights these are (`targets`).
        masked_views: numbers of the cached views that have a mask; `supervision="reference"` asks only their rays.
        cameras: of the cached views, by their numbers; `targets="loco"` needs them.
        start_progress: begins to count steps under a name, up to a total; `targets="loco"` reports its photos with it.
        opacity: [n] in [0, 1], of the surface's rays; None for rays of which nothing passes.
    """
    interior = surface.interior
    positions, view = surface.positions[interior], surface.view[interior].long()
    owner = surface.object[interior].long()
    is_object = owner != BACKGROUND
    colors = surface.colors[interior].float() / 255 * is_object[:, None]
    in_turn = torch.arange(len(owner), device=owner.device)
    block = torch.where(is_object, owner, in_turn) % len(blocks)
    supervised = torch.ones_like(block, dtype=torch.bool)
    if settings.supervision == "reference":
        supervised = torch.isin(view, torch.tensor(masked_views, dtype=torch.long).to(colors.device))
    n_colors = max(len(palette.colors) for palette in blocks)
    weights = torch.zeros(len(colors), n_colors, device=colors.device)
    weights[:, 0] = (supervised & ~is_object).float()
    for k, palette in enumerate(blocks):
        own = supervised & is_object & (block == k)
        if settings.targets == "loco":
            places = scene_field, positions[own], view[own], cameras
            found = _loco_weights(*places, colors[own], palette, start_progress)
        else:
            found = star_weights(colors[own].cpu().numpy(), palette.colors)
        weights[own, : found.shape[1]] = torch.from_numpy(found).to(colors.device)
    opacity = torch.ones_like(colors[:, 0]) if opacity is None else opacity[interior]
    return ObjectRays(positions, surface.viewdirs[interior], colors, view, block, weights, supervised, opacity)


def _loco_weights(
    scene_field: Field,
    positions: Tensor,
    view: Tensor,
    cameras: Sequence[Camera],
    colors: Tensor,
    palette: Palette,
    start_progress: Callable[[str, int], Progress] | None,
) -> np.ndarray:
    """LoCoPalettes' weights [n, M] of rays with samples [n, S, 3], views [n] and colors [n, 3]: photo by photo."""
    surface = positions[:, positions.shape[1] // 2]
    features = scene_field.features(surface).cpu().numpy()
    world = scene_field.space.to_world(surface).double().cpu().numpy()
    rgb, number = colors.cpu().numpy(), view.cpu().numpy()
    weights = np.zeros((len(rgb), len(palette.colors)), np.float32)
    progress = start_progress("loco", len(np.unique(number))) if start_progress else None
    for n in np.unique(number):
        own = number == n
        camera = cameras[n].without_distortion()
        places = camera.project(world[own])[0] / max(camera.width, camera.height)
        weights[own] = loco_weights(rgb[own], places, palette.colors, features[own])
        if progress:
            progress.step()
    return weights


def palettes_of_objects(names: Sequence[str], blocks: np.ndarray, sizes: Sequence[int]) -> list[Palette]:
    """One palette an object from the learned blocks; a single block serves all objects.

    Args:
        names: of the objects.
        blocks: [blocks, M, 3] learned colors, sRGB in [0, 1].
        sizes: number of colors of each block, black included.
    """
    numbers = range(len(names)) if len(sizes) > 1 else [0] * len(names)
    return [Palette(name, blocks[k, : sizes[k]].astype(np.float32)) for name, k in zip(names, numbers, strict=True)]
