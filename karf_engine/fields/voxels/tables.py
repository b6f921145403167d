"""Operations on vertex tables and cell occupancy."""

from __future__ import annotations

from typing import Any

import torch
from torch import Tensor, nn
from torch.nn.functional import softplus

from ..rendering.sampling import dilate_axis


class WeightedGather(torch.autograd.Function):
    """sum_k weights[:, k] * table[rows[:, k]], differentiable in the table alone."""

    @staticmethod
    def forward(context: Any, table: Tensor, rows: Tensor, weights: Tensor) -> Tensor:
        context.save_for_backward(rows, weights)
        context.n_rows = len(table)
        return nn.functional.embedding_bag(rows, table, per_sample_weights=weights, mode="sum")

    @staticmethod
    def backward(context: Any, gradient: Tensor) -> tuple[Tensor, None, None]:
        rows, weights = context.saved_tensors
        n_columns = gradient.shape[1]
        if gradient.device.type == "cpu":  # scattering scalars by column is four times faster than scattering rows
            columns = torch.zeros(n_columns, context.n_rows, dtype=gradient.dtype)
            index = rows.long().view(-1)
            for column in range(n_columns):
                columns[column].scatter_add_(0, index, (gradient[:, column, None] * weights).view(-1))
            return columns.t().contiguous(), None, None
        table_gradient = torch.zeros(context.n_rows, n_columns, dtype=gradient.dtype, device=gradient.device)
        for k in range(8):  # avoids an [n, 8, F] copy
            table_gradient.index_add_(0, rows[:, k], gradient * weights[:, k : k + 1])
        return table_gradient, None, None


def rescaled_raw(raw: Tensor, ratio: float, bias: float) -> Tensor:
    """Return the raw density that keeps softplus(raw + bias) / voxel when the voxel edge changes by `ratio`."""
    optical_depth = softplus(raw + bias) * ratio
    # inverse softplus: log(expm1(x)) = x + log(-expm1(-x)) neither overflows nor cancels
    return optical_depth + torch.log(-torch.expm1(-optical_depth)) - bias


def dilate(occupied: Tensor) -> Tensor:
    """Dilate occupied cells [X, Y, Z] bool by one cell, diagonals included."""
    for axis in range(3):
        occupied = dilate_axis(occupied, axis, 1)
    return occupied
