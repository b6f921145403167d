"""The interface of the back ends that rasterize Gaussians: a view of them, and a table that is trained."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Protocol

import numpy as np
from torch import Tensor

from .kernels.arrays import Pinhole

UNKNOWN_COLOR = np.float32(0.5)  # sRGB gray of Gaussians with confidence 0


class RasterizedView(ABC):
    """One view of a table of Gaussians."""

    depths: np.ndarray  # [n] float32, of the centers, world units; undefined for invisible Gaussians
    image: np.ndarray  # [H, W, 4] float32, sRGB over the background, and the transmittance
    is_seen: np.ndarray  # [n] bool, Gaussians that cover part of the picture
    colors: np.ndarray  # [n, 3] float32 sRGB >= 0, from this viewpoint, before fading; 0 if not seen

    def picture(self) -> np.ndarray:
        """Clip the image in place to [0, 1]; return its colors [H, W, 3]."""
        return np.clip(self.image, 0, 1, out=self.image)[..., :3]

    @abstractmethod
    def blended(self, values: np.ndarray) -> np.ndarray:
        """Blend values [n, C] of the Gaussians like their colors, over 0; return [C, H, W] float32."""

    @abstractmethod
    def weights(self) -> np.ndarray:
        """Return the sum of each Gaussian's blending weights over all pixels, [n] float32 >= 0."""


class TrainedTable(Protocol):
    """A table of Gaussians that Adam (Kingma and Ba 2015) trains, with its moments, where it is rasterized."""

    def view(self, camera: Pinhole, background: tuple[float, float, float]) -> RasterizedView:
        """Rasterize the table."""
        ...

    def update(self, view: RasterizedView, gradient: np.ndarray, rates: np.ndarray) -> None:
        """Update the rows that the last view shows from the gradient [H, W, 3] of its colors.

        Of the background only the constant color is trained. rates: [P], learning rates; of the centers in units of each
        Gaussian's size.
        """
        ...

    def replace_rows(self, rows: np.ndarray, values: np.ndarray) -> None:
        """Replace rows [m] by values [m, P], which have not been trained yet."""
        ...

    def is_finite(self) -> bool:
        """Return whether all values are finite."""
        ...

    def tensors(self) -> dict[str, Tensor]:
        """Return `table`, moments, numbers of updates and sizes; writing to them changes the training."""
        ...
