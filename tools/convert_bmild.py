"""Turn a NeRF of bmild/nerf into a checkpoint as nerf-pytorch writes them, which `geometry --nerf` takes.

    .venv/engine/bin/python -m tools.convert_bmild MODEL.npy OUT.tar

MODEL is a `model_*.npy` or `model_fine_*.npy` as that program's `np.save` wrote it: a pickled list of kernels [in, out]
and biases. The other of the two is found beside it; where it is absent, the one network serves as both. Nothing in the
file is ever run: it is read as data or refused. OUT holds `network_fn_state_dict` and `network_fine_state_dict`,
tensors alone.
"""

from __future__ import annotations

import argparse
import pickle
import sys
from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import torch
from torch import Tensor

from karf_engine.errors import BadRequest, DataError
from karf_engine.fields.nerf.field import NerfNetwork
from karf_engine.fields.nerf.importing import MOST_BYTES, STATE_NAMES, check_pickle, network_of_state
from karf_engine.io.failures import first_line, is_out_of_memory, translate_error
from karf_engine.io.files import atomic_write, check_file

HINT = "Give a model_*.npy or model_fine_*.npy as bmild/nerf has written it."


def main(arguments: Sequence[str] | None = None) -> int:
    """Convert one file; returns the process exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model", type=Path, metavar="MODEL.npy", help="either network's file")
    parser.add_argument("out", type=Path, metavar="OUT.tar", help="the checkpoint to write")
    options = parser.parse_args(arguments)
    try:
        convert(options.model, options.out)
    except Exception as raised:
        if (error := translate_error(raised)) is None:
            raise
        print(f"error: {error.sentence}\n       {error.hint}".rstrip(), file=sys.stderr)
        return error.exit_code
    return 0


def convert(model: Path, out: Path) -> None:
    """Write the networks of a file of bmild/nerf as nerf-pytorch does, whole or not at all.

    Args:
        model: A `model_*.npy` or `model_fine_*.npy`.
        out: The file to write, `*.tar`.

    Raises:
        BadRequest: `out` has another ending.
        DataError: As `read_bmild`.
    """
    if out.suffix != ".tar":
        raise BadRequest(f"{out} does not end in .tar, as checkpoints of nerf-pytorch do.", "Choose another name.")
    states = [dict(network.state_dict()) for network in read_bmild(model)]
    packed = BytesIO()  # torch notes a file's name inside it: of a temporary one, each conversion would be another file
    torch.save(dict(zip(STATE_NAMES[0], states, strict=True)), packed)
    atomic_write(out, lambda temporary: temporary.write_bytes(packed.getbuffer()))


def read_bmild(path: Path) -> tuple[NerfNetwork, NerfNetwork]:
    """Coarse and fine network, whichever of the two files is given; where there is one file alone, its network twice.

    Raises:
        DataError: A file is missing, damaged, too large, holds more than arrays of numbers, or another kind of network.
    """
    number = path.name.removeprefix("model_").removeprefix("fine_")
    coarse, fine = path.with_name(f"model_{number}"), path.with_name(f"model_fine_{number}")
    coarse, fine = (file if file.is_file() else path for file in (coarse, fine))
    return _read_network(coarse), _read_network(fine)


def _read_network(path: Path) -> NerfNetwork:
    check_file(path, MOST_BYTES)
    return network_of_state(path, _state(path, _read_arrays(path)))


def _state(path: Path, arrays: list[np.ndarray]) -> dict[str, Tensor]:
    """bmild's list: kernel and bias of the layers for positions, features, directions, color and density."""
    depth = len(arrays) // 2 - 4
    if len(arrays) % 2 or depth < 1:
        raise DataError(
            f"{path} holds {len(arrays)} arrays, not kernels and biases of a NeRF with viewing directions.", HINT
        )
    layers = [f"pts_linears.{layer}" for layer in range(depth)]
    layers += ["feature_linear", "views_linears.0", "rgb_linear", "alpha_linear"]
    state = {}
    for layer, kernel, bias in zip(layers, arrays[::2], arrays[1::2], strict=True):
        state[f"{layer}.weight"] = torch.from_numpy(kernel.astype(np.float32).T.copy())
        state[f"{layer}.bias"] = torch.from_numpy(bias.astype(np.float32))
    return state


def _read_arrays(path: Path) -> list[np.ndarray]:
    """The arrays of a pickled object array, read without numpy's pickle support."""
    try:
        with path.open("rb") as file:
            version = np.lib.format.read_magic(file)
            read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
            if read_header[version](file)[2] != np.dtype(object):
                raise ValueError("it is one array of numbers")
            content = file.read()
        check_pickle(BytesIO(content), len(content), names=None)
        outer = _ArrayUnpickler(BytesIO(content)).load()
        arrays = [entry.numbers() for entry in outer.entries()]
        if sum(array.nbytes for array in arrays) > len(content):
            raise ValueError("its arrays repeat a few numbers")
    except Exception as error:  # a scrambled pickle raises nearly anything
        if is_out_of_memory(error):
            raise
        raise DataError(
            f"{path} cannot be read as a list of arrays of numbers alone: {first_line(error)}.", HINT
        ) from error
    return arrays


class _ArrayUnpickler(pickle.Unpickler):
    """Reads arrays of numbers and lists of them, and nothing else. Names in the file only choose among stand-ins that
    keep what they are given; neither numpy nor anything else is called while the file is read."""

    def __init__(self, file: BinaryIO) -> None:
        super().__init__(file, encoding="latin1")

    def find_class(self, module: str, name: str) -> Any:
        if (module, name) in (("numpy.core.multiarray", "_reconstruct"), ("numpy._core.multiarray", "_reconstruct")):
            return _StoredArray
        if (module, name) == ("numpy", "ndarray"):
            return _StoredArray
        if (module, name) == ("numpy", "dtype"):
            return _StoredType
        if (module, name) == ("_codecs", "encode"):  # how old pickles write bytes
            return lambda text, _: text.encode("latin1")
        raise pickle.UnpicklingError(f"it asks for {module}.{name}, which is not an array")


class _StoredType:
    """A dtype as pickled: its code and byte order."""

    def __init__(self, code: str, *_: Any) -> None:
        self.code, self.order = code, "|"

    def __setstate__(self, state: tuple) -> None:
        self.order = state[1]


class _StoredArray:
    """An array as pickled: shape, type, order of axes, and bytes or a list."""

    def __init__(self, *_: Any) -> None:
        self.state: tuple = ()

    def __setstate__(self, state: tuple) -> None:
        self.state = state

    def entries(self) -> list[_StoredArray]:
        """The arrays within an array of objects."""
        return list(self.state[4])

    def numbers(self) -> np.ndarray:
        """The array itself, float32 or float64."""
        _, shape, kind, by_columns, data = self.state
        if kind.code not in ("f4", "f8"):
            raise ValueError(f"it holds values of type {kind.code!r}")
        data = data.encode("latin1") if isinstance(data, str) else data
        return np.frombuffer(data, kind.order + kind.code).reshape(shape, order="F" if by_columns else "C")


if __name__ == "__main__":
    sys.exit(main())
