"""Adam that updates only the table rows touched in an iteration, like `torch.optim.SparseAdam`."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ....compute.cores import parallel_for
from ....compute.kernels import kernel
from ....compute.runtime import ProcessGroup
from ...training import Adam
from .arrays import DENSITY, FEATURES, Table
from .marching import ONE, ZERO
from .tables import FieldTables, flat

EPSILON = np.float32(1e-12)


@kernel
def adam_value(table, k, step, beta1, beta2, correction):
    """Update one value and reset its gradient."""
    gradient = table.gradients[k]
    table.gradients[k] = np.float32(0)
    mean = beta1 * table.means[k] + (ONE - beta1) * gradient
    square = beta2 * table.squares[k] + (ONE - beta2) * gradient * gradient
    table.means[k], table.squares[k] = mean, square
    table.values[k] -= step * mean / (np.float32(math.sqrt(square)) * correction + EPSILON)


@kernel
def adam_rows(first, last, touched, density, features, n_features, step, beta1, beta2, correction):
    """Update the touched rows first to last.

    step: learning rate / (1 - beta1^t). correction: 1 / sqrt(1 - beta2^t).
    """
    n = len(n_features)
    for row in range(first, last):
        if touched[row] & DENSITY and density.gradients[row] != ZERO:
            adam_value(density, row, step, beta1, beta2, correction)
        start = np.uint64(row) * np.uint64(n)
        if touched[row] & FEATURES and has_gradient(features.gradients, start, n):
            for number in range(n):
                adam_value(features, start + np.uint64(number), step, beta1, beta2, correction)
        touched[row] = np.uint8(0)


@kernel
def has_gradient(gradients, start, n):
    """Return True if any of n values is not 0: all that a process group knows of other processes' rows."""
    for number in range(n):
        if gradients[start + np.uint64(number)] != ZERO:
            return True
    return False


class LazyAdam(Adam):
    """Adam whose first parameter group is a field's tables; their gradients are those accumulated by the kernels."""

    def __init__(
        self, groups: list[dict], betas: tuple[float, float], tables: FieldTables, process_group: ProcessGroup
    ) -> None:
        super().__init__(groups, betas=betas, eps=float(EPSILON), fused=True)
        self._tables, self._process_group = tables, process_group

    @torch.no_grad()
    def step(self, closure: None = None) -> None:
        """Update all parameters with a gradient."""
        tables = self._tables
        if self._process_group.size > 1:
            tables.touch_remote_rows()
        group = self.param_groups[0]
        beta1, beta2 = group["betas"]
        density, features = (self._table(p, g) for p, g in zip(group["params"], tables.gradients, strict=True))
        count = float(self.state[group["params"][0]]["step"])
        rate = group["lr"] / (1 - beta1**count)
        correction = 1 / math.sqrt(1 - beta2**count)
        parallel_for(
            adam_rows, len(tables.touched), tables.touched, density, features, tables.n_features,
            *map(np.float32, (rate, beta1, beta2, correction)),
        )  # fmt: skip
        for parameter in group["params"]:
            parameter.grad = None  # excludes the tables from the dense step
        super().step(closure)

    def _table(self, parameter: Tensor, gradients: np.ndarray) -> Table:
        """Increment the step of a parameter and return its arrays."""
        state = self.state[parameter]
        if not state:
            state["step"] = torch.zeros(())
            state["exp_avg"], state["exp_avg_sq"] = torch.zeros_like(parameter), torch.zeros_like(parameter)
        state["step"] += 1
        return Table(flat(parameter), gradients, flat(state["exp_avg"]), flat(state["exp_avg_sq"]))
