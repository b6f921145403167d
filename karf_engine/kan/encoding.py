"""What the heads read: encoded positions and directions, joined with prior features."""

import torch
from torch import Tensor


def positional_encoding(x: Tensor, n_frequencies: int) -> Tensor:
    """Return gamma(x) [n, 3 + 6 * n_frequencies] for x [n, 3]: x, sin(2^0 x), cos(2^0 x), sin(2^1 x), ... without pi.

    The order and the missing pi are those of the original NeRF implementation, so that its checkpoints fit.
    """
    octaves = [2.0**octave * x for octave in range(n_frequencies)]
    return torch.cat([x, *(wave for angle in octaves for wave in (torch.sin(angle), torch.cos(angle)))], dim=-1)


def join_inputs(position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None) -> Tensor:
    """Return z = [gamma(x), gamma(d), f_prior] [n, P + D + F], without gamma(d) if it is None."""
    directions = [] if direction_encoding is None else [direction_encoding]
    return torch.cat([position_encoding, *directions, features], dim=-1)
