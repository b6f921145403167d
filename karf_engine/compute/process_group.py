"""Data-parallel training of one scene, launched by `torchrun -m karf_engine geometry ...`.

Each process samples its share of an iteration's rays and applies the mean of all gradients.
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

from ..errors import BadRequest

PATIENCE = timedelta(days=30)  # helpers wait for whole stages; torchrun detects processes that died


@dataclass(frozen=True)
class ProcessGroup:
    """Rank and size of a process group; a group of one does nothing.

    Attributes:
        rank: Rank of this process; rank 0 runs the command, the others help it.
        size: Number of processes.
    """

    rank: int = 0
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

        Raises:
            BadRequest: The processes have parameters of different sizes.
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
