"""Per-channel standardization of prior features, whose scale varies by orders of magnitude between scenes."""

import torch
from torch import Tensor, nn

from ..errors import DataError

# A channel that varies by less than float32 can tell apart from its mean is constant: it becomes zero, not noise.
_CONSTANT_CHANNEL = 1e-6


class Standardizer(nn.Module):
    """Map features [n, F] to zero mean and unit standard deviation per channel, as measured once by `fit`.

    `mean` and `std` [F] are buffers: never trained, saved with the head. Before `fit` it is the identity.
    Differentiable to the features.

    Args:
        n_features: F.

    Example:
        >>> standardizer = Standardizer(1)
        >>> standardizer.fit(torch.tensor([[1.0], [3.0]]))
        >>> standardizer(torch.tensor([[5.0]]))
        tensor([[3.]])
    """

    def __init__(self, n_features: int):
        super().__init__()
        self.register_buffer("mean", torch.zeros(n_features))
        self.register_buffer("std", torch.ones(n_features))

    @torch.no_grad()
    def fit(self, features: Tensor) -> None:
        """Measure `mean` and `std`.

        Args:
            features: [n, F], n >= 1.

        Raises:
            DataError: a value is not finite.
        """
        std, mean = torch.std_mean(features.double(), dim=0, correction=0)
        if not torch.isfinite(std).all():
            raise DataError("The prior features hold values that are not finite.", "Train the geometry stage again.")
        constant = std <= _CONSTANT_CHANNEL * mean.abs()
        self.mean.copy_(mean)
        self.std.copy_(torch.where(constant, 1.0, std))

    def forward(self, features: Tensor) -> Tensor:
        """Return the standardized features [n, F]."""
        return (features - self.mean) / self.std
