"""Import of NeRFs trained elsewhere: their checkpoints, and the alignment of their world with the capture's.

Checkpoints are read without running any code in them:

- nerf-pytorch, `*.tar`: torch.save of `network_fn_state_dict`, `network_fine_state_dict`
- krrish94/nerf-pytorch, `*.ckpt`: torch.save of `model_coarse_state_dict`, `model_fine_state_dict` (FlexibleNeRFModel)

Widths, encodings and skips follow from the shapes of the weights. `tools/convert_bmild.py` converts the arrays of
bmild/nerf to the first format. Checkpoints do not record how a program has moved and scaled the poses: import tries the
known alignments and keeps the one that renders the photos best.
"""

from __future__ import annotations

import pickletools
import zipfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

import numpy as np
import torch
from torch import Tensor

from ...capture.camera import Camera
from ...capture.capture import View
from ...errors import DataError
from ...io.failures import first_line, is_out_of_memory
from ...io.files import check_file
from ...project.settings import NerfSettings
from ..extent import focus_point, mean_frustum, mean_pose, similarity, to_ndc
from ..rendering.rays import PixelDataset
from ..rendering.space import Box, StraightSpace, space_to_device
from ..scene import Scene, psnr_of_views
from .field import NerfField, NerfNetwork, NerfSampling, NerfShape
from .fit import MEASURED_RAYS, OBJECT_DISTANCE, surface_bounds

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
# pickled: globals of tensors, dictionaries and scalars; torch allows more, where a few bytes can claim any memory
ALLOWED_GLOBALS = {
    "collections OrderedDict",
    "torch._utils _rebuild_tensor_v2",
    "torch._utils _rebuild_parameter",
    "torch.nn.parameter Parameter",
    "torch Size",
    "torch device",
    "_codecs encode",
    "numpy dtype",
    "numpy.core.multiarray scalar",
    "numpy._core.multiarray scalar",
    *(f"numpy.dtypes {kind}DType" for kind in ("Float32", "Float64", "Int32", "Int64")),
    *(f"torch {kind}Storage" for kind in ("Float", "Double", "Half", "BFloat16", "Int", "Long", "Bool", "Byte")),
}
PUTS = ("PUT", "BINPUT", "LONG_BINPUT")
LEGACY_PICKLES = 5  # magic number, version, system, content, storage keys
SYNTHETIC_RANGE = (2.0, 6.0)  # near and far depth of NeRF-synthetic
LLFF_NEAR = 0.9  # near depth of LLFF outside NDC, share of the smallest depth
MIN_PSNR = 20.0
TRIED_PIXELS = 600  # per photo


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
    """Build a network from the state dictionary in a file, of weights [out, in] and biases by name.

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


def check_torch_file(path: Path) -> None:
    """Check a file of torch.save. Raise ValueError if it uses other globals or compressed records."""
    with path.open("rb") as file:
        if file.read(4) != b"PK\3\4":
            file.seek(0)
            for _ in range(LEGACY_PICKLES):
                check_pickle(file, path.stat().st_size)
            return
    with zipfile.ZipFile(path) as archive:
        if sum(record.file_size for record in archive.infolist()) > path.stat().st_size:
            raise ValueError("its records are packed, as torch never does")
        for record in archive.infolist():
            if record.filename.endswith("data.pkl"):
                with archive.open(record) as file:
                    check_pickle(file, record.file_size)


class _Bounded:
    """A file that reads at most its length: Python allocates all that a pickle asks for."""

    def __init__(self, file: IO[bytes], length: int) -> None:
        self._file, self._length = file, length
        self.readline, self.tell = file.readline, file.tell

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, self._length))


def check_pickle(file: IO[bytes], length: int, names: set[str] | None = ALLOWED_GLOBALS) -> None:
    """Check the next pickle of a file of `length` bytes without loading it. `names`: allowed globals, None for any.

    Raises:
        ValueError: Another global, a memo index beyond the length, or a truncated pickle.
    """
    for opcode, argument, _ in pickletools.genops(cast(IO[bytes], _Bounded(file, length))):
        if opcode.name in PUTS and int(argument or 0) > length:
            raise ValueError(f"it numbers an entry {argument} in {length} bytes")
        if names is not None and opcode.name == "GLOBAL" and argument not in names:
            raise ValueError(f"it asks for {str(argument).replace(' ', '.')}, which is not a number")


@dataclass(frozen=True)
class Alignment:
    """A candidate space of a NeRF, with the range of its rays (see `NerfSampling`)."""

    name: str
    space: StraightSpace
    near: float
    far: float
    in_disparity: bool = False


def candidate_alignments(views: list[View], settings: NerfSettings) -> list[Alignment]:
    """Return the known alignments of all views; those of LLFF if depth bounds are declared."""
    found = []
    if settings.near and settings.far:
        found.append(Alignment("as it is, near and far as set", Box(), settings.near, settings.far))
    found.append(Alignment("as it is, near 2 and far 6", Box(), *SYNTHETIC_RANGE))
    cameras = [view.camera for view in views]
    center = focus_point(cameras).numpy()
    distance = float(np.mean([np.linalg.norm(camera.position - center) for camera in cameras]))
    scale = OBJECT_DISTANCE / distance
    near, far = (value / scale for value in SYNTHETIC_RANGE)
    found.append(Alignment("scaled", similarity(scale, np.eye(3), center), near, far))
    bounds = [view.depth_bounds for view in views if view.depth_bounds]
    if not bounds:
        return found
    near, far = LLFF_NEAR * min(low for low, _ in bounds), max(high for _, high in bounds)
    found.append(Alignment("as it is, LLFF's bounds", Box(), near, far))
    frustum = mean_frustum(views, None)
    found.append(Alignment("LLFF in NDC", to_ndc(frustum, views), 0.0, 1.0))
    middle = mean_pose(cameras)
    scale = 1 / frustum.near  # the smallest depth becomes 1 / 0.75
    found.append(Alignment("LLFF recentered", similarity(scale, middle[:3, :3].T, middle[:3, 3]), near, far))
    found.append(Alignment("LLFF spherified", spherify_alignment(cameras), near, far, in_disparity=True))
    return found


def spherify_alignment(cameras: list[Camera]) -> StraightSpace:
    """Return LLFF's alignment of surrounding cameras: on a unit sphere, with up away from the focus point."""
    middle = mean_pose(cameras)
    # the constant vector below is in the axes of the mean pose
    to_middle = middle[:3, :3].T
    positions = np.stack([to_middle @ (camera.position - middle[:3, 3]) for camera in cameras])
    focus = to_middle @ (focus_point(cameras).numpy() - middle[:3, 3])
    up = (positions - focus).mean(0)
    up /= np.linalg.norm(up)
    right = np.cross([0.1, 0.2, 0.3], up)
    right /= np.linalg.norm(right)
    to_sphere = np.stack([right, np.cross(up, right), up]) @ to_middle
    center = focus_point(cameras).numpy()
    radius = np.sqrt(np.mean([np.sum((camera.position - center) ** 2) for camera in cameras]))
    return similarity(1 / radius, to_sphere, center)


def import_nerf(
    networks: tuple[NerfNetwork, NerfNetwork],
    views: list[View],
    datasets: dict[str, PixelDataset],
    settings: NerfSettings,
    source: str,
    device: torch.device,
    seed: int = 0,
) -> tuple[Scene, str, float]:
    """Align a coarse and a fine network with all views of a capture.

    `datasets` are some training photos, by the kind of background; `source` names the networks in errors. The seed is
    of the compared pixels and of the rays that measure the bounds.

    Returns:
        The scene, the name of the alignment, and its mean PSNR in dB.

    Raises:
        DataError: No alignment reaches MIN_PSNR.
    """
    coarse, fine = networks
    tried = []
    for alignment in candidate_alignments(views, settings):
        near, far, in_disparity = alignment.near, alignment.far, alignment.in_disparity
        sampling = NerfSampling(near, far, in_disparity, settings.coarse_samples, settings.fine_samples)
        space = space_to_device(alignment.space, device)
        field = NerfField(coarse, fine, sampling, space, torch.zeros(2, 3)).to(device).requires_grad_(False)
        for kind, dataset in datasets.items():
            scene = Scene(field, None, kind, 1.0)
            psnr = float(np.mean(psnr_of_views(scene, dataset, TRIED_PIXELS, seed)))
            tried.append((psnr if np.isfinite(psnr) else 0.0, alignment.name, field, scene))
    psnr, name, field, scene = max(tried, key=lambda entry: entry[0])
    if psnr < MIN_PSNR:
        names = ", ".join(dict.fromkeys(f"{entry[1]!r}" for entry in tried))
        raise DataError(
            f"{source} does not show this capture: of {names} the best, {name!r}, reaches {psnr:.1f} dB of the "
            f"{MIN_PSNR:g} dB needed.",
            "Give the capture it was trained on, as it was given to that program; geometry.nerf.near and .far may help.",
        )
    dataset = datasets[scene.background_kind]
    index = torch.randint(len(dataset), (MEASURED_RAYS,), generator=torch.Generator().manual_seed(seed))
    field.bounds = surface_bounds(field, dataset.rays(index.to(dataset.color.device)))
    return scene, name, psnr
