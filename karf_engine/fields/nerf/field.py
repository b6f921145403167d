"""The radiance field of NeRF (Mildenhall et al. 2020), two MLPs with hierarchical sampling. The paper's geometry.

Layers are those of the original implementation (bmild/nerf), named as in nerf-pytorch, so that checkpoints fit;
variants of other implementations are options of `NerfShape`. Prior features are the output of the fine network's
`feature_linear`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any

import torch
from torch import Tensor, nn

from ...kan.encoding import positional_encoding
from ..rendering.rays import Rays
from ..rendering.sampling import Samples, dense_ray_weights, interval_lengths, refine, stratified_samples
from ..rendering.space import StraightSpace, space_from_json, space_to_json
from ..rendering.volume import Trace, make_trace, outward_normals

VOXELS = 128  # along the longest side; their size is the length scale of later stages
MOST_SAMPLES = 1 << 12  # per ray
CPU_POSITIONS_PER_CHUNK = 8192  # activations fit the cache
ACCELERATOR_POSITIONS_PER_CHUNK = 1 << 18


@dataclass(frozen=True)
class NerfShape:
    """Architecture of a network."""

    depth: int = 8  # number of layers that read the position
    width: int = 256  # of these layers
    skips: tuple[int, ...] = (5,)  # layers, counted from 0, that also read the encoded position
    view_width: int = 128  # width of the layer that reads the direction
    position_frequencies: int = 10  # of the positional encoding
    direction_frequencies: int = 4  # of the encoding of directions
    linear_first: bool = False  # omit the ReLU after the first layer
    rectified_features: bool = False  # add a ReLU after `feature_linear`


class NerfNetwork(nn.Module):
    """An MLP from positions to density and features, and from features and directions to color."""

    def __init__(self, shape: NerfShape) -> None:
        super().__init__()
        self.shape = shape
        n_position, n_direction = 3 + 6 * shape.position_frequencies, 3 + 6 * shape.direction_frequencies
        inputs = [n_position] + [shape.width + n_position * (layer in shape.skips) for layer in range(1, shape.depth)]
        self.pts_linears = nn.ModuleList([nn.Linear(n_in, shape.width) for n_in in inputs])
        self.alpha_linear = nn.Linear(shape.width, 1)
        self.feature_linear = nn.Linear(shape.width, shape.width)
        self.views_linears = nn.ModuleList([nn.Linear(shape.width + n_direction, shape.view_width)])
        self.rgb_linear = nn.Linear(shape.view_width, 3)

    def hidden(self, positions: Tensor) -> Tensor:
        """Return the last hidden layer [n, width] at positions [n, 3]."""
        encoded = positional_encoding(positions, self.shape.position_frequencies)
        hidden = encoded
        for number, layer in enumerate(self.pts_linears):
            if number in self.shape.skips:
                hidden = torch.cat([encoded, hidden], 1)
            hidden = layer(hidden)
            if number or not self.shape.linear_first:
                hidden = torch.relu(hidden)
        return hidden

    def raw_density(self, hidden: Tensor) -> Tensor:
        """Return densities before their ReLU, [n]."""
        return self.alpha_linear(hidden)[:, 0]

    def features(self, hidden: Tensor) -> Tensor:
        """Return features [n, width]."""
        features = self.feature_linear(hidden)
        return torch.relu(features) if self.shape.rectified_features else features

    def color(self, features: Tensor, directions: Tensor) -> Tensor:
        """Return colors [n, 3] in (0, 1) for unit directions [n, 3] in the axes of the network."""
        encoded = positional_encoding(directions, self.shape.direction_frequencies)
        hidden = torch.relu(self.views_linears[0](torch.cat([features, encoded], 1)))
        return torch.sigmoid(self.rgb_linear(hidden))


@dataclass(frozen=True)
class NerfSampling:
    """Sampling of rays from t = near to far (see `StraightSpace.to_grid_rays`)."""

    near: float  # first t
    far: float  # last t
    in_disparity: bool = False  # space coarse samples evenly in 1 / t instead of t
    coarse: int = 64  # number of coarse samples
    fine: int = 128  # number of importance samples


class NerfField(nn.Module):
    """A coarse and a fine network as a `Field`, whose members protocol.py documents."""

    kind = "nerf"
    bounds: Tensor

    def __init__(
        self, coarse: NerfNetwork, fine: NerfNetwork, sampling: NerfSampling, space: StraightSpace, bounds: Tensor
    ) -> None:
        super().__init__()
        self.coarse, self.fine = coarse, fine
        self.sampling = sampling
        self.space = space
        self.register_buffer("bounds", bounds.float())

    @property
    def n_features(self) -> int:
        return self.fine.shape.width

    @property
    def voxel(self) -> float:
        return float((self.bounds[1] - self.bounds[0]).max()) / VOXELS

    def trace(self, rays: Rays, step_in_voxels: float = 1.0) -> Trace:
        del step_in_voxels  # rays are sampled at the sorted union of coarse and fine samples
        origins, directions = self.space.to_grid_rays(rays)
        lengths = torch.linalg.norm(directions, dim=1, keepdim=True)
        t = self.coarse_t(origins.new_zeros(len(rays), 0))
        if self.sampling.fine:
            positions = points_along(origins, directions, t)
            sigmas = self._in_chunks(lambda x: _density(self.coarse, x), positions).view(t.shape)
            u = torch.linspace(0, 1, self.sampling.fine, device=t.device).expand(len(rays), -1)
            t = refine(t, dense_ray_weights(sigmas, interval_lengths(t) * lengths), u)
        samples = Samples(
            torch.arange(len(t), device=t.device).repeat_interleave(t.shape[1]),
            (t * lengths).view(-1),
            points_along(origins, directions, t),
            (interval_lengths(t) * lengths).view(-1),
        )
        return make_trace(samples, self.density(samples.positions), len(rays))

    def coarse_t(self, jitter: Tensor) -> Tensor:
        """Return the coarse samples (see `stratified_samples`)."""
        sampling = self.sampling
        return stratified_samples(sampling.near, sampling.far, sampling.coarse, sampling.in_disparity, jitter)

    def density(self, positions: Tensor) -> Tensor:
        return self._in_chunks(lambda x: _density(self.fine, x), positions)

    def features(self, positions: Tensor) -> Tensor:
        return self._in_chunks(lambda x: self.fine.features(self.fine.hidden(x)), positions)

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
        del positions  # the features suffice
        return self._in_chunks(self.fine.color, features, self.space.rotate_directions(viewdirs))

    @torch.no_grad()
    def normals(self, positions: Tensor) -> Tensor:
        return outward_normals(self.density, positions, self.voxel)

    def summary(self) -> dict[str, Any]:
        return {"voxel": self.voxel, "parameters": sum(p.numel() for p in self.parameters())}

    def config(self) -> dict[str, Any]:
        return {
            "coarse": asdict(self.coarse.shape),
            "fine": asdict(self.fine.shape),
            "sampling": asdict(self.sampling),
            "space": space_to_json(self.space),
        }

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> NerfField:
        if not all(1 <= config["sampling"][name] <= MOST_SAMPLES for name in ("coarse", "fine")):
            raise ValueError(f"sampling {config['sampling']}")
        with torch.device("meta"):  # no shape takes more memory than the file
            coarse, fine = (NerfNetwork(_shape(config[name], tensors, name)) for name in ("coarse", "fine"))
        space = space_from_json(config["space"], device)
        if not isinstance(space, StraightSpace):
            raise ValueError(f"a NeRF in the space {config['space']!r:.100}")
        field = cls(coarse, fine, NerfSampling(**config["sampling"]), space, tensors["bounds"])
        field.load_state_dict(tensors, assign=True)
        return field.float().to(device)

    def _in_chunks(self, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
        on_cpu = inputs[0].device.type == "cpu"
        size = CPU_POSITIONS_PER_CHUNK if on_cpu else ACCELERATOR_POSITIONS_PER_CHUNK
        parts = zip(*[tensor.split(size) for tensor in inputs], strict=True)
        return torch.cat([function(*part) for part in parts])


def points_along(origins: Tensor, directions: Tensor, t: Tensor) -> Tensor:
    """Return the points origin + t * direction, [R * N, 3], of rays [R, 3] at t [R, N]."""
    return (origins[:, None] + t[..., None] * directions[:, None]).view(-1, 3)


def _density(network: NerfNetwork, positions: Tensor) -> Tensor:
    return torch.relu(network.raw_density(network.hidden(positions)))


def _shape(values: dict[str, Any], tensors: dict[str, Tensor], network: str) -> NerfShape:
    layers = sum(name.startswith(f"{network}.pts_linears.") and name.endswith(".weight") for name in tensors)
    if values["depth"] != layers:
        raise ValueError(f"{values['depth']} layers, of which {layers} are there")
    options = {item.name: values[item.name] for item in fields(NerfShape)}
    options["skips"] = tuple(options["skips"])
    return NerfShape(**options)
