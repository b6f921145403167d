"""Inputs of the networks: argument checks, positional encoding, and standardization of prior features."""

from typing import Any

import torch
from torch import Tensor, nn

from ..compute.precision import to_float64
from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_number, check_type

# A channel with a smaller deviation, relative to its mean, is rounding noise: it becomes zero.
_CONSTANT_CHANNEL = 1e-6


def check_tensor(name: str, x: Any, width: int | None = None, like: Tensor | None = None) -> None:
    """Refuse anything but floating numbers [..., width], with device and, outside of autocast, dtype of `like`."""
    if isinstance(x, Tensor) and x.is_floating_point() and x.ndim and width in (None, x.shape[-1]):
        if like is None or (x.device == like.device and (x.dtype == like.dtype or torch.is_autocast_enabled())):
            return
    check_type("This layer", name, x, Tensor)
    kind = "floating numbers" if like is None else f"{like.dtype} on {like.device}"
    wanted = f"Give {kind}, [..., {'C' if width is None else width}]."
    raise BadRequest(f"{name} is {x.dtype} of shape {tuple(x.shape)} on {x.device}.", wanted)


def check_same_rows(name: str, x: Tensor, other_name: str, other: Tensor) -> None:
    """Refuse two tensors that differ in their leading axes or devices."""
    if x.shape[:-1] != other.shape[:-1] or x.device != other.device:
        raise BadRequest(f"{name} and {other_name} differ in number or device.", "Give as many of both.")


def check_widths(lowest: int, **widths: int) -> None:
    """Refuse widths, by their names, that are less than `lowest`."""
    for name, width in widths.items():
        check_number(name, width, lowest)


def positional_encoding(x: Tensor, n_frequencies: int) -> Tensor:
    """Return gamma(x), [..., 3 + 6 * n_frequencies], of x [..., 3] (Mildenhall et al. 2020).

    It is x, sin(2^0 x), cos(2^0 x), sin(2^1 x), ... in the order of the original NeRF code and, like there, without pi.
    """
    check_tensor("x", x)
    check_type("positional_encoding", "n_frequencies", n_frequencies, int)
    check_number("n_frequencies", n_frequencies, 0)
    octaves = [2.0**octave * x for octave in range(n_frequencies)]
    return torch.cat([x, *(wave for angle in octaves for wave in (torch.sin(angle), torch.cos(angle)))], dim=-1)


def join_inputs(position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None) -> Tensor:
    """Return z = [gamma(x), gamma(d), f_prior], [..., P + D + F], without gamma(d) if it is None."""
    directions = {} if direction_encoding is None else {"direction_encoding": direction_encoding}
    parts = {"position_encoding": position_encoding, **directions, "features": features}
    for name, part in parts.items():
        check_tensor(name, part)
        check_same_rows(name, part, "position_encoding", position_encoding)
    return torch.cat(tuple(parts.values()), dim=-1)


class Standardizer(nn.Module):
    """Map features [..., F] to zero mean and unit standard deviation per channel, as measured by `fit`.

    The scale of prior features varies by orders of magnitude between scenes. `mean` and `std` are buffers, saved with the
    head; before `fit` it is the identity.
    """

    mean: Tensor  # [F]
    std: Tensor  # [F]

    @check_arguments
    def __init__(self, n_features: int):
        super().__init__()
        check_widths(0, n_features=n_features)
        self.register_buffer("mean", torch.zeros(n_features))
        self.register_buffer("std", torch.ones(n_features))

    @torch.no_grad()
    def fit(self, features: Tensor) -> None:
        """Measure `mean` and `std` of features [..., F].

        Raises:
            TypeError: `features` is not a tensor.
            BadRequest: `features` has another width, dtype or device, or is empty.
            DataError: a value is not finite.
        """
        check_tensor("features", features, len(self.mean), self.mean)
        if not features.numel():
            raise BadRequest("features are none.", "Give at least one.")
        std, mean = torch.std_mean(to_float64(features).flatten(0, -2), dim=0, correction=0)
        if not torch.isfinite(std).all():
            raise DataError("The prior features hold values that are not finite.", "Train the geometry stage again.")
        constant = std <= _CONSTANT_CHANNEL * mean.abs()
        self.mean.copy_(mean)
        self.std.copy_(torch.where(constant, 1.0, std))

    def forward(self, features: Tensor) -> Tensor:
        """Return the standardized features [..., F]."""
        check_tensor("features", features, len(self.mean), self.mean)
        return (features - self.mean) / self.std
