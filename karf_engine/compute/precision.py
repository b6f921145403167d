"""64-bit floats, on the processor for devices that lack them."""

from __future__ import annotations

import torch
from torch import Tensor

WITHOUT_FLOAT64 = ("mps",)  # types of devices


def float64_device(device: torch.device) -> torch.device:
    """Return the device that computes in float64 for tensors of a device: itself, or the processor."""
    return torch.device("cpu") if device.type in WITHOUT_FLOAT64 else device


def to_float64(values: Tensor) -> Tensor:
    """Convert values to float64, on the `float64_device` of theirs."""
    return values.to(float64_device(values.device), torch.float64)
