"""Device, threads, random generator and process group of a stage, passed along as one value.

Processes that `torchrun -m karf_engine geometry ...` starts train one scene together: each samples its share of an
iteration's rays and applies the mean of all gradients.
"""

from __future__ import annotations

import os
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import timedelta
from typing import Any

import torch
from torch import Tensor, distributed

from ..errors import BadRequest, is_out_of_memory
from . import cores

NEEDS = {
    "cuda": " It needs a CUDA build of torch and an NVIDIA or AMD card.",
    "mps": " It needs torch on Apple silicon.",
}
PATIENCE = timedelta(days=30)  # helpers wait for whole stages; torchrun detects processes that died


@dataclass(frozen=True)
class ProcessGroup:
    """Rank and size of a process group; a group of one does nothing."""

    rank: int = 0  # of this process; rank 0 runs the command, the others help it
    size: int = 1

    def share(self, value: Any = None) -> Any:
        """Broadcast the value of rank 0 and return it; a collective call."""
        if self.size == 1:
            return value
        box = [value]
        distributed.broadcast_object_list(box, src=0, device=torch.device("cpu"))
        return box[0]

    def mean(self, value: Tensor) -> Tensor:
        """Average a tensor over all processes, in place; a collective call."""
        if self.size > 1:
            distributed.all_reduce(value)
            value /= self.size
        return value

    def average(self, parameters: Iterable[Tensor]) -> None:
        """Average gradients over all processes; those that are None everywhere stay None.

        Raises BadRequest if the processes have parameters of different sizes.
        """
        if self.size == 1:
            return
        parameters = list(parameters)
        sizes = torch.tensor([0 if each.grad is None else each.numel() for each in parameters])
        distributed.all_reduce(sizes, distributed.ReduceOp.MAX)
        for parameter, size in zip(parameters, sizes.tolist(), strict=True):
            if size not in (0, parameter.numel()):
                raise BadRequest(
                    f"The processes have come apart: {parameter.numel()} and {size} numbers of one tensor.",
                    "Let computers of one kind, with the same packages, learn together.",
                )
            if size:
                if parameter.grad is None:
                    parameter.grad = torch.zeros_like(parameter)
                self.mean(parameter.grad)

    @contextmanager
    def rank_random(self, generator: torch.Generator) -> Iterator[None]:
        """Draw different random numbers in each process in the block; afterwards all generators agree again."""
        if self.size == 1:
            yield
            return
        before = generator.get_state()
        torch.rand((), generator=generator, device=generator.device)  # advances all generators alike
        after = generator.get_state()
        # seeded by the state, since reading the number would synchronize with the device
        generator.manual_seed(zlib.crc32(after.numpy().tobytes()) + self.rank)
        try:
            yield
        except BaseException:
            generator.set_state(before)
            raise
        generator.set_state(after)


@dataclass(frozen=True)
class Runtime:
    """Device and random generator of a stage."""

    device: torch.device  # of all tensors
    generator: torch.Generator  # source of all random numbers, on that device
    process_group: ProcessGroup = ProcessGroup()

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
    """Return the device `cpu`, `cuda`, `cuda:<number>` or `mps`; None for CUDA if available, else the CPU.

    Raises BadRequest if the name is unknown, or the device is missing or does not respond.
    """
    available = ["cpu"]
    if torch.cuda.is_available():
        available += ["cuda", *(f"cuda:{number}" for number in range(torch.cuda.device_count()))]
    if torch.backends.mps.is_available():
        available.append("mps")
    name = ("cuda" if "cuda" in available else "cpu") if name is None else str(name)
    hint = f"Here these can be used: {', '.join(available).replace('mps', 'mps (untested)')}."
    if name not in available:
        raise BadRequest(f"There is no device {name!r}.", hint + NEEDS.get(name, ""))
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


# ------------------------------------------------------------------------------------ the process group of this process
_joined = ProcessGroup()


def join() -> ProcessGroup:
    """Join the processes that torchrun started, each on its own GPU if there are any."""
    global _joined
    has_cards = torch.cuda.is_available()
    if has_cards:
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]) % torch.cuda.device_count())
    distributed.init_process_group("cpu:gloo,cuda:nccl" if has_cards else "gloo", timeout=PATIENCE)
    _joined = ProcessGroup(distributed.get_rank(), distributed.get_world_size())
    return _joined


def leave() -> None:
    """Leave the group after a barrier, so that no message is lost."""
    distributed.barrier()
    distributed.destroy_process_group()


def current_group() -> ProcessGroup:
    """Return the process group of this process, of size 1 unless it has joined one."""
    return _joined
