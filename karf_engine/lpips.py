"""LPIPS (Zhang et al. 2018), version 0.1 on AlexNet: how different two pictures look to a network that the user gives.

Its weights are not part of this program. The backbone is torchvision's AlexNet (`features.*` of its state dictionary),
the linear weights are those of the LPIPS package's `alex.pth` (`lin<n>.model.1.weight`).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from .errors import DataError

# in, out, kernel, stride, padding of AlexNet's convolutions, and their numbers in its state dictionary
CONVOLUTIONS = ((3, 64, 11, 4, 2), (64, 192, 5, 1, 2), (192, 384, 3, 1, 1), (384, 256, 3, 1, 1), (256, 256, 3, 1, 1))
NUMBERS = (0, 3, 6, 8, 10)
POOLED_BEFORE = (1, 2)  # convolutions that read halved features
SHIFT, SCALE = (-0.030, -0.088, -0.188), (0.458, 0.448, 0.450)  # of pictures in [-1, 1]
SMALLEST = 64  # pixels a side that the strides leave something of
HINT = "Give torchvision's AlexNet and the LPIPS package's alex.pth, as .pth or .pt files."


class Lpips(nn.Module):
    """The measure. Weights are random until `read_lpips` fills them in."""

    def __init__(self) -> None:
        super().__init__()
        self.convolutions = nn.ModuleList([nn.Conv2d(i, o, k, s, p) for i, o, k, s, p in CONVOLUTIONS])
        self.linear = nn.ParameterList([nn.Parameter(torch.rand(1, o, 1, 1)) for _, o, *_ in CONVOLUTIONS])
        self.requires_grad_(False)

    def forward(self, first: np.ndarray, second: np.ndarray) -> float:
        """Distance, 0 for the same, of two pictures [H, W, 3] in [0, 1], at least SMALLEST pixels high and wide.

        Raises ValueError for smaller ones.
        """
        if min(first.shape[:2]) < SMALLEST:
            raise ValueError(
                f"LPIPS needs pictures of at least {SMALLEST} pixels, not {first.shape[1]}x{first.shape[0]}"
            )
        total = 0.0
        for a, b, linear in zip(self._layers(first), self._layers(second), self.linear, strict=True):
            total += float((linear * (a - b) ** 2).sum(1).mean())
        return total

    def _layers(self, picture: np.ndarray) -> list[Tensor]:
        """Features of every convolution, each pixel's of length 1."""
        shift, scale = (torch.tensor(values)[:, None, None] for values in (SHIFT, SCALE))
        features = (torch.from_numpy(picture).float().permute(2, 0, 1) * 2 - 1 - shift) / scale
        features, layers = features[None], []
        for number, convolution in enumerate(self.convolutions):
            if number in POOLED_BEFORE:
                features = nn.functional.max_pool2d(features, 3, 2)
            features = torch.relu(convolution(features))
            layers.append(features / (torch.linalg.norm(features, dim=1, keepdim=True) + 1e-10))
        return layers


def read_lpips(backbone: Path, linear: Path) -> Lpips:
    """The measure with the weights of these two files, read as data.

    Raises DataError where a file is missing, damaged, or holds another network.
    """
    state = _read(backbone), _read(linear)
    wanted = {}
    for n, number in enumerate(NUMBERS):
        for part in ("weight", "bias"):
            wanted[f"convolutions.{n}.{part}"] = state[0].get(f"features.{number}.{part}")
        wanted[f"linear.{n}"] = state[1].get(f"lin{n}.model.1.weight")
    measure = Lpips()
    for name, parameter in measure.state_dict().items():
        found = wanted[name]
        if not isinstance(found, Tensor) or found.shape != parameter.shape:
            raise DataError(f"{linear if name.startswith('linear') else backbone} is of another network.", HINT)
    measure.load_state_dict(wanted)
    return measure


def _read(path: Path) -> dict:
    if not path.is_file():
        raise DataError(f"{path} does not exist.", HINT)
    try:
        content = torch.load(path, map_location="cpu", weights_only=True)
    except Exception as error:  # torch raises nearly anything on damaged files
        raise DataError(f"{path} cannot be read as weights alone.", HINT) from error
    if not isinstance(content, dict):
        raise DataError(f"{path} is of another network.", HINT)
    return content
