"""The one training loop: schedule, step, stop on what is not finite, halve the batch when memory runs out."""

from __future__ import annotations

import math
from collections.abc import Callable

import torch
from torch import Tensor

from .errors import Diverged, OutOfMemory
from .failures import is_out_of_memory
from .progress import Progress

CHECK_EVERY = 10


def warm_cosine(warmup: int, floor: float) -> Callable[[int, int], float]:
    """Learning-rate factor: linear warm-up over `warmup` iterations, then a cosine from 1 down to `floor`."""

    def factor(iteration: int, total: int) -> float:
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / total))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * (floor + (1 - floor) * cosine)

    return factor


def warm_exponential(warmup: int, hold: float, floor: float) -> Callable[[int, int], float]:
    """Linear warm-up, 1 until the share `hold` of the run, then an exponential decay to `floor`."""

    def factor(iteration: int, total: int) -> float:
        late = max(0.0, (iteration / total - hold) / (1 - hold))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * floor**late

    return factor


def constant(iteration: int, total: int) -> float:
    """Learning-rate factor that leaves the rate as it is."""
    del iteration, total
    return 1.0


def train(
    iterations: int,
    optimizer: torch.optim.Optimizer,
    step: Callable[[int, float], tuple[Tensor, dict[str, float]]],
    schedule: Callable[[int, int], float],
    progress: Progress,
) -> None:
    """Run `iterations` of `loss, metrics = step(iteration, batch_scale)` and the optimizer.

    schedule(iteration, iterations) multiplies every group's learning rate. batch_scale starts at 1 and is halved when
    memory runs out. Raises Diverged at a loss that is not finite, OutOfMemory when halving no longer helps, and what
    progress.step raises on cancel.
    """
    rates = [group["lr"] for group in optimizer.param_groups]
    batch_scale = 1.0
    for iteration in range(iterations):
        for group, rate in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = rate * schedule(iteration, iterations)
        optimizer.zero_grad(set_to_none=True)
        try:
            loss, metrics = step(iteration, batch_scale)
            loss.backward()
        except RuntimeError as error:
            if not is_out_of_memory(error):
                raise
            batch_scale /= 2
            if batch_scale < 1 / 64:
                raise OutOfMemory(
                    "The device has too little memory even for a 64th of the batch.", "Use the CPU."
                ) from error
            continue
        # reading the loss waits for the device: every tenth time is soon enough to stop
        is_checked = iteration % CHECK_EVERY == 0 or iteration == iterations - 1
        if is_checked and not math.isfinite(float(loss.detach())):
            raise Diverged(
                f"Training diverged at iteration {iteration}: loss {float(loss.detach())}.", "Lower the learning rate."
            )
        optimizer.step()
        progress.step(**metrics)
    for group, rate in zip(optimizer.param_groups, rates, strict=True):
        group["lr"] = rate
