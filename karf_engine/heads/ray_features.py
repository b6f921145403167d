"""Cache the prior features along the training rays of a head."""

from __future__ import annotations

import torch
from torch import Tensor

from ..fields.protocol import Field
from ..project.settings import RecoloringSettings, SegmentationSettings
from .rendering import SAMPLES_PER_CHUNK, features_of

MAX_CACHE_BYTES = 1 << 29  # a NeRF has 256 features per sample


class RayFeatures:
    """Prior features of training rays, computed once if that is less work than at each call and fits into memory."""

    def __init__(
        self, scene_field: Field, positions: Tensor, settings: SegmentationSettings | RecoloringSettings
    ) -> None:
        """Take the frozen field, the samples [n, S, 3] of all rays (grid coordinates), and the training's settings."""
        self._field, self._positions = scene_field, positions
        n_bytes = positions.shape[0] * positions.shape[1] * scene_field.n_features * 4
        is_less_work = len(positions) <= settings.iterations * settings.batch
        self._cached = self._all() if is_less_work and n_bytes <= MAX_CACHE_BYTES else None

    def of(self, rays: Tensor) -> Tensor:
        """Return prior features [m, S, F] of the rays with indices [m]."""
        if self._cached is not None:
            return self._cached[rays]
        return features_of(self._field, self._positions[rays])

    @torch.no_grad()
    def _all(self) -> Tensor:
        rays_per_chunk = max(1, SAMPLES_PER_CHUNK // self._positions.shape[1])
        return torch.cat([features_of(self._field, chunk) for chunk in self._positions.split(rays_per_chunk)])
