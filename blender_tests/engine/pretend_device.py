"""A pretend device, to test the placement of tensors without a graphics card.

Tensors on `pretend` are held and computed by the CPU but report another device: operations that mix them with tensors
of the CPU fail, and so do `.numpy()` and a generator of the other device. On request float64 tensors on it fail too, as
on Apple's `mps`. It is torch's "private use" device with Python as its backend; once set up, it stays for the whole
process.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any
from unittest.mock import patch

import torch
from torch import Tensor
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode
from torch.utils._pytree import tree_leaves, tree_map_only
from torch.utils.backend_registration import _setup_privateuseone_for_python_backend

from karf_engine.compute import precision, runtime

NAME = "pretend"
_setup_privateuseone_for_python_backend(NAME)
aten = torch.ops.aten
CARRYING = (aten._to_copy.default, aten.copy_.default)  # values across devices
JOINING = (aten.cat.default, aten.stack.default)  # on no device do these take even a single number of the CPU


class WrongDevice(RuntimeError):
    """Tensors or generators of different devices met."""


class NoFloat64(TypeError):
    """A float64 tensor was made on a device without them."""


class PretendTensor(Tensor):
    """A tensor that reports the pretend device. values: its content, on the CPU."""

    @staticmethod
    def __new__(cls, values: Tensor) -> PretendTensor:
        if values.dtype == torch.float64 and NAME in precision.WITHOUT_FLOAT64:
            raise NoFloat64(f"a float64 tensor of shape {tuple(values.shape)}")
        layout = {"strides": values.stride(), "storage_offset": values.storage_offset(), "dtype": values.dtype}
        tensor = Tensor._make_wrapper_subclass(cls, values.shape, **layout, device=torch.device(NAME, 0))
        tensor.values = values
        return tensor

    __torch_function__ = torch._C._disabled_torch_function_impl  # results are wrapped below

    @classmethod
    def __torch_dispatch__(cls, function, types, args=(), kwargs=None) -> Any:
        return _run(function, args, kwargs or {})


class _Operations(TorchDispatchMode):
    """Makes tensors on the pretend device on request."""

    def __torch_dispatch__(self, function, types, args=(), kwargs=None) -> Any:
        return _run(function, args, kwargs or {})


class _Calls(TorchFunctionMode):
    """Corrects where subclasses of Tensor differ from a device's tensors, and checks generators."""

    def __torch_function__(self, function, types, args=(), kwargs=None) -> Any:
        kwargs = kwargs or {}
        if function is Tensor.tolist:
            return args[0].cpu().tolist()
        if function is torch.tensor and _is_pretend(kwargs.get("device")):
            return function(*args, **kwargs | {"device": "cpu"}).to(NAME)
        if function in (Tensor.__getitem__, Tensor.__setitem__):
            args = (args[0], _index(args[0], args[1]), *args[2:])
        result = function(*args, **kwargs)
        generator = kwargs.get("generator")
        if generator is not None and _is_pretend(generator.device) != _is_pretend(result.device):
            raise WrongDevice(f"{function.__name__} on {result.device} with a generator of {generator.device}")
        return result


class _Generator(torch.Generator):
    """A generator that knows which device's tensors it fills."""

    device = None  # hides torch's own, which is read-only

    def __new__(cls, device: torch.device | str = "cpu") -> _Generator:
        generator = super().__new__(cls)
        generator.device = torch.device(device)
        return generator


@contextmanager
def pretend_device(has_float64: bool = True) -> Iterator[torch.device]:
    """The pretend device within the context; jobs find it by its name."""
    device, real = torch.device(NAME), runtime.find_device

    def find_device(name: str | None) -> torch.device:
        return device if name == NAME else real(name)

    known = patch.object(runtime, "find_device", find_device)
    lacking = patch.object(precision, "WITHOUT_FLOAT64", () if has_float64 else (NAME,))
    with known, lacking, patch.object(torch, "Generator", _Generator), _Calls(), _Operations():
        yield device


def _is_pretend(device: torch.device | str | None) -> bool:
    return device is not None and torch.device(device).type == NAME


def _index(tensor: Tensor, index: Any) -> tuple:
    """The index with its lists as tensors on the device of the indexed tensor, as torch makes them."""
    parts = index if isinstance(index, tuple) else (index,)
    return tuple(torch.tensor(part).to(tensor.device) if isinstance(part, list) else part for part in parts)


def _run(function, args: tuple, kwargs: dict[str, Any]) -> Any:
    """Run an operation on the values; its result is on the device of its tensors."""
    tensors = [value for value in tree_leaves((args, kwargs)) if isinstance(value, Tensor)]
    strangers = [tensor for tensor in tensors if not isinstance(tensor, PretendTensor)]
    if function not in CARRYING and 0 < len(strangers) < len(tensors):
        # single numbers of the CPU mix with everything, as on real devices
        if function in JOINING or any(tensor.dim() for tensor in strangers):
            raise WrongDevice(f"{function} on tensors of the CPU and of another device")
    is_pretend, where = len(strangers) < len(tensors), {}
    if kwargs.get("device") is not None:
        is_pretend, where = _is_pretend(kwargs["device"]), {"device": torch.device("cpu")}
    args_of_values, kwargs_of_values = tree_map_only(PretendTensor, lambda tensor: tensor.values, (args, kwargs))
    result = function(*args_of_values, **kwargs_of_values | where)
    if function._schema.is_mutable and result is not None:
        return kwargs.get("out", args[0])  # the tensor written to
    return tree_map_only(Tensor, PretendTensor, result) if is_pretend else result
