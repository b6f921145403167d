"""A field's grid and tables as kernels see them, with the gradients that they add up."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor, nn

from ..grid import VoxelGrid
from .arrays import DENSITY, FEATURES, Axes, Grid, Network, TablePair


class FieldTables:
    """Arrays of one field; its parameters are shared, not copied.

    Attributes:
        grid: The cells.
        gradients: Of densities and of features, added up since the last step.
        touched: Which rows have gradients, bits of arrays.DENSITY and arrays.FEATURES, [n] uint8.
        n_features: A tuple as long as there are features: lengths of tuples are constants to numba.
        n_hidden: A tuple as long as there are hidden units.
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
        """Raw densities and features, as torch knows them."""
        return self.field.raw_density, self.field.feature_table

    @property
    def values(self) -> TablePair:
        """Raw densities and features, the field's own memory."""
        return TablePair(*map(flat, self.parameters))

    def show_gradients(self) -> None:
        """Let the field's parameters have these gradients, in this very memory: processes that learn together read it."""
        for parameter, gradients in zip(self.parameters, self.gradients, strict=True):
            parameter.grad = torch.from_numpy(gradients).view_as(parameter)

    def touch_others(self) -> None:
        """Note the rows that have gradients of other processes."""
        density, features = self.gradients
        self.touched |= DENSITY * (density != 0) | FEATURES * (features.reshape(len(density), -1) != 0).any(1)

    def network(self) -> Network:
        """The color network as it is now."""
        return network_of(self.field)


def grid_of(field: VoxelGrid) -> Grid:
    """The cells of a field, with its densities."""
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
    """The color network as it is now."""
    first, _, last = field.color_network
    return Network(
        np.ascontiguousarray(first.weight.detach().numpy().T),
        first.bias.detach().numpy(),
        last.weight.detach().numpy(),
        last.bias.detach().numpy(),
    )


def flat(tensor: Tensor) -> np.ndarray:
    """A tensor's own memory as one row."""
    return tensor.detach().numpy().reshape(-1)
