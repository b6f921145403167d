"""What a file of Gaussians holds, whichever program wrote it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class SplatFile:
    """n Gaussians of a file, in the axes and units of a PLY file of Kerbl et al. 2023.

    Attributes:
        table: [n, 11 + 3 K] float32, C-contiguous, finite; columns as in `gaussians.Gaussians.table`, the logits of the
            opacity within what float32 can tell from 0 and 1.
        is_antialiased: Whether they were learned with a screen filter that lowers the opacity of what it widens
            (Mip-Splatting); None where the file does not say.
        columns: Further values of each Gaussian, [n] by name, which only some kinds of files hold: those of the program
            that wrote it, or an object's number, its probability, palette weights.
    """

    table: np.ndarray
    is_antialiased: bool | None = None
    columns: Mapping[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.table)
