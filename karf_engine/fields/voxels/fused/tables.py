"""Grid, tables and gradients of a field as arrays."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ..grid import VoxelGrid
from .arrays import DENSITY, FEATURES, Axes, Grid, Network, TablePair


class FieldTables:
    """Arrays of one field; the parameters are not copied.

    Attributes:
        grid: Cells of the field.
        gradients: Gradients of densities and features, accumulated since the last step.
        touched: [n] uint8, flags of each row's gradients (arrays.DENSITY, arrays.FEATURES).
        n_features: Tuple of F elements: numba treats its length as a constant.
        n_hidden: Tuple of H elements.
    """

    def __init__(self, field: VoxelGrid) -> None:
        self.field = field
        self.grid = grid_of(field)
        sizes = len(field.raw_density), field.feature_table.numel()
        self.gradients = TablePair(*(np.zeros(size, np.float32) for size in sizes))
        self.touched = np.zeros(len(field.raw_density), np.uint8)
        self.n_features, self.n_hidden = (0,) * field.n_features, (0,) * field.width

    @property
    def parameters(self) -> tuple[nn.Parameter, nn.Parameter]:
        """Raw densities and features as parameters."""
        return self.field.raw_density, self.field.feature_table

    @property
    def values(self) -> TablePair:
        """Raw densities and features as arrays."""
        return TablePair(*map(flat, self.parameters))

    def expose_gradients(self) -> None:
        """Set the `grad` of both parameters to the gradients' own memory, which process groups reduce in place."""
        for parameter, gradients in zip(self.parameters, self.gradients, strict=True):
            parameter.grad = torch.from_numpy(gradients).view_as(parameter)

    def touch_remote_rows(self) -> None:
        """Flag the rows with gradients from other processes."""
        density, features = self.gradients
        self.touched |= DENSITY * (density != 0) | FEATURES * (features.reshape(len(density), -1) != 0).any(1)


def grid_of(field: VoxelGrid) -> Grid:
    """Return the cells of a field, with its densities."""
    bits = np.packbits(field.occupied.numpy(), axis=2, bitorder="little")
    row_stride, plane_stride = field.vertex_numbers(torch.tensor([[0, 1, 0], [1, 0, 0]])).tolist()
    return Grid(
        field.minimum.numpy(),
        np.float32(field.voxel),
        Axes(*field.occupied.shape),
        Axes(*field.coarse.shape),
        bits.shape[2],
        row_stride,
        plane_stride,
        bits.ravel(),
        field.coarse.numpy().view(np.uint8).ravel(),
        field.index.view(-1).numpy(),
        flat(field.raw_density),
        np.float32(field.density_bias),
    )


def network_of(field: VoxelGrid) -> Network:
    """Return the color network with a transposed copy of its first layer's weights."""
    hidden, output = field.color_layers
    return Network(
        np.ascontiguousarray(hidden.weight.detach().numpy().T),
        hidden.bias.detach().numpy(),
        output.weight.detach().numpy(),
        output.bias.detach().numpy(),
    )


def flat(tensor: Tensor) -> np.ndarray:
    """Return a flat view of a tensor's memory."""
    return tensor.detach().numpy().reshape(-1)
