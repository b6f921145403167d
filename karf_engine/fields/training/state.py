"""The state of a training as tensors, from which a fresh training resumes exactly."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ...compute.runtime import Runtime
from ...errors import DataError


class TrainingState:
    """Optimizer, random generator and progress of one training.

    Attributes:
        iterations: Of the whole training.
        done: Iterations done; counted by the training loop.
        optimizer: Adam.
        process_group: The processes that train together.
        generator: Source of all random numbers.
    """

    def __init__(
        self,
        iterations: int,
        optimizer: torch.optim.Optimizer,
        learned: Callable[[], dict[str, Tensor]],
        runtime: Runtime,
    ) -> None:
        """Begin a training. `learned` returns the learned tensors by name."""
        self.iterations, self.optimizer = iterations, optimizer
        self.done = 0
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
    """Return an integer of a state.

    Raises:
        DataError: It is not an integer from 0 to `most`.
    """
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
    """Check that two states have the same names, shapes and dtypes.

    Raises:
        DataError: They differ; the sentence names the first difference.
    """
    found, expected = ({n: (tuple(t.shape), t.dtype) for n, t in tensors.items()} for tensors in (state, like))
    for name in sorted(found.keys() | expected.keys()):
        if found.get(name) != expected.get(name):
            raise DataError(f"What was learned holds {name!r} as {found.get(name)}, not {expected.get(name)}.")
