"""Example layer (docs/extending.md): a linear map."""

from torch import nn

from karf_engine.kan import LayerOptions


def linear(n_in: int, n_out: int, options: LayerOptions) -> nn.Module:
    """A layer from [..., n_in] to [..., n_out]."""
    return nn.Linear(n_in, n_out)
