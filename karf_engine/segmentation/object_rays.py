"""Select the rays that palettes and F_w are learned from, and those well inside an object."""

from __future__ import annotations

import numpy as np
import torch
from scipy.ndimage import binary_erosion
from torch import Tensor

from ..heads.object_surface import BACKGROUND, MIN_INTERIOR_PIXELS, ObjectSurface
from ..io.color import to_bytes
from .views import CachedViews

CONFIDENT = 0.9  # least probability of the class of an interior ray


def object_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """Return the cached rays that end on an object. probabilities: [n, K+1], of the n rays as F_s renders them."""
    label = probabilities.argmax(1)
    on_object = torch.nonzero(label > 0).squeeze(1)
    return _select_rays(cached, on_object, label - 1, _interior_rays(cached, label, probabilities))


def whole_surface(cached: CachedViews, probabilities: Tensor) -> ObjectSurface:
    """Return all cached rays, the sum of Eq. 11, all interior; rays without an object have the number `BACKGROUND`."""
    label = probabilities.argmax(1)
    everything = torch.arange(len(label), device=label.device)
    return _select_rays(cached, everything, torch.where(label > 0, label - 1, BACKGROUND), label >= 0)


def _select_rays(cached: CachedViews, rays: Tensor, owner: Tensor, interior: Tensor) -> ObjectSurface:
    """Return some cached rays. owner: [n] object number of every cached ray; interior: [n] bool."""
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


def _interior_rays(cached: CachedViews, label: Tensor, probabilities: Tensor) -> Tensor:
    """Return True for confident rays at least one pixel from the object's border, [n].

    If an object is so thin that fewer than MIN_INTERIOR_PIXELS remain, all of its rays count.
    """
    classes = label.cpu().numpy()
    objects = range(1, len(cached.views.objects) + 1)
    eroded = [
        np.logical_or.reduce([binary_erosion(picture == k) for k in objects]).ravel()
        for picture in cached.pictures(classes)
    ]
    index = cached.cache.index.cpu().numpy()
    inside = np.concatenate(eroded)[index] & (probabilities.amax(1) > CONFIDENT).cpu().numpy()
    for k in objects:
        own = classes == k
        if (own & inside).sum() < MIN_INTERIOR_PIXELS:
            inside |= own
    return torch.from_numpy(inside)
