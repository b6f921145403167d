"""The training loop: schedule the rate, step, check for divergence, split the batch when memory runs out."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from ...compute.progress import Progress
from ...errors import Cancelled, Diverged, OutOfMemory
from ...io.failures import is_out_of_memory
from .checkpoint import Checkpoint
from .state import TrainingState

CHECK_EVERY = 10  # iterations between checks of the loss, since reading it waits for the device
MOST_PARTS = 64  # of a batch
Metrics = Mapping[str, Any]  # numbers or scalar tensors by name
Step = Callable[[int, float], tuple[Tensor, Metrics]]  # iteration, batch_scale -> loss, metrics
Schedule = Callable[[int, int], float]  # iteration, iterations -> factor of the learning rate


def cosine_with_warmup(warmup: int, floor: float) -> Schedule:
    """Return a schedule of linear warm-up times a cosine decay (Loshchilov and Hutter 2017).

    Args:
        warmup: Iterations.
        floor: Factor at the end, in [0, 1].
    """

    def factor(iteration: int, total: int) -> float:
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / total))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * (floor + (1 - floor) * cosine)

    return factor


def exponential_with_warmup(warmup: int, hold: float, floor: float) -> Schedule:
    """Return a schedule of linear warm-up, a constant phase and an exponential decay.

    Args:
        warmup: Iterations.
        hold: Share of the run before the decay, in [0, 1).
        floor: Factor at the end, in (0, 1].
    """

    def factor(iteration: int, total: int) -> float:
        late = max(0.0, (iteration / total - hold) / (1 - hold))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * floor**late

    return factor


def constant(iteration: int, total: int) -> float:
    """Schedule of a constant learning rate."""
    del iteration, total
    return 1.0


def train(
    training_state: TrainingState,
    until: int,
    step: Step,
    schedule: Schedule,
    progress: Progress,
    checkpoint: Checkpoint | None = None,
) -> None:
    """Train until `until` iterations are done.

    When memory runs out, the iteration is repeated with the batch in twice as many parts, whose gradients are averaged.
    Each process of a group takes an equal share of the batch.

    Args:
        training_state: Optimizer and iterations done; advanced in place.
        until: At most `training_state.iterations`.
        step: Maps iteration and batch_scale, the share of the batch to take, to a loss [] and metrics.
        schedule: Factor of the learning rate of every parameter group, from iteration and `training_state.iterations`.
        progress: Receives the metrics of each iteration; may raise Cancelled.
        checkpoint: Saved when due, and on cancellation.

    Raises:
        Diverged: The loss is not finite.
        OutOfMemory: Even the smallest part does not fit.
        Cancelled: Raised by `progress`.
    """
    optimizer = training_state.optimizer
    rates = [group["lr"] for group in optimizer.param_groups]
    parts = 1
    while training_state.done < until:
        iteration = training_state.done
        for group, rate in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = rate * schedule(iteration, training_state.iterations)
        optimizer.zero_grad(set_to_none=True)
        try:
            loss, metrics = _gradients(training_state, step, iteration, parts)
        except RuntimeError as error:
            if not is_out_of_memory(error):
                raise
            if parts == MOST_PARTS:
                raise OutOfMemory(
                    "The device has too little memory even for a {parts}th of the batch.",
                    "Use the CPU.",
                    parts=MOST_PARTS,
                ) from error
            parts *= 2
            continue
        is_checked = iteration % CHECK_EVERY == 0 or iteration == until - 1
        if is_checked and not math.isfinite(float(training_state.process_group.mean(loss))):
            raise Diverged(
                "Training diverged at iteration {iteration}: loss {loss}.",
                "Lower the learning rate.",
                iteration=iteration,
                loss=float(loss),
            )
        training_state.process_group.average(
            parameter for group in optimizer.param_groups for parameter in group["params"]
        )
        optimizer.step()
        training_state.done += 1
        _report(metrics, progress, checkpoint)
    for group, rate in zip(optimizer.param_groups, rates, strict=True):
        group["lr"] = rate


def _gradients(training_state: TrainingState, step: Step, iteration: int, parts: int) -> tuple[Tensor, Metrics]:
    """Accumulate this process's gradients over `parts` of its batch; return the mean loss and the last metrics."""
    losses, metrics = [], {}
    with training_state.process_group.rank_random(training_state.generator):
        for _ in range(parts):
            loss, metrics = step(iteration, 1 / (parts * training_state.process_group.size))
            share = loss / parts
            share.backward()
            losses.append(share.detach())
    return torch.stack(losses).sum(), metrics


def _report(metrics: Metrics, progress: Progress, checkpoint: Checkpoint | None) -> None:
    try:
        progress.step(1, **metrics)
    except Cancelled:
        if checkpoint is not None:
            checkpoint.save()
        raise
    if checkpoint is not None:
        checkpoint.save_if_due()
