"""The objects' rays, which the palette and F_w are learned from, and which of them are well inside an object."""

from __future__ import annotations

import numpy as np
import torch
from scipy.ndimage import binary_erosion
from torch import Tensor

from ..heads.object_surface import BACKGROUND, MIN_INTERIOR_PIXELS, ObjectSurface
from ..io.color import to_bytes
from .views import CachedViews

CONFIDENT = 0.9  # probability of its class above which a ray may be well inside an object


def object_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """The cached rays that end on an object.

    Args:
        cached: views and their n rays.
        probabilities: [n, K+1], classes of the rays as F_s renders them.
    """
    label = probabilities.argmax(1)
    return _surface_of(
        cached, torch.nonzero(label > 0).squeeze(1), label - 1, interior_rays(cached, label, probabilities)
    )


def whole_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """All cached rays, which Eq. 11 sums over; those that end on no object are of `BACKGROUND`. `interior` is true of all.

    Arguments as for `object_surface`.
    """
    label = probabilities.argmax(1)
    everything = torch.arange(len(label), device=label.device)
    return _surface_of(cached, everything, torch.where(label > 0, label - 1, BACKGROUND), label >= 0)


def _surface_of(cached: CachedViews, rays: Tensor, owner: Tensor, interior: Tensor) -> ObjectSurface:
    """These of the cached rays; owner: [n] number of each cached ray's object; interior: [n] bool."""
    cache, views = cached.cache, cached.views
    colors = torch.from_numpy(to_bytes(views.colors()))
    view = np.searchsorted(views.offsets, cache.index[rays].cpu().numpy(), side="right") - 1
    return ObjectSurface(
        positions=cache.positions[rays],
        viewdirs=cache.viewdirs[rays],
        colors=colors[cache.index[rays].cpu()],
        object=owner[rays].to(torch.uint8),
        interior=interior.cpu()[rays.cpu()],
        view=torch.from_numpy(view).to(torch.int16),
    )


def interior_rays(cached: CachedViews, label: Tensor, probabilities: Tensor) -> Tensor:
    """True for rays well inside an object, [n]: of a confident class, and one pixel from the object's border.

    Of an object too thin to have an inside, with fewer such pixels than a palette needs, all rays count.

    Args:
        cached: views and their n rays.
        label: [n] the rays' classes.
        probabilities: [n, K+1], classes of the rays as F_s renders them.
    """
    label = label.cpu().numpy()
    objects = range(1, len(cached.views.objects) + 1)
    eroded = [
        np.logical_or.reduce([binary_erosion(picture == k) for k in objects]).ravel()
        for picture in cached.pictures(label)
    ]
    index = cached.cache.index.cpu().numpy()
    inside = np.concatenate(eroded)[index] & (probabilities.amax(1) > CONFIDENT).cpu().numpy()
    for k in objects:
        own = label == k
        if (own & inside).sum() < MIN_INTERIOR_PIXELS:
            inside |= own
    return torch.from_numpy(inside)
