"""What makes the processor wait for an accelerator, counted on any machine."""

from __future__ import annotations

import torch
from torch.utils._python_dispatch import TorchDispatchMode

aten = torch.ops.aten
WAITING = {  # operations whose result, or its shape, must be read before the next one can be queued
    aten._local_scalar_dense.default,
    aten.nonzero.default,
    aten.masked_select.default,
    aten.unique_dim.default,
    aten._unique2.default,
    aten.unique_consecutive.default,
    aten.repeat_interleave.Tensor,
    aten.bincount.default,
    aten.equal.default,
}
INDEXING = {aten.index.Tensor, aten.index_put.default, aten.index_put_.default}


class Waits(TorchDispatchMode):
    """Notes every operation within it, forward and backward, that an accelerator would be waited for.

    Attributes:
        found: Their names.
    """

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def __torch_dispatch__(self, function, types, args=(), kwargs=None):
        if function in WAITING or (function in INDEXING and _by_mask(args[1])) or _comes_back(args, kwargs or {}):
            self.found.append(str(function))
        return function(*args, **kwargs or {})


def _by_mask(indices) -> bool:
    return any(index is not None and index.dtype == torch.bool for index in indices)


def _comes_back(args, kwargs) -> bool:
    """Whether a tensor is copied from an accelerator to the processor."""
    to = kwargs.get("device")
    return (
        to is not None
        and torch.device(to).type == "cpu"
        and isinstance(args[0], torch.Tensor)
        and args[0].device.type != "cpu"
    )
