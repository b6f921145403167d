"""Standardize prior features per channel, since their scale varies by orders of magnitude between scenes."""

import torch
from torch import Tensor, nn

from ..errors import BadRequest, DataError
from ..io.arguments import check_arguments, check_number
from .checks import check_rows

# A channel with a smaller deviation, relative to its mean, is rounding noise: it becomes zero.
_CONSTANT_CHANNEL = 1e-6


class Standardizer(nn.Module):
    """Map features [..., F] to zero mean and unit standard deviation per channel, as measured by `fit`.

    `mean` and `std` [F] are buffers, saved with the head. Before `fit` it is the identity.

    Args:
        n_features: F.

    Example:
        >>> standardizer = Standardizer(1)
        >>> standardizer.fit(torch.tensor([[1.0], [3.0]]))
        >>> standardizer(torch.tensor([[5.0]]))
        tensor([[3.]])
    """

    mean: Tensor
    std: Tensor

    @check_arguments
    def __init__(self, n_features: int):
        super().__init__()
        check_number("n_features", n_features, 0)
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
        check_rows("features", features, len(self.mean), self.mean)
        if not features.numel():
            raise BadRequest("features are none.", "Give at least one.")
        std, mean = torch.std_mean(features.double().flatten(0, -2), dim=0, correction=0)
        if not torch.isfinite(std).all():
            raise DataError("The prior features hold values that are not finite.", "Train the geometry stage again.")
        constant = std <= _CONSTANT_CHANNEL * mean.abs()
        self.mean.copy_(mean)
        self.std.copy_(torch.where(constant, 1.0, std))

    def forward(self, features: Tensor) -> Tensor:
        """Return the standardized features [..., F]."""
        check_rows("features", features, len(self.mean), self.mean)
        return (features - self.mean) / self.std
