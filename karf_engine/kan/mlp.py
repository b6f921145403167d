"""Linear layers with ReLU: the baseline of the Kolmogorov-Arnold layers, and the fast head."""

from torch import Tensor, nn

from ..io.arguments import check_arguments, check_number
from .checks import check_encodings, check_rows, head_widths
from .encoding import join_inputs


class MLPLayer(nn.Module):
    """Map [..., n_in] to [..., n_out] by a linear layer and, unless it is an output layer, a ReLU.

    Args:
        n_in: width of the inputs.
        n_out: width of the outputs.
        is_output: leave out the ReLU.

    Example:
        >>> import torch
        >>> bool((MLPLayer(3, 2)(torch.randn(5, 3)) >= 0).all())
        True
    """

    @check_arguments
    def __init__(self, n_in: int, n_out: int, is_output: bool = False):
        super().__init__()
        check_number("n_in", n_in, 1)
        check_number("n_out", n_out, 1)
        self.linear = nn.Linear(n_in, n_out)
        self.activation = nn.Identity() if is_output else nn.ReLU()

    def forward(self, x: Tensor) -> Tensor:
        """Return [..., n_out] for x [..., n_in]."""
        check_rows("x", x, self.linear.in_features, self.linear.weight)
        return self.activation(self.linear(x))


class MLPHead(nn.Module):
    """Map encodings and prior features to logits by two hidden ReLU layers; called like `GatedBlock`.

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

    @check_arguments
    def __init__(self, n_position: int, n_direction: int, n_features: int, n_out: int, width: int = 64):
        super().__init__()
        self._widths = head_widths(n_position, n_direction, n_features, n_out, width)
        self.layers = nn.Sequential(
            MLPLayer(n_position + n_direction + n_features, width),
            MLPLayer(width, width),
            MLPLayer(width, n_out, is_output=True),
        )

    def forward(self, position_encoding: Tensor, features: Tensor, direction_encoding: Tensor | None = None) -> Tensor:
        """Return logits [..., n_out] for encodings [..., P], [..., D] (None if D = 0) and prior features [..., F]."""
        check_encodings(position_encoding, features, direction_encoding, self._widths, next(self.parameters()))
        return self.layers(join_inputs(position_encoding, features, direction_encoding))
