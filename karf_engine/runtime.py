"""Where and how to compute: device, threads, seed. One value, passed along, never global."""

from __future__ import annotations

import os
from dataclasses import dataclass

import torch

from .errors import BadRequest


@dataclass(frozen=True)
class Runtime:
    """device: where tensors live. generator: the source of every random number of a stage."""

    device: torch.device
    generator: torch.Generator

    def rand(self, *shape: int) -> torch.Tensor:
        """Uniform numbers in [0, 1)."""
        return torch.rand(*shape, generator=self.generator, device=self.device)

    def randn(self, *shape: int) -> torch.Tensor:
        """Numbers of a normal distribution of mean 0 and variance 1."""
        return torch.randn(*shape, generator=self.generator, device=self.device)

    def randint(self, high: int, count: int) -> torch.Tensor:
        """`count` whole numbers in [0, high)."""
        return torch.randint(high, (count,), generator=self.generator, device=self.device)


def default_threads() -> int:
    """All cores this process may use, at most 4: more gain nothing at these batch sizes, and busy cores cost much."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(4, available))


def start_runtime(seed: int = 0, threads: int | None = None, device: str | None = None) -> Runtime:
    """Set torch up for this process and seed it. Raises BadRequest where the device is not there.

    device: `cpu`, `cuda` or None for CUDA where there is one.
    """
    if device is None:
        device = "cuda" if torch.cuda.is_available() else "cpu"
    if device.startswith("cuda") and not torch.cuda.is_available():
        raise BadRequest(
            f"Device {device!r} is not available here.", "Use --device cpu, or install a CUDA build of torch."
        )
    torch.set_num_threads(threads or default_threads())
    torch.set_flush_denormal(True)  # decaying Adam moments become denormal and slow every step down
    torch.manual_seed(seed)
    chosen = torch.device(device)
    return Runtime(chosen, torch.Generator(device=chosen).manual_seed(seed))
