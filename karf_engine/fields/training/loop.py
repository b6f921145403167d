"""The one training loop: schedule, step, stop on what is not finite, take a batch in parts when memory runs out."""

from __future__ import annotations

import math
from collections.abc import Callable

from torch import Tensor

from ...compute.progress import Progress
from ...errors import Cancelled, Diverged, OutOfMemory
from ...io.failures import is_out_of_memory
from .checkpoint import Checkpoint
from .state import TrainingState

CHECK_EVERY = 10
MOST_PARTS = 64  # of a batch
Step = Callable[[int, float], tuple[Tensor, dict[str, float]]]  # iteration, batch_scale -> loss, metrics
Schedule = Callable[[int, int], float]  # iteration, iterations -> factor of the learning rate


def cosine_with_warmup(warmup: int, floor: float) -> Schedule:
    """Learning-rate schedule: linear warm-up times a cosine (Loshchilov and Hutter 2017).

    Args:
        warmup: Iterations of the warm-up.
        floor: Factor at the end of the run, in [0, 1].

    Returns:
        The factor of each iteration, in (0, 1].
    """

    def factor(iteration: int, total: int) -> float:
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / total))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * (floor + (1 - floor) * cosine)

    return factor


def exponential_with_warmup(warmup: int, hold: float, floor: float) -> Schedule:
    """Learning-rate schedule: linear warm-up, then 1, then an exponential decay.

    Args:
        warmup: Iterations of the warm-up.
        hold: Share of the run, in [0, 1), at which the decay begins.
        floor: Factor at the end of the run, in (0, 1].

    Returns:
        The factor of each iteration, in (0, 1].
    """

    def factor(iteration: int, total: int) -> float:
        late = max(0.0, (iteration / total - hold) / (1 - hold))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * floor**late

    return factor


def constant(iteration: int, total: int) -> float:
    """Learning-rate schedule that leaves the rate as it is."""
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
    """Run a course's step and optimizer until so many iterations are done.

    When memory runs out, the iteration is tried again with the batch in twice as many parts, whose losses are averaged.
    Processes that learn together take a part each.

    Args:
        training_state: What is learned, and how far it has come.
        until: Iterations after which to stop, at most `training_state.iterations`.
        step: Gives loss [] and metrics of an iteration; batch_scale = 1 / parts is the share of a batch to take.
        schedule: `schedule(iteration, course.iterations)` multiplies the learning rate of every group.
        progress: Told of each iteration and its metrics; may cancel.
        checkpoint: Told after each iteration, and at a cancel, so that what is learned is kept.

    Raises:
        Diverged: The loss is not finite.
        OutOfMemory: Smaller parts no longer help.
        Cancelled: `progress` was asked to stop.
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
        # reading the loss waits for the device: every tenth time is soon enough to stop
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


def _gradients(
    training_state: TrainingState, step: Step, iteration: int, parts: int
) -> tuple[Tensor, dict[str, float]]:
    """Gradients of the loss over this process's share of a batch, in parts; its mean, and the last part's metrics."""
    mean = 0.0
    with training_state.own_numbers():
        for _ in range(parts):
            loss, metrics = step(iteration, 1 / (parts * training_state.process_group.size))
            share = loss / parts
            share.backward()
            mean = mean + share.detach()
    return mean, metrics


def _report(metrics: dict[str, float], progress: Progress, checkpoint: Checkpoint | None) -> None:
    try:
        progress.step(**metrics)
    except Cancelled:
        if checkpoint is not None:
            checkpoint.save()
        raise
    if checkpoint is not None:
        checkpoint.offer()
