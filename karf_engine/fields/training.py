"""The training loop with its learning rate schedules, and the state of a training as tensors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import torch
from torch import Tensor

from ..compute.progress import Progress
from ..compute.runtime import Runtime
from ..errors import DataError, Diverged, OutOfMemory
from ..io.failures import is_out_of_memory
from .fit import Checkpoint, end_iteration

CHECK_EVERY = 10  # iterations between checks of the loss, since reading it waits for the device
MOST_PARTS = 64  # of a batch
Metrics = Mapping[str, Any]  # numbers or scalar tensors by name
Step = Callable[[int, float], tuple[Tensor, Metrics]]  # iteration, batch_scale -> loss, metrics
Schedule = Callable[[int, int], float]  # iteration, iterations -> factor of the learning rate


def cosine_with_warmup(warmup: int, floor: float) -> Schedule:
    """Return a schedule of linear warm-up times a cosine decay (Loshchilov and Hutter 2017) to `floor` in [0, 1]."""

    def factor(iteration: int, total: int) -> float:
        cosine = 0.5 * (1 + math.cos(math.pi * iteration / total))
        return min(1.0, (iteration + 1) / max(warmup, 1)) * (floor + (1 - floor) * cosine)

    return factor


def exponential_with_warmup(warmup: int, hold: float, floor: float) -> Schedule:
    """Return a schedule of linear warm-up, a constant phase and an exponential decay to `floor` in (0, 1].

    The decay begins after a share `hold` in [0, 1) of the run.
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
        training_state: Advanced in place.
        until: At most `training_state.iterations`.
        step: Maps iteration and batch_scale, the share of the batch to take, to a loss [] and metrics.
        schedule: Factor of the learning rate of every parameter group.
        progress: Receives the metrics of each iteration; may raise Cancelled.
        checkpoint: Saved when due, and on cancellation.

    Raises:
        Diverged: The loss is not finite.
        OutOfMemory: Even the smallest part does not fit.
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
        end_iteration(progress, checkpoint, **metrics)
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


def _undecorated(method: Callable[..., Any]) -> Callable[..., Any]:
    return getattr(method, "__wrapped__", method)


class Adam(torch.optim.Adam):
    """`torch.optim.Adam` without the decorators that load torch's compiler, which takes a second at the first step."""

    step = torch.no_grad()(_undecorated(torch.optim.Adam.step))
    zero_grad = _undecorated(torch.optim.Adam.zero_grad)
    add_param_group = _undecorated(torch.optim.Adam.add_param_group)
    state_dict = _undecorated(torch.optim.Adam.state_dict)
    load_state_dict = _undecorated(torch.optim.Adam.load_state_dict)


class TrainingState:
    """Optimizer, random generator and progress of one training, from which a fresh training resumes exactly."""

    def __init__(
        self,
        iterations: int,
        optimizer: torch.optim.Optimizer,
        learned: Callable[[], dict[str, Tensor]],
        runtime: Runtime,
    ) -> None:
        """Begin a training of `iterations` by Adam. `learned` returns the learned tensors by name."""
        self.iterations, self.optimizer = iterations, optimizer
        self.done = 0  # iterations, counted by `train`
        self.process_group, self.generator = runtime.process_group, runtime.generator
        self._learned = learned

    def state(self) -> dict[str, Tensor]:
        """Return all tensors needed to resume."""
        moments = self.optimizer.state_dict()["state"]
        adam = {f"{n}.{name}": value for n, entry in moments.items() for name, value in entry.items()}
        own = {"random": self.generator.get_state(), "done": scalar_tensor(self.done)}
        return own | add_prefix("learned", self._learned()) | add_prefix("adam", adam)

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume a state on the CPU in this fresh training.

        The generator state of another type of device is ignored; the remaining random numbers differ then.

        Raises:
            DataError: Names, shapes or dtypes differ. Nothing is changed then.
        """
        moments = self._checked_moments(strip_prefix("adam", state))
        rest = {name: tensor for name, tensor in state.items() if not name.startswith("adam.")}
        current = self.generator.get_state()
        random = rest.get("random", current)
        same_device = random.shape == current.shape
        expected = {"random": current if same_device else random, "done": scalar_tensor(0)}
        check_same_layout(rest, expected | add_prefix("learned", self._learned()))
        done = read_integer(state, "done", self.iterations)
        if same_device:
            try:
                self.generator.set_state(random)
            except RuntimeError as error:
                raise DataError(f"The random numbers of what was learned are damaged ({error}).") from error
        with torch.no_grad():
            for name, tensor in self._learned().items():
                tensor.copy_(state[f"learned.{name}"])
        self.optimizer.load_state_dict(self.optimizer.state_dict() | {"state": moments})
        self.done = done

    def _checked_moments(self, state: dict[str, Tensor]) -> dict[int, dict[str, Tensor]]:
        """Return Adam's moments of each parameter that has received gradients."""
        parameters = [value for group in self.optimizer.param_groups for value in group["params"]]
        moments = {n: entry for n in range(len(parameters)) if (entry := strip_prefix(str(n), state))}
        expected = {}
        for n in moments:
            values = {"step": torch.zeros(()), "exp_avg": parameters[n], "exp_avg_sq": parameters[n]}
            expected |= add_prefix(str(n), values)
        check_same_layout(state, expected)
        return moments


def scalar_tensor(value: float) -> Tensor:
    """Return a float64 scalar tensor."""
    return torch.tensor(value, dtype=torch.float64)


def read_integer(state: dict[str, Tensor], name: str, most: int) -> int:
    """Return an integer of a state. Raise DataError if it is not one from 0 to `most`."""
    value = float(state[name])
    if not (value.is_integer() and 0 <= value <= most):
        raise DataError(f"{name!r} of what was learned is {value}, not a whole number up to {most}.")
    return int(value)


def add_prefix(prefix: str, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Add `prefix` and a dot to all names."""
    return {f"{prefix}.{name}": tensor for name, tensor in state.items()}


def strip_prefix(prefix: str, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return the tensors whose names start with `prefix` and a dot, without that start."""
    start = f"{prefix}."
    return {name.removeprefix(start): tensor for name, tensor in state.items() if name.startswith(start)}


def check_same_layout(state: dict[str, Tensor], like: dict[str, Tensor]) -> None:
    """Check that two states have the same names, shapes and dtypes. Raise DataError with the first difference."""
    found, expected = ({n: (tuple(t.shape), t.dtype) for n, t in tensors.items()} for tensors in (state, like))
    for name in sorted(found.keys() | expected.keys()):
        if found.get(name) != expected.get(name):
            raise DataError(f"What was learned holds {name!r} as {found.get(name)}, not {expected.get(name)}.")
