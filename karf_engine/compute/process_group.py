"""Several processes that learn one scene together, by torch's own launcher: `torchrun -m karf_engine geometry ...`.

Each draws its share of an iteration's rays and learns from the mean of all gradients, so that all hold the same field.
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

PATIENCE = timedelta(days=30)  # timeout: helpers wait for whole stages; torchrun notices which process has died


@dataclass(frozen=True)
class ProcessGroup:
    """Which process this is, and of how many. By default it is alone, and nothing below does anything.

    Attributes:
        rank: From 0; the first one runs the command, the others help it.
        size: How many there are.
    """

    rank: int = 0
    size: int = 1

    def share(self, value: Any = None) -> Any:
        """The first process's value, at all of them; each calls this at the same place."""
        if self.size == 1:
            return value
        box = [value]
        distributed.broadcast_object_list(box, src=0, device=torch.device("cpu"))
        return box[0]

    def mean(self, value: Tensor) -> Tensor:
        """The mean of all processes' tensors of one shape; in place."""
        if self.size > 1:
            distributed.all_reduce(value)
            value /= self.size
        return value

    def average(self, parameters: Iterable[Tensor]) -> None:
        """Replace gradients by their means over all processes; one that no process has stays None.

        Raises:
            BadRequest: Parameters have other sizes elsewhere.
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
            if size and parameter.grad is None:
                parameter.grad = torch.zeros_like(parameter)
            if size:
                self.mean(parameter.grad)

    @contextmanager
    def own_numbers(self, generator: torch.Generator) -> Iterator[None]:
        """Random numbers of this process alone; afterwards the generator stands at one place for all again."""
        if self.size == 1:
            yield
            return
        before = generator.get_state()
        torch.rand((), generator=generator, device=generator.device)  # all move on alike
        after = generator.get_state()
        generator.manual_seed(zlib.crc32(after.numpy()) + self.rank)  # reading the number would wait for the device
        try:
            yield
        except BaseException:
            generator.set_state(before)
            raise
        generator.set_state(after)


_joined = ProcessGroup()


def join() -> ProcessGroup:
    """Join the processes that torchrun has started; each on a card of its own where there are some."""
    global _joined
    has_cards = torch.cuda.is_available()
    if has_cards:
        torch.cuda.set_device(int(os.environ["LOCAL_RANK"]) % torch.cuda.device_count())
    distributed.init_process_group("cpu:gloo,cuda:nccl" if has_cards else "gloo", timeout=PATIENCE)
    _joined = ProcessGroup(distributed.get_rank(), distributed.get_world_size())
    return _joined


def leave() -> None:
    """Part, once all are here: a process that just ends may take the others' last message with it."""
    distributed.barrier()
    distributed.destroy_process_group()


def joined() -> ProcessGroup:
    """The process group of this process: alone, unless it has joined one."""
    return _joined
