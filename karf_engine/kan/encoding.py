"""Encode positions and directions, and join them with prior features."""

import torch
from torch import Tensor

from ..io.arguments import check_number, check_type
from .checks import check_alike, check_vectors


def positional_encoding(x: Tensor, n_frequencies: int) -> Tensor:
    """Return gamma(x): x, sin(2^0 x), cos(2^0 x), sin(2^1 x), ... without pi (Mildenhall et al. 2020).

    The order, and the omission of pi, are those of the original NeRF code, so that its checkpoints fit.

    Args:
        x: [..., 3].
        n_frequencies: number of octaves, at least 0.

    Returns:
        [..., 3 + 6 * n_frequencies].

    Example:
        >>> positional_encoding(torch.zeros(1, 3), 1)
        tensor([[0., 0., 0., 0., 0., 0., 1., 1., 1.]])
    """
    check_vectors("x", x)
    check_type("positional_encoding", "n_frequencies", n_frequencies, int)
    check_number("n_frequencies", n_frequencies, 0)
    octaves = [2.0**octave * x for octave in range(n_frequencies)]
    return torch.cat([x, *(wave for angle in octaves for wave in (torch.sin(angle), torch.cos(angle)))], dim=-1)


def join_inputs(position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None) -> Tensor:
    """Return z = [gamma(x), gamma(d), f_prior], [..., P + D + F], without gamma(d) if it is None.

    Example:
        >>> join_inputs(torch.ones(1, 2), torch.zeros(1, 1), torch.full((1, 2), 5.0))
        tensor([[1., 1., 5., 5., 0.]])
    """
    directions = {} if direction_encoding is None else {"direction_encoding": direction_encoding}
    parts = {"position_encoding": position_encoding, **directions, "features": features}
    for name, part in parts.items():
        check_vectors(name, part)
        check_alike(name, part, position_encoding)
    return torch.cat(tuple(parts.values()), dim=-1)
