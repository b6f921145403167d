"""Prior features along the rays that a head learns from. The field is frozen, and so are they."""

from __future__ import annotations

import torch
from torch import Tensor

from ..fields.protocol import Field
from ..project.settings import RecoloringSettings, SegmentationSettings
from .rendering import SAMPLES_PER_CHUNK, features_of

MOST_BYTES = 1 << 29  # of features that are kept: a NeRF has 256 a sample


class RayFeatures:
    """Prior features of a training's rays: asked of the field once, where that is less work than asking every iteration
    and the memory is there; else at each call."""

    def __init__(
        self, scene_field: Field, positions: Tensor, settings: SegmentationSettings | RecoloringSettings
    ) -> None:
        """Ask for all of them, or for none yet.

        Args:
            scene_field: the frozen radiance field.
            positions: [n, S, 3] samples of all rays, grid coordinates.
            settings: of the training, whose iterations draw rays with replacement.
        """
        self._field, self._positions = scene_field, positions
        n_bytes = positions.shape[0] * positions.shape[1] * scene_field.n_features * 4
        is_less = len(positions) <= settings.iterations * settings.batch
        self._kept = self._all() if is_less and n_bytes <= MOST_BYTES else None

    def of(self, rays: Tensor) -> Tensor:
        """Prior features [m, S, F] of some rays, by their numbers [m]."""
        if self._kept is not None:
            return self._kept[rays]
        return features_of(self._field, self._positions[rays])

    @torch.no_grad()
    def _all(self) -> Tensor:
        at_once = max(1, SAMPLES_PER_CHUNK // self._positions.shape[1])
        return torch.cat([features_of(self._field, part) for part in self._positions.split(at_once)])
