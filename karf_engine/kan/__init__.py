"""Kolmogorov-Arnold networks: Gaussian, B-spline and plain layers, and the paper's gated block made of them.

Each layer is a `torch.nn.Module` from [..., n_in] to [..., n_out] and can be used alone. Arguments of wrong types raise
TypeError, impossible values and tensors of wrong shape, dtype or device BadRequest.

>>> import torch
>>> from karf_engine.kan import GatedBlock, GRBFLayer, positional_encoding
>>> network = torch.nn.Sequential(GRBFLayer(n_in=3, n_out=16), GRBFLayer(16, 1, n_centers=5))
>>> positions, features = torch.rand(5, 3), torch.rand(5, 12)
>>> network(positions).shape
torch.Size([5, 1])
>>> block = GatedBlock(n_position=33, n_direction=0, n_features=12, n_out=4, width=16)  # Eq. 6
>>> block(positional_encoding(positions, 5), features).shape
torch.Size([5, 4])

The package needs torch; from this project it uses only errors, argument checks and the settings' list of layers.
"""

from .gated_block import VARIANTS, GatedBlock, MLPHead, count_parameters
from .grbf import grbf_reference, grid_spacing, resolve_bandwidth
from .inputs import Standardizer, join_inputs, positional_encoding
from .layers import LAYERS, BSplineLayer, GRBFLayer, LayerOptions, MLPLayer, bspline_bases, register_layer

__all__ = [
    "LAYERS", "VARIANTS", "BSplineLayer", "GRBFLayer", "GatedBlock", "LayerOptions", "MLPHead", "MLPLayer", "Standardizer",
    "bspline_bases", "count_parameters", "grbf_reference", "grid_spacing", "join_inputs", "positional_encoding",
    "register_layer", "resolve_bandwidth",
]  # fmt: skip
