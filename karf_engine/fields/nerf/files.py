"""Checkpoints of other NeRF implementations, read without running any code in them.

- nerf-pytorch, `*.tar`: torch.save of `network_fn_state_dict`, `network_fine_state_dict`
- krrish94/nerf-pytorch, `*.ckpt`: torch.save of `model_coarse_state_dict`, `model_fine_state_dict` (FlexibleNeRFModel)

Widths, encodings and skips follow from the shapes of the weights. `tools/convert_bmild.py` converts the arrays of
bmild/nerf to the first format.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from ...errors import DataError
from ...io.failures import first_line, is_out_of_memory
from ...io.inputs import check_file
from .field import NerfNetwork, NerfShape
from .pickles import check_torch_file

HINT = "Give a checkpoint of nerf-pytorch (.tar) or krrish94/nerf-pytorch (.ckpt)."
STATE_NAMES = (  # coarse and fine network
    ("network_fn_state_dict", "network_fine_state_dict"),
    ("model_coarse_state_dict", "model_fine_state_dict"),
)
MOST_BYTES = 2 << 30
WIDEST, DEEPEST = 4096, 64  # the paper's networks are 256 wide and 8 deep
KRRISH_LAYERS = {
    "layer1": "pts_linears.0",
    "fc_feat": "feature_linear",
    "fc_alpha": "alpha_linear",
    "layers_dir.0": "views_linears.0",
    "fc_rgb": "rgb_linear",
}
# scalars that training scripts store with the networks, in addition to what torch allows
_numpy_scalar = np.float64(0).__reduce__()[0]
NUMPY_SCALARS = [
    (_numpy_scalar, "numpy.core.multiarray.scalar"),
    (_numpy_scalar, "numpy._core.multiarray.scalar"),
    np.dtype,
    *[type(np.dtype(code)) for code in ("f4", "f8", "i4", "i8")],
]


def read_nerf(path: Path) -> tuple[NerfNetwork, NerfNetwork]:
    """Read the coarse and the fine network of a checkpoint; without a fine one, the coarse one twice.

    Raises:
        DataError: The file is missing, damaged or unsafe, or has networks of another kind.
    """
    check_file(path, MOST_BYTES)
    if path.suffix == ".npy":
        raise DataError(
            f"{path} is an array file, as bmild/nerf writes its networks; it is not read as it is.",
            "Convert it in a checkout of KaRF: python -m tools.convert_bmild MODEL.npy OUT.tar; then give OUT.tar.",
        )
    try:
        check_torch_file(path)
        with torch.serialization.safe_globals(NUMPY_SCALARS):
            content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises nearly anything on damaged and unsafe files
        if is_out_of_memory(error):
            raise
        raise DataError(
            f"{path} cannot be read as a checkpoint of numbers alone: {first_line(error)}.", HINT
        ) from error
    for names in STATE_NAMES:
        if isinstance(content, dict) and isinstance(content.get(names[0]), dict):
            coarse, fine = (content.get(name) or content[names[0]] for name in names)
            return network_of_state(path, coarse), network_of_state(path, fine)
    raise DataError(f"{path} holds no networks under a name known here ({STATE_NAMES[0][0]}, ..).", HINT)


def network_of_state(path: Path, state: dict[str, Any]) -> NerfNetwork:
    """Build a network from a state dictionary.

    Args:
        path: The file of the state, named in errors; its size limits that of the tensors.
        state: Weights [out, in] and biases by name, as in nerf-pytorch or krrish94/nerf-pytorch.

    Raises:
        DataError: The tensors are larger than the file, are not finite, or are not those of a NeRF with view directions up
            to the size limits.
    """
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
        if is_out_of_memory(error):
            raise
        raise DataError(
            f"{path} holds a network of another kind ({first_line(error)}).",
            "It must be a vanilla NeRF that sees viewing directions, with one layer for them.",
        ) from error
    if not all(torch.isfinite(weights).all() for weights in network.parameters()):
        raise DataError(f"{path} holds weights that are not finite.", "Give an earlier checkpoint.")
    return network


def _renamed(state: dict[str, Tensor]) -> dict[str, Tensor]:
    """Rename the layers of krrish94's FlexibleNeRFModel to nerf-pytorch's, and swap the inputs of its skips."""
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
