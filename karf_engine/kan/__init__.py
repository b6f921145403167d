"""Kolmogorov-Arnold networks: Gaussian, B-spline and plain layers, and the paper's gated block made of them.

Arguments of wrong types raise TypeError, impossible values and tensors of wrong shape, dtype or device BadRequest.
Each layer is a `torch.nn.Module` from [..., n_in] to [..., n_out] and can be used alone:

>>> import torch
>>> from karf_engine.kan import GatedBlock, GRBFLayer
>>> _ = torch.manual_seed(0)
>>> layer = GRBFLayer(n_in=3, n_out=16, n_centers=8)
>>> layer(torch.rand(5, 3)).shape
torch.Size([5, 16])

It is trained like any other module:

>>> network = torch.nn.Sequential(GRBFLayer(1, 8), GRBFLayer(8, 1))
>>> optimizer = torch.optim.Adam(network.parameters(), lr=0.02)
>>> x = torch.linspace(-1, 1, 64)[:, None]
>>> for _ in range(200):
...     loss = (network(x) - torch.sin(3 * x)).square().mean()
...     optimizer.zero_grad()
...     loss.backward()
...     optimizer.step()
>>> bool(loss < 0.05)
True

The gated block (Eq. 6) reads encoded positions, prior features and, optionally, encoded directions:

>>> from karf_engine.kan import positional_encoding
>>> positions, features = torch.rand(5, 3), torch.rand(5, 12)
>>> block = GatedBlock(n_position=33, n_direction=0, n_features=12, n_out=4, width=16)
>>> block(positional_encoding(positions, 5), features).shape
torch.Size([5, 4])

The package needs torch; from this project it uses only errors, argument checks and the settings' list of layers.
"""

from .bspline import BSplineLayer, bspline_bases
from .encoding import join_inputs, positional_encoding
from .gated_block import VARIANTS, GatedBlock, count_parameters
from .grbf import GRBFLayer, grbf_reference, grid_spacing, resolve_bandwidth
from .layers import LAYERS, LayerOptions, register_layer
from .mlp import MLPHead, MLPLayer
from .standardize import Standardizer

__all__ = [
    "LAYERS",
    "VARIANTS",
    "BSplineLayer",
    "GRBFLayer",
    "GatedBlock",
    "LayerOptions",
    "MLPHead",
    "MLPLayer",
    "Standardizer",
    "bspline_bases",
    "count_parameters",
    "grbf_reference",
    "grid_spacing",
    "join_inputs",
    "positional_encoding",
    "register_layer",
    "resolve_bandwidth",
]
