"""NeRFs that other programs have trained. Nothing in their files is ever run: they are read as data or refused.

- nerf-pytorch, `*.tar`: torch.save of `network_fn_state_dict`, `network_fine_state_dict`
- krrish94/nerf-pytorch, `*.ckpt`: torch.save of `model_coarse_state_dict`, `model_fine_state_dict` (FlexibleNeRFModel)
- bmild/nerf, `model_*.npy` and `model_fine_*.npy` beside it: a pickled list of kernels [in, out] and biases

Widths, encodings and skips follow from the sizes of the weights.
"""

from __future__ import annotations

import pickle
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import torch
from torch import Tensor

from ...errors import DataError
from ...failures import is_out_of_memory
from ...inputs import check_file
from .field import NerfNetwork, NerfShape
from .pickles import check_pickle, check_torch_file

HINT = "Give a checkpoint of nerf-pytorch (.tar), krrish94/nerf-pytorch (.ckpt) or bmild/nerf (model_*.npy)."
STATE_NAMES = (  # of the coarse and the fine network
    ("network_fn_state_dict", "network_fine_state_dict"),
    ("model_coarse_state_dict", "model_fine_state_dict"),
)
MOST_BYTES = 2 << 30
WIDEST, DEEPEST = 4096, 64  # of networks; the paper's are 256 wide and 8 deep
KRRISH_LAYERS = {
    "layer1": "pts_linears.0",
    "fc_feat": "feature_linear",
    "fc_alpha": "alpha_linear",
    "layers_dir.0": "views_linears.0",
    "fc_rgb": "rgb_linear",
}
# numbers that training scripts note beside the networks; torch allows tensors and plain Python values by itself
_numpy_scalar = np.float64(0).__reduce__()[0]
NUMPY_SCALARS = [
    (_numpy_scalar, "numpy.core.multiarray.scalar"),
    (_numpy_scalar, "numpy._core.multiarray.scalar"),
    np.dtype,
    *[type(np.dtype(code)) for code in ("f4", "f8", "i4", "i8")],
]


def read_nerf(path: Path) -> tuple[NerfNetwork, NerfNetwork]:
    """Coarse and fine network of a file; where there is no fine one, the coarse one twice.

    Raises DataError where the file is missing, damaged, holds more than numbers, or networks of another kind.
    """
    check_file(path, MOST_BYTES)
    coarse, fine = _read_bmild(path) if path.suffix == ".npy" else _read_torch(path)
    if not all(torch.isfinite(weights).all() for network in (coarse, fine) for weights in network.parameters()):
        raise DataError(f"{path} holds weights that are not finite.", "Give an earlier checkpoint.")
    return coarse, fine


# ---------------------------------------------------------------------------------------------------------------- torch
def _read_torch(path: Path) -> tuple[NerfNetwork, NerfNetwork]:
    try:
        check_torch_file(path)
        with torch.serialization.safe_globals(NUMPY_SCALARS):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises nearly anything on damaged files, and an unpickling error on unsafe ones
        if is_out_of_memory(error):
            raise
        reason = str(error).strip().split("\n")[0].rstrip(".") or type(error).__name__
        raise DataError(f"{path} cannot be read as a checkpoint of numbers alone: {reason}.", HINT) from error
    for names in STATE_NAMES:
        if isinstance(content, dict) and isinstance(content.get(names[0]), dict):
            coarse, fine = (content.get(name) or content[names[0]] for name in names)
            return _network(path, coarse), _network(path, fine)
    raise DataError(f"{path} holds no networks under a name known here ({STATE_NAMES[0][0]}, ..).", HINT)


def _network(path: Path, state: dict[str, Any]) -> NerfNetwork:
    """The network of a state dictionary in either program's naming."""
    try:
        state = {name.removeprefix("module."): value for name, value in state.items()}
        if sum(value.numel() * value.element_size() for value in state.values()) > path.stat().st_size:
            raise ValueError("its tensors repeat a few numbers")
        is_krrish = "layer1.weight" in state
        if is_krrish:
            state = _renamed(state)
        shape = _shape(state, is_krrish)
        if max(shape.width, shape.view_width) > WIDEST or shape.depth > DEEPEST:
            raise ValueError(f"{shape.depth} layers of width {shape.width} and {shape.view_width}")
        network = NerfNetwork(shape)
        network.load_state_dict(state)
    except (KeyError, IndexError, AttributeError, TypeError, ValueError, RuntimeError) as error:
        reason = str(error).strip().split("\n")[0].rstrip(".:")
        raise DataError(
            f"{path} holds a network of another kind ({reason}).",
            "It must be a vanilla NeRF that sees viewing directions, with one layer for them.",
        ) from error
    return network


def _renamed(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """krrish94's FlexibleNeRFModel in nerf-pytorch's names; its skips join [h, gamma(x)] in the other order."""
    width, n_position = state["layer1.weight"].shape
    renamed = {}
    for name, value in state.items():
        layer, _, part = name.rpartition(".")
        if layer.startswith("layers_xyz."):
            layer = f"pts_linears.{int(layer.rpartition('.')[2]) + 1}"
            if part == "weight" and value.shape[1] == width + n_position:
                value = torch.cat([value[:, width:], value[:, :width]], 1)
        renamed[f"{KRRISH_LAYERS.get(layer, layer)}.{part}"] = value
    return renamed


def _shape(state: dict[str, Tensor], is_krrish: bool) -> NerfShape:
    depth = sum(name.startswith("pts_linears.") and name.endswith(".weight") for name in state)
    inputs = [state[f"pts_linears.{layer}.weight"].shape[1] for layer in range(depth)]
    width = state["pts_linears.0.weight"].shape[0]
    view_width, n_view = state["views_linears.0.weight"].shape
    return NerfShape(
        depth=depth,
        width=width,
        skips=tuple(layer for layer in range(1, depth) if inputs[layer] == width + inputs[0]),
        view_width=view_width,
        position_frequencies=_frequencies(inputs[0]),
        direction_frequencies=_frequencies(n_view - width),
        linear_first=is_krrish,
        rectified_features=is_krrish,
    )


def _frequencies(n_encoded: int) -> int:
    if not 3 <= n_encoded <= WIDEST or (n_encoded - 3) % 6:
        raise ValueError(f"an encoding of {n_encoded} numbers is not 3 + 6 L")
    return (n_encoded - 3) // 6


# ---------------------------------------------------------------------------------------------------------------- numpy
def _read_bmild(path: Path) -> tuple[NerfNetwork, NerfNetwork]:
    """Both networks, whichever of the two files is given."""
    number = path.name.removeprefix("model_").removeprefix("fine_")
    coarse, fine = path.with_name(f"model_{number}"), path.with_name(f"model_fine_{number}")
    coarse, fine = (file if file.is_file() else path for file in (coarse, fine))
    networks = [_network(file, _keras_state(file, _read_arrays(file))) for file in (coarse, fine)]
    return networks[0], networks[1]


def _keras_state(path: Path, arrays: list[np.ndarray]) -> dict[str, Tensor]:
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
        reason = str(error).strip().split("\n")[0].rstrip(".") or type(error).__name__
        raise DataError(f"{path} cannot be read as a list of arrays of numbers alone: {reason}.", HINT) from error
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
        raise pickle.UnpicklingError(f"it asks for {module}.{name}, which is no array")


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
        """What an array of objects holds."""
        return list(self.state[4])

    def numbers(self) -> np.ndarray:
        """The array itself, float32 or float64."""
        _, shape, kind, by_columns, data = self.state
        if kind.code not in ("f4", "f8"):
            raise ValueError(f"it holds values of type {kind.code!r}")
        data = data.encode("latin1") if isinstance(data, str) else data
        return np.frombuffer(data, kind.order + kind.code).reshape(shape, order="F" if by_columns else "C")
