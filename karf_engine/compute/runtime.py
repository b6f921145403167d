"""Where and how to compute: device, threads, seed. One value, passed along, never global."""

from __future__ import annotations

import os
from dataclasses import dataclass

import torch

from ..errors import BadRequest, is_out_of_memory
from . import cores
from .process_group import ProcessGroup


@dataclass(frozen=True)
class Runtime:
    """Where a stage computes.

    Attributes:
        device: Where tensors live.
        generator: The source of every random number of the stage, on that device.
        process_group: The processes that learn together; by default this one alone.
    """

    device: torch.device
    generator: torch.Generator
    process_group: ProcessGroup = ProcessGroup()  # noqa: RUF009 - frozen

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


def find_device(name: str | None) -> torch.device:
    """The device of this name.

    Args:
        name: `cpu`, `cuda` or `cuda:<number>`; None for CUDA where there is one, else the CPU.

    Raises:
        BadRequest: The name is another, or the device is not there or does not answer.
    """
    there = ["cpu"]
    if torch.cuda.is_available():
        there += ["cuda", *(f"cuda:{number}" for number in range(torch.cuda.device_count()))]
    name = ("cuda" if "cuda" in there else "cpu") if name is None else str(name)
    hint = f"Here these can be used: {', '.join(there)}."
    if name.split(":")[0] == "mps":
        raise BadRequest("Device 'mps' has no 64-bit numbers, in which light is summed up along rays.", hint)
    if name not in there:
        needs = " It needs a CUDA build of torch and an NVIDIA or AMD card." if name == "cuda" else ""
        raise BadRequest(f"There is no device {name!r}.", hint + needs)
    try:
        torch.ones(1, device=name).sum().item()  # a driver may be too old, or the card too new for this torch
    except (RuntimeError, AssertionError) as error:
        if is_out_of_memory(error):
            raise
        reason = str(error).partition("\n")[0]
        raise BadRequest(f"Device {name!r} does not answer: {reason}", "Use --device cpu, or another torch.") from error
    return torch.device(name)


def start_runtime(seed: int = 0, threads: int | None = None, device: str | None = None) -> Runtime:
    """Set torch up for this process and seed it.

    Args:
        seed: Of every random number.
        threads: Processor cores to use; None for `default_threads`.
        device: See `find_device`.

    Raises:
        BadRequest: The device is not there.
    """
    chosen = find_device(device)
    cores.use(threads or default_threads())
    torch.set_flush_denormal(True)  # decaying Adam moments become denormal and slow every step down
    torch.manual_seed(seed)
    return Runtime(chosen, torch.Generator(device=chosen).manual_seed(seed))
