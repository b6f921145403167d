"""The radiance field of NeRF (Mildenhall et al. 2020): two MLPs, sampled coarse and then fine. The paper's geometry.

The networks are those of the original implementation (bmild/nerf) and of nerf-pytorch, whose names for the layers are
kept, so that checkpoints fit; what other implementations do otherwise is data (`NerfShape`). Prior features are the
output of `feature_linear` in the fine network.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass, fields
from typing import Any

import torch
from torch import Tensor, nn

from ...kan.encoding import positional_encoding
from ..rendering.hierarchical import dense_ray_weights, interval_lengths, refine, stratified_samples
from ..rendering.rays import Rays
from ..rendering.sampling import Samples
from ..rendering.space import StraightSpace
from ..rendering.space_values import space_from_json, space_to_json
from ..rendering.volume import Trace, outward_normals, trace_of

DETAIL = 128  # a "voxel", the length scale of the later stages, is this share of the field's longest side
MOST_SAMPLES = 1 << 12  # samples of a ray
CPU_POSITIONS_PER_CHUNK = 8192  # positions: a chunk's activations stay near the processor's cache
ACCELERATOR_POSITIONS_PER_CHUNK = 1 << 18


@dataclass(frozen=True)
class NerfShape:
    """What a network looks like. skips: layers, counted from 0, that read gamma(x) before the layer above's output.

    view_width: of the layer that reads the direction. linear_first: no ReLU after the first layer. rectified_features:
    a ReLU after `feature_linear`.
    """

    depth: int = 8
    width: int = 256
    skips: tuple[int, ...] = (5,)
    view_width: int = 128
    position_frequencies: int = 10
    direction_frequencies: int = 4
    linear_first: bool = False
    rectified_features: bool = False


class NerfNetwork(nn.Module):
    """One MLP: positions to raw densities and features, these and directions to colors. Of the default shape it has
    595,844 parameters."""

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
        """What densities and features are read from, at positions [n, 3], [n, width]."""
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
        """Densities before their ReLU, [n]."""
        return self.alpha_linear(hidden)[:, 0]

    def features(self, hidden: Tensor) -> Tensor:
        """Features [n, width]."""
        features = self.feature_linear(hidden)
        return torch.relu(features) if self.shape.rectified_features else features

    def color(self, features: Tensor, directions: Tensor) -> Tensor:
        """Colors [n, 3] in (0, 1) seen along unit directions [n, 3], in the network's own axes."""
        encoded = positional_encoding(directions, self.shape.direction_frequencies)
        hidden = torch.relu(self.views_linears[0](torch.cat([features, encoded], 1)))
        return torch.sigmoid(self.rgb_linear(hidden))


@dataclass(frozen=True)
class NerfSampling:
    """Rays are sampled from t = near to far (see `StraightSpace.to_grid_rays`), `coarse` times evenly (in_disparity: in 1 / t)
    and `fine` times where the coarse network saw something."""

    near: float
    far: float
    in_disparity: bool = False
    coarse: int = 64
    fine: int = 128


class NerfField(nn.Module):
    """Two networks, a `Field` (see fields/protocol.py). Frozen use only; `NerfFit` trains the networks.

    bounds: [2, 3] round what there is to see, grid coordinates.
    """

    kind = "nerf"

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
        """Number of prior features."""
        return self.fine.shape.width

    @property
    def voxel(self) -> float:
        """Length below which nothing is distinguished, grid coordinates."""
        return float((self.bounds[1] - self.bounds[0]).max()) / DETAIL

    def trace(self, rays: Rays, step_in_voxels: float = 1.0) -> Trace:
        """Where these rays end, on the sorted union of coarse and fine samples; there is no stride to choose."""
        del step_in_voxels
        sampling = self.sampling
        origins, directions = self.space.to_grid_rays(rays)
        t = self.coarse_t(origins.new_zeros(len(rays), 0))
        if sampling.fine:
            positions = origins[:, None] + t[..., None] * directions[:, None]
            sigmas = self._in_chunks(lambda x: _density(self.coarse, x), positions.view(-1, 3)).view(t.shape)
            lengths = torch.linalg.norm(directions, dim=1, keepdim=True)
            even = torch.linspace(0, 1, sampling.fine, device=t.device).expand(len(rays), -1)
            t = refine(t, dense_ray_weights(sigmas, interval_lengths(t) * lengths), even)
        samples = self._samples(origins, directions, t)
        return trace_of(samples, self.density(samples.positions), len(rays))

    def coarse_t(self, jitter: Tensor) -> Tensor:
        """Parameters of the coarse samples (see hierarchical.stratified_samples)."""
        sampling = self.sampling
        return stratified_samples(sampling.near, sampling.far, sampling.coarse, sampling.in_disparity, jitter)

    def density(self, positions: Tensor) -> Tensor:
        """Volume density at positions [n, 3], [n] >= 0 per grid unit."""
        return self._in_chunks(lambda x: _density(self.fine, x), positions)

    def features(self, positions: Tensor) -> Tensor:
        """Prior features at positions [n, 3], [n, F], not standardized."""
        return self._in_chunks(lambda x: self.fine.features(self.fine.hidden(x)), positions)

    def color(self, positions: Tensor, viewdirs: Tensor, features: Tensor) -> Tensor:
        """sRGB color [n, 3] in (0, 1) seen along the world's viewdirs [n, 3]."""
        del positions  # the features hold all that depends on the place
        return self._in_chunks(self.fine.color, features, self.space.rotate_directions(viewdirs))

    @torch.no_grad()
    def normals(self, positions: Tensor) -> Tensor:
        """Outward surface normals, [n, 3]."""
        return outward_normals(self.density, positions, self.voxel)

    def summary(self) -> dict[str, Any]:
        """Length of a "voxel" in grid coordinates, and number of parameters."""
        return {"voxel": self.voxel, "parameters": sum(p.numel() for p in self.parameters())}

    def config(self) -> dict[str, Any]:
        """JSON values that, with the tensors, restore the field."""
        return {
            "coarse": asdict(self.coarse.shape),
            "fine": asdict(self.fine.shape),
            "sampling": asdict(self.sampling),
            "space": space_to_json(self.space),
        }

    @classmethod
    def restore(cls, config: dict[str, Any], tensors: dict[str, Tensor], device: torch.device | str) -> NerfField:
        """The field of this config and these tensors; in `checkpoints.restoring`, as others may have changed them."""
        if not all(1 <= config["sampling"][name] <= MOST_SAMPLES for name in ("coarse", "fine")):
            raise ValueError(f"sampling {config['sampling']}")
        # without numbers until the file's are there: no shape takes more memory than the file fills
        with torch.device("meta"):
            networks = [NerfNetwork(_shape(config[name], tensors, name)) for name in ("coarse", "fine")]
        space = space_from_json(config["space"], device)
        field = cls(*networks, NerfSampling(**config["sampling"]), space, tensors["bounds"])
        field.load_state_dict(tensors, assign=True)
        return field.float().to(device)

    def _samples(self, origins: Tensor, directions: Tensor, t: Tensor) -> Samples:
        lengths = torch.linalg.norm(directions, dim=1, keepdim=True)
        return Samples(
            torch.arange(len(t), device=t.device).repeat_interleave(t.shape[1]),
            (t * lengths).view(-1),
            (origins[:, None] + t[..., None] * directions[:, None]).view(-1, 3),
            (interval_lengths(t) * lengths).view(-1),
        )

    def _in_chunks(self, function: Callable[..., Tensor], *inputs: Tensor) -> Tensor:
        on_cpu = inputs[0].device.type == "cpu"
        size = CPU_POSITIONS_PER_CHUNK if on_cpu else ACCELERATOR_POSITIONS_PER_CHUNK
        parts = zip(*[tensor.split(size) for tensor in inputs], strict=True)
        return torch.cat([function(*part) for part in parts])


def _density(network: NerfNetwork, positions: Tensor) -> Tensor:
    return torch.relu(network.raw_density(network.hidden(positions)))


def _shape(values: dict[str, Any], tensors: dict[str, Tensor], network: str) -> NerfShape:
    layers = sum(name.startswith(f"{network}.pts_linears.") and name.endswith(".weight") for name in tensors)
    if values["depth"] != layers:
        raise ValueError(f"{values['depth']} layers, of which {layers} are there")
    return NerfShape(**{item.name: values[item.name] for item in fields(NerfShape)} | {"skips": tuple(values["skips"])})
