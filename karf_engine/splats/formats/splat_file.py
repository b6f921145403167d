"""The content of a file of Gaussians, independent of its format."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class SplatFile:
    """n Gaussians in the axes and units of a PLY file of Kerbl et al. 2023.

    Attributes:
        table: [n, 11 + 3 K] float32, C-contiguous, finite; columns as in `gaussians.Gaussians.table`.
        is_antialiased: Whether they were trained with an opacity-compensated screen filter (Mip-Splatting); None if the
            file does not say.
        columns: Other values per Gaussian, [n] by name; PLY only.
    """

    table: np.ndarray
    is_antialiased: bool | None = None
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.table)
