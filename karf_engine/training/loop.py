"""The one training loop: schedule, step, stop on what is not finite, take a batch in parts when memory runs out."""

from __future__ import annotations

import math
from collections.abc import Callable

from torch import Tensor

from ..errors import Cancelled, Diverged, OutOfMemory
from ..failures import is_out_of_memory
from ..progress import Progress
from .course import Course
from .unfinished import Unfinished

CHECK_EVERY = 10
MOST_PARTS = 64  # of a batch
Step = Callable[[int, float], tuple[Tensor, dict[str, float]]]  # iteration, batch_scale -> loss, metrics
Schedule = Callable[[int, int], float]  # iteration, iterations -> factor of the learning rate


def cosine_with_warmup(warmup: int, floor: float) -> Schedule:
    """Learning-rate factor: linear warm-up over `warmup` iterations, then a cosine from 1 down to `floor`."""

    def factor(iteration: int, total: int) -> float:
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / total))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * (floor + (1 - floor) * cosine)

    return factor


def exponential_with_warmup(warmup: int, hold: float, floor: float) -> Schedule:
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
    course: Course,
    until: int,
    step: Step,
    schedule: Schedule,
    progress: Progress,
    unfinished: Unfinished | None = None,
) -> None:
    """Run the course's `loss, metrics = step(iteration, batch_scale)` and its optimizer until so many are done.

    schedule(iteration, course.iterations) multiplies every group's learning rate. When memory runs out, the iteration is
    tried again with the batch in twice as many parts, each a step of batch_scale = 1 / parts, whose losses are averaged.
    unfinished: told after each iteration, and at a cancel, so that what is learned is kept. Raises Diverged at a loss
    that is not finite, OutOfMemory when smaller parts no longer help, and what progress.step raises on cancel.
    """
    optimizer = course.optimizer
    rates = [group["lr"] for group in optimizer.param_groups]
    parts = 1
    while course.done < until:
        iteration = course.done
        for group, rate in zip(optimizer.param_groups, rates, strict=True):
            group["lr"] = rate * schedule(iteration, course.iterations)
        optimizer.zero_grad(set_to_none=True)
        try:
            loss, metrics = _gradients(step, iteration, parts)
        except RuntimeError as error:
            if not is_out_of_memory(error):
                raise
            if parts == MOST_PARTS:
                raise OutOfMemory(
                    f"The device has too little memory even for a {MOST_PARTS}th of the batch.", "Use the CPU."
                ) from error
            parts *= 2
            continue
        # reading the loss waits for the device: every tenth time is soon enough to stop
        is_checked = iteration % CHECK_EVERY == 0 or iteration == until - 1
        if is_checked and not math.isfinite(float(loss)):
            raise Diverged(
                f"Training diverged at iteration {iteration}: loss {float(loss)}.", "Lower the learning rate."
            )
        optimizer.step()
        course.done += 1
        _tell(metrics, progress, unfinished)
    for group, rate in zip(optimizer.param_groups, rates, strict=True):
        group["lr"] = rate


def _gradients(step: Step, iteration: int, parts: int) -> tuple[Tensor, dict[str, float]]:
    """Gradients of the loss over a batch in parts; its mean, and the last part's metrics."""
    mean = 0.0
    for _ in range(parts):
        loss, metrics = step(iteration, 1 / parts)
        share = loss / parts
        share.backward()
        mean = mean + share.detach()
    return mean, metrics


def _tell(metrics: dict[str, float], progress: Progress, unfinished: Unfinished | None) -> None:
    try:
        progress.step(**metrics)
    except Cancelled:
        if unfinished is not None:
            unfinished.save()
        raise
    if unfinished is not None:
        unfinished.offer()
