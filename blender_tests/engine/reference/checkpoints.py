"""Small networks as other programs store them, and a malicious pickle."""

import os
import pickle

import numpy as np
import torch

OCTAVES = (4, 2)
N_POSITION, N_DIRECTION = 27, 15


def layers(sizes, seed):
    random = torch.Generator().manual_seed(seed)
    state = {}
    for name, (n_in, n_out) in sizes.items():
        state[f"{name}.weight"] = torch.randn(n_out, n_in, generator=random) / n_in**0.5
        state[f"{name}.bias"] = torch.randn(n_out, generator=random) / 4
    return state


def vanilla_state(seed, width=12):
    sizes = {f"pts_linears.{n}": (width, width) for n in range(8)}
    sizes |= {"pts_linears.0": (N_POSITION, width), "pts_linears.5": (N_POSITION + width, width)}
    sizes |= {"views_linears.0": (width + N_DIRECTION, width // 2), "feature_linear": (width, width)}
    return layers(sizes | {"alpha_linear": (width, 1), "rgb_linear": (width // 2, 3)}, seed)


def bmild_arrays(state):
    """Kernels [in, out] and biases in bmild/nerf's order, from a state dictionary with nerf-pytorch's names."""
    names = [f"pts_linears.{layer}" for layer in range(sum(name.startswith("pts_linears.") for name in state) // 2)]
    arrays = []
    for name in [*names, "feature_linear", "views_linears.0", "rgb_linear", "alpha_linear"]:
        arrays += [state[f"{name}.weight"].numpy().T.copy(), state[f"{name}.bias"].numpy()]
    return arrays


def write_arrays(path, arrays, protocol=None):
    """Write arrays of different shapes as np.save does."""
    stacked = np.empty(len(arrays), object)
    stacked[:] = arrays
    if protocol is None:
        np.save(path, stacked, allow_pickle=True)
        return
    with path.open("wb") as file:  # like numpy before 1.17, with its old module names
        np.lib.format.write_array_header_1_0(file, {"descr": "|O", "fortran_order": False, "shape": stacked.shape})
        file.write(pickle.dumps(stacked, protocol).replace(b"numpy._core.multiarray", b"numpy.core.multiarray"))


class Trap:
    """Creates a folder when it is unpickled."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (str(self.folder),)
