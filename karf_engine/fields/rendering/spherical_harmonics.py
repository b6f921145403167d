"""Real spherical harmonics, the encoding of viewing directions."""

from __future__ import annotations

import torch
from torch import Tensor


def spherical_harmonics(viewdirs: Tensor) -> Tensor:
    """Evaluate the real spherical harmonics of degrees 0 to 2, [n, 9], of unit directions [n, 3].

    After Sloan, Stupid Spherical Harmonics Tricks, 2008.

    Example:
        >>> spherical_harmonics(torch.tensor([[0.0, 0.0, 1.0]]))[0, :4]
        tensor([0.2821, 0.0000, 0.4886, 0.0000])
    """
    x, y, z = viewdirs.unbind(1)
    return torch.stack(
        [
            torch.full_like(x, 0.282095),
            0.488603 * y,
            0.488603 * z,
            0.488603 * x,
            1.092548 * x * y,
            1.092548 * y * z,
            0.315392 * (3 * z * z - 1),
            1.092548 * x * z,
            0.546274 * (x * x - y * y),
        ],
        1,
    )
