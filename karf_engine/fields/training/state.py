"""A training that can be interrupted: its state as tensors, which a fresh one resumes as if nothing had happened."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager

import torch
from torch import Tensor

from ...compute.runtime import Runtime
from ...errors import DataError


class TrainingState:
    """One training and where it stands: what it learns, the optimizer's moments, random numbers, how far it has come.

    Attributes:
        iterations: Of the whole training.
        done: Of those, so far; the training loop counts.
        optimizer: Adam.
        process_group: The processes that learn it together.
    """

    def __init__(
        self,
        iterations: int,
        optimizer: torch.optim.Optimizer,
        learned: Callable[[], dict[str, Tensor]],
        runtime: Runtime,
    ) -> None:
        """A fresh training.

        Args:
            iterations: Of the whole.
            optimizer: Adam over what is learned.
            learned: Gives the tensors that make up what is learned, by name.
            runtime: The source of the training's random numbers.
        """
        self.iterations, self.optimizer = iterations, optimizer
        self.done = 0
        self.process_group = runtime.process_group
        self._learned, self._random = learned, runtime.generator

    def own_numbers(self) -> AbstractContextManager[None]:
        """Random numbers that no other process of the group draws, for its share of a batch."""
        return self.process_group.own_numbers(self._random)

    def state(self) -> dict[str, Tensor]:
        """All that resuming takes."""
        moments = {f"{n}.{name}": v for n, entry in self._moments().items() for name, v in entry.items()}
        own = {"random": self._random.get_state(), "done": number(self.done)}
        return own | prefixed("learned", self._learned()) | prefixed("adam", moments)

    def resume(self, state: dict[str, Tensor]) -> None:
        """Resume a state, on the processor, of a training like this fresh one.

        Random numbers of another kind of device are ignored: then the rest is learned from other ones.

        Raises:
            DataError: Names, shapes or types are others; nothing is changed then.
        """
        moments = self._checked_moments(below("adam", state))
        rest = {name: tensor for name, tensor in state.items() if not name.startswith("adam.")}
        here = self._random.get_state()
        random = rest.get("random", here)
        same_device = random.shape == here.shape
        like = {"random": here if same_device else random, "done": number(0), **prefixed("learned", self._learned())}
        check_alike(rest, like)
        done = whole_number(state, "done", self.iterations)
        if same_device:
            try:
                self._random.set_state(random)
            except RuntimeError as error:
                raise DataError(f"The random numbers of what was learned are damaged ({error}).") from error
        with torch.no_grad():
            for name, tensor in self._learned().items():
                tensor.copy_(state[f"learned.{name}"])
        self.optimizer.load_state_dict(self.optimizer.state_dict() | {"state": moments})
        self.done = done

    def _moments(self) -> dict[int, dict[str, Tensor]]:
        return self.optimizer.state_dict()["state"]

    def _checked_moments(self, state: dict[str, Tensor]) -> dict[int, dict[str, Tensor]]:
        """Moments of each parameter; none for those that no loss has asked for yet."""
        parameters = [value for group in self.optimizer.param_groups for value in group["params"]]
        moments = {n: entry for n in range(len(parameters)) if (entry := below(str(n), state))}
        like = {
            f"{n}.{name}": value
            for n in moments
            for name, value in {"step": torch.zeros(()), "exp_avg": parameters[n], "exp_avg_sq": parameters[n]}.items()
        }
        check_alike(state, like)
        return moments


def number(value: float) -> Tensor:
    """A number of a state, exactly."""
    return torch.tensor(value, dtype=torch.float64)


def whole_number(state: dict[str, Tensor], name: str, most: int) -> int:
    """The number of this name.

    Raises:
        DataError: It is not a whole one from 0 to `most`.
    """
    value = float(state[name])
    if not (value.is_integer() and 0 <= value <= most):
        raise DataError(f"{name!r} of what was learned is {value}, not a whole number up to {most}.")
    return int(value)


def prefixed(prefix: str, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors under names that begin with `prefix` and a dot."""
    return {f"{prefix}.{name}": tensor for name, tensor in state.items()}


def below(prefix: str, state: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors whose names begin with `prefix` and a dot, without it."""
    start = f"{prefix}."
    return {name.removeprefix(start): tensor for name, tensor in state.items() if name.startswith(start)}


def check_alike(state: dict[str, Tensor], like: dict[str, Tensor]) -> None:
    """Check that both hold the same names with the same shapes and types.

    Raises:
        DataError: They do not; the sentence names the first difference.
    """
    found, expected = ({n: (tuple(t.shape), t.dtype) for n, t in tensors.items()} for tensors in (state, like))
    for name in sorted(found.keys() | expected.keys()):
        if found.get(name) != expected.get(name):
            raise DataError(f"What was learned holds {name!r} as {found.get(name)}, not {expected.get(name)}.")
