"""Device, threads and random generator of a stage, passed along as one value."""

from __future__ import annotations

import os
from dataclasses import dataclass

import torch

from ..errors import BadRequest, is_out_of_memory
from . import cores
from .process_group import ProcessGroup


@dataclass(frozen=True)
class Runtime:
    """Device and random generator of a stage.

    Attributes:
        device: Device of all tensors.
        generator: Source of all random numbers, on that device.
        process_group: Processes that train together; by default this one alone.
    """

    device: torch.device
    generator: torch.Generator
    process_group: ProcessGroup = ProcessGroup()  # noqa: RUF009 - frozen

    def rand(self, *shape: int) -> torch.Tensor:
        """Sample uniform numbers in [0, 1)."""
        return torch.rand(*shape, generator=self.generator, device=self.device)

    def randn(self, *shape: int) -> torch.Tensor:
        """Sample standard normal numbers."""
        return torch.randn(*shape, generator=self.generator, device=self.device)

    def randint(self, high: int, count: int) -> torch.Tensor:
        """Sample `count` integers in [0, high)."""
        return torch.randint(high, (count,), generator=self.generator, device=self.device)


def default_threads() -> int:
    """Return the number of cores available to this process, at most 4: more gain nothing at these batch sizes."""
    available = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, min(4, available))


def find_device(name: str | None) -> torch.device:
    """Return the device `cpu`, `cuda` or `cuda:<number>`; None for CUDA if available, else the CPU.

    Raises:
        BadRequest: The name is unknown, or the device is missing or does not respond.
    """
    available = ["cpu"]
    if torch.cuda.is_available():
        available += ["cuda", *(f"cuda:{number}" for number in range(torch.cuda.device_count()))]
    name = ("cuda" if "cuda" in available else "cpu") if name is None else str(name)
    hint = f"Here these can be used: {', '.join(available)}."
    if name.split(":")[0] == "mps":
        raise BadRequest("Device 'mps' has no 64-bit numbers, in which light is summed up along rays.", hint)
    if name not in available:
        needs = " It needs a CUDA build of torch and an NVIDIA or AMD card." if name == "cuda" else ""
        raise BadRequest(f"There is no device {name!r}.", hint + needs)
    try:
        torch.ones(1, device=name).sum().item()  # fails if the driver is too old or the GPU too new for this torch
    except (RuntimeError, AssertionError) as error:
        if is_out_of_memory(error):
            raise
        reason = str(error).partition("\n")[0]
        raise BadRequest(f"Device {name!r} does not answer: {reason}", "Use --device cpu, or another torch.") from error
    return torch.device(name)


def start_runtime(seed: int = 0, threads: int | None = None, device: str | None = None) -> Runtime:
    """Set up torch for this process, with global side effects: threads, seed, flushing of denormals.

    `threads` defaults to `default_threads`; `device`, and the BadRequest raised for it, are those of `find_device`.
    """
    found = find_device(device)
    cores.set_core_count(threads or default_threads())
    torch.set_flush_denormal(True)  # denormal Adam moments would slow every step down
    torch.manual_seed(seed)
    return Runtime(found, torch.Generator(device=found).manual_seed(seed))
