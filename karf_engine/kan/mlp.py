"""Plain layers: what the Kolmogorov-Arnold layers are compared with, and the fast head."""

from torch import Tensor, nn

from .encoding import join_inputs


class MLPLayer(nn.Module):
    """Map [n, n_in] to [n, n_out] by a linear layer and, unless it is an output layer, a ReLU.

    Args:
        n_in: width of the inputs.
        n_out: width of the outputs.
        is_output: whether the ReLU is left out.

    Example:
        >>> import torch
        >>> bool((MLPLayer(3, 2)(torch.randn(5, 3)) >= 0).all())
        True
    """

    def __init__(self, n_in: int, n_out: int, is_output: bool = False):
        super().__init__()
        self.linear = nn.Linear(n_in, n_out)
        self.activation = nn.Identity() if is_output else nn.ReLU()

    def forward(self, x: Tensor) -> Tensor:
        """Return [n, n_out] for x [n, n_in]."""
        return self.activation(self.linear(x))


class MLPHead(nn.Module):
    """Two hidden ReLU layers from encodings and prior features to logits; called like `GatedBlock`.

    Args:
        n_position: P, width of the encoded positions.
        n_direction: D, width of the encoded viewing directions; 0 without.
        n_features: F, number of prior features.
        n_out: number of logits.
        width: of the hidden layers.

    Example:
        >>> import torch
        >>> MLPHead(9, 0, 4, n_out=2)(torch.zeros(5, 9), torch.zeros(5, 4)).shape
        torch.Size([5, 2])
    """

    def __init__(self, n_position: int, n_direction: int, n_features: int, n_out: int, width: int = 64):
        super().__init__()
        self.layers = nn.Sequential(
            MLPLayer(n_position + n_direction + n_features, width),
            MLPLayer(width, width),
            MLPLayer(width, n_out, is_output=True),
        )

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [n, n_out] for encodings [n, P], [n, D] (None if D = 0) and prior features [n, F]."""
        return self.layers(join_inputs(position_encoding, features, direction_encoding))
