"""Fitting what lies in a box: an object alone, or on a table before a background far away.

What makes it clean, by kind of background:

- alpha: the matte supervises opacity over random backgrounds, and the first grid is the mattes' visual hull;
- black, white: rays end at that color, and at a random one where the photo shows something else, which must then be
  opaque: otherwise opacity and brightness trade off; half-transparent rays are punished;
- opaque: the background is a function of direction that only rays through empty space may teach. Where no such ray
  exists it is random, so that what stands there must become opaque; a ray's samples are drawn together. Where the
  background alone shows a photo's color, opacity costs: fog of that color, which no photo contradicts, clears. Where
  cameras stand far apart (`wide_baseline.py`), the first grid is what could look alike in the photos, and the
  background is never random, since fog would be made of it; where no photo tells it is what others of the same
  elevation show.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from ...compute.runtime import Runtime
from ...project.settings import GeometrySettings, Level
from ..background import Background
from ..extent import box_round_focus, upright_axes
from ..rendering.rays import PixelDataset
from ..spaces import OPAQUE_REACH
from ..wide_baseline import PARAMETERS as WIDE_BASELINE
from ..wide_baseline import could_be_solid, is_wide, turned
from .field import VoxelField
from .fit import Batch, VoxelFit
from .renderer import RayBatch, RaySums

AZIMUTH_BINS, ELEVATION_BINS = 36, 36
FOG_PENALTY = 3e-2  # weight of opacity before a background that shows the photo's color by itself
ALIKE = 0.03  # standard deviation of a photo's color from a background that it shows
# share of a direction's rays that must pass everything: else photos show things there, and a background that was learned
# past them may look like these
LEAST_BACKGROUND_SUPPORT = 0.2
SEEING = 0.25  # of the views see all that mattes may be of: a table is wider than a picture


class BackgroundSupport:
    """Which directions training rays see through empty space, in bins of 10 by 5 degrees.

    Attributes:
        free: Share of the rays in each bin that met no occupied cell.
    """

    def __init__(self, device: torch.device) -> None:
        self.free = torch.zeros(AZIMUTH_BINS * ELEVATION_BINS, device=device)

    def _bins(self, viewdirs: Tensor) -> Tensor:
        azimuth = (torch.atan2(viewdirs[:, 1], viewdirs[:, 0]) / (2 * math.pi) + 0.5) * AZIMUTH_BINS
        elevation = torch.acos(viewdirs[:, 2].clamp(-1, 1)) / math.pi * ELEVATION_BINS
        return azimuth.long().clamp_max(AZIMUTH_BINS - 1) * ELEVATION_BINS + elevation.long().clamp_max(
            ELEVATION_BINS - 1
        )

    def note(self, viewdirs: Tensor, free: Tensor) -> None:
        """Directions [n, 3] of rays, and which of them met no occupied cell, [n] bool."""
        bins, size = self._bins(viewdirs), len(self.free)
        all_rays = torch.bincount(bins, minlength=size)
        self.free = torch.bincount(bins[free], minlength=size) / all_rays.clamp_min(1)

    def shares(self, viewdirs: Tensor) -> Tensor:
        """Share of the rays in each direction's bin that are such rays, [n]."""
        return self.free[self._bins(viewdirs)]


class BoxFit(VoxelFit):
    """The fit of what lies in a box round the cameras' focus point."""

    cuts = (1 / 6, 1 / 2)
    first_share = 0.5

    def __init__(
        self,
        dataset: PixelDataset,
        background_kind: str,
        settings: GeometrySettings,
        runtime: Runtime,
        field: VoxelField,
        is_wide: bool = False,
    ) -> None:
        """A fresh fit; is_wide: whether the photos' cameras stand far apart."""
        background = Background().to(runtime.device) if background_kind == "opaque" else None
        super().__init__(dataset, settings, runtime, field, background)
        self.background_kind = background_kind
        self._first_voxel = field.voxel
        self._support = BackgroundSupport(runtime.device)  # learned from the second level on
        self._upright = torch.from_numpy(upright_axes(dataset.cameras)).float().to(runtime.device) if is_wide else None

    def _begin_level(self, level: Level) -> None:
        if self.background is not None:
            self._learn_support(level)

    def _own_tensors(self) -> dict[str, Tensor]:
        return super()._own_tensors() | {"support": self._support.free}

    def _trained_networks(self, field: VoxelField) -> list:
        return super()._trained_networks(field) + (
            [] if self.background is None else list(self.background.parameters())
        )

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        index = self.dataset.draw(n_rays, self.runtime)
        rays = self.dataset.rays(index)
        target = self.dataset.exposed_alike(index)
        sums = self._renderer.render(RayBatch(rays, level.step, self.runtime.rand(n_rays), number == 0))
        backdrop = None if self.background is None else self.background(rays.viewdirs)
        free = None if number == 0 or backdrop is None else self._support.shares(rays.viewdirs)
        behind = self._behind(index, sums, backdrop, free)
        if self.dataset.alpha is not None:
            matte = self.dataset.alpha[index].float()[:, None] / 255
            target = target * matte + (1 - matte) * behind
        error = ((sums.color + sums.final_transmittance[:, None] * behind - target) ** 2).mean()
        loss = error + self._regularization(number, sums)
        if self._upright is not None:
            loss = loss + WIDE_BASELINE.mean_background * self._background_of_elevation(rays.viewdirs, target, sums)
        if free is not None:
            needless = _needless(backdrop.detach(), target, free)
            loss = loss + FOG_PENALTY * (needless * (1 - sums.final_transmittance)).mean()
        return Batch(loss, error, sums.n_samples)

    def _behind(self, index: Tensor, sums: RaySums, backdrop: Tensor | None, free: Tensor | None) -> Tensor:
        """The color behind the ray of each pixel, [R, 3].

        backdrop: what the background shows there, [R, 3]; None without one. free: share of the rays in the ray's
        direction that see past everything, [R]; None while that is not known.
        """
        n_rays = len(index)
        if self.background_kind == "alpha":
            return self.runtime.rand(n_rays, 3)
        if backdrop is None:
            plain = torch.full((n_rays, 3), 1.0 if self.background_kind == "white" else 0.0, device=self.runtime.device)
            return torch.where(self.dataset.solid[index, None], self.runtime.rand(n_rays, 3), plain)
        if free is None or self._upright is not None:
            return backdrop
        passes = (sums.final_transmittance.detach() > 1 - 1e-6)[:, None]
        color = torch.where(passes, backdrop, backdrop.detach())
        return torch.where((free > 0)[:, None] | passes, color, self.runtime.rand(n_rays, 3))

    def _background_of_elevation(self, viewdirs: Tensor, target: Tensor, sums: RaySums) -> Tensor:
        """How far the background in other directions of the same elevations is from what photos show past everything."""
        elsewhere = self.background(turned(viewdirs, self._upright, self.runtime.rand(len(viewdirs))))
        return (sums.final_transmittance.detach() * ((elsewhere - target) ** 2).sum(1)).mean()

    def _regularization(self, number: int, sums: RaySums) -> Tensor:
        settings = self.recipe
        loss = settings.total_variation * self._total_variation()
        if number == 0:
            loss = loss + settings.sparsity * sums.alpha.sum() / max(sums.n_samples, 1)
        if self.background is not None:
            falling = settings.depth_variance * (1.0, 0.3, 0.1)[min(number, 2)]
            opacity = (1 - sums.final_transmittance).clamp_min(1e-6)
            variance = (sums.distance_squared - sums.distance**2 / opacity).mean()
            loss = loss + falling * variance * (self._unit / self._first_voxel) ** 2
        elif self.dataset.alpha is None and number > 0:
            opacity = (1 - sums.final_transmittance).clamp(1e-4, 1 - 1e-4)
            entropy = -(opacity * opacity.log() + (1 - opacity) * (1 - opacity).log())
            loss = loss + settings.opacity_entropy * entropy.mean()
        return loss

    def _total_variation(self) -> Tensor:
        """Mean squared difference of neighbors in table order (along z) over a random stretch of an eighth."""
        n_rows = len(self.field.raw_density)
        length = max(2, n_rows // 8)
        start = self.runtime.randint(n_rows - length + 1, 1)
        rows = start + torch.arange(length, device=self.runtime.device)
        density, features = self._renderer.differences(rows[:-1], rows[1:])
        return (density + features / self.field.n_features) / (length - 1)

    @torch.no_grad()
    def _learn_support(self, level: Level) -> None:
        """Note which directions training rays see past every occupied cell."""
        viewdirs, free = [], []
        for rays in self._some_rays():
            viewdirs.append(rays.viewdirs)
            free.append(self._renderer.is_free(rays, level.step))
        self._support.note(torch.cat(viewdirs), torch.cat(free))


def _needless(backdrop: Tensor, target: Tensor, free: Tensor) -> Tensor:
    """How well the background alone shows each pixel, [R] in [0, 1]; 0 in directions that rarely show it."""
    gap = ((backdrop - target) ** 2).sum(1)
    return torch.exp(-gap / (2 * ALIKE**2)) * (free > LEAST_BACKGROUND_SUPPORT)


def visual_hull(dataset: PixelDataset, points: Tensor, margin: float) -> Tensor:
    """True for points [n, 3] that SEEING of the views see, each with something within `margin` (world units)."""
    possible = torch.ones(len(points), dtype=torch.bool, device=points.device)
    n_seen = torch.zeros(len(points), dtype=torch.long, device=points.device)
    for number, camera in enumerate(dataset.cameras):
        first, last = int(dataset.first[number]), int(dataset.first[number + 1])
        matte = dataset.alpha[first:last].view(1, 1, camera.height, camera.width) > 0
        depth_of_middle = float(torch.linalg.norm(points.mean(0) - torch.from_numpy(camera.position).to(points)))
        radius = max(1, math.ceil(margin * camera.fx / depth_of_middle))
        matte = nn.functional.max_pool2d(matte.float(), 2 * radius + 1, stride=1, padding=radius)[0, 0] > 0
        inverse = torch.from_numpy(camera.world_to_camera).to(points)
        local = points @ inverse[:3, :3].T + inverse[:3, 3]
        u = (camera.cx - camera.fx * local[:, 0] / local[:, 2]).floor().long()
        v = (camera.cy + camera.fy * local[:, 1] / local[:, 2]).floor().long()
        inside = (local[:, 2] < 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
        possible &= ~inside | matte[v.clamp(0, camera.height - 1), u.clamp(0, camera.width - 1)]
        n_seen += inside
    return possible & (n_seen >= SEEING * len(dataset.cameras))


def start_box_fit(dataset: PixelDataset, background_kind: str, settings: GeometrySettings, runtime: Runtime) -> BoxFit:
    """A fresh field in a box round the cameras' focus point, with everything in it possible."""
    center, half_width = box_round_focus(dataset.cameras, OPAQUE_REACH if background_kind == "opaque" else 0.75)
    n = settings.levels[0].voxels
    if dataset.alpha is not None:  # the mattes allow a tighter box
        center, half_width = _matte_box(dataset, center, half_width)
    minimum = (center - half_width).float().to(runtime.device)
    voxel = 2 * half_width / n
    occupied = torch.ones(n, n, n, dtype=torch.bool, device=runtime.device)
    wide = background_kind == "opaque" and is_wide(dataset.cameras, center)
    if dataset.alpha is not None or wide:
        points = minimum + (torch.nonzero(occupied) + 0.5) * voxel
        possible = could_be_solid(dataset, points, voxel) if wide else visual_hull(dataset, points, voxel)
        # photos of very different exposures may agree nowhere
        occupied = (~possible if wide and not possible.any() else possible).view(n, n, n)
    field = VoxelField(minimum, voxel, occupied, settings.features)
    return BoxFit(dataset, background_kind, settings, runtime, field, wide)


def _matte_box(dataset: PixelDataset, center: Tensor, half_width: float) -> tuple[Tensor, float]:
    """A box round the mattes' visual hull, looked for in a generous one."""
    n, wide = 48, half_width * 1.8
    grid = torch.stack(torch.meshgrid(*[torch.arange(n)] * 3, indexing="ij"), -1).view(-1, 3)
    voxel = 2 * wide / n
    points = ((center - wide) + (grid + 0.5) * voxel).float().to(dataset.color.device)
    inside = points[visual_hull(dataset, points, voxel)]
    if len(inside) == 0:
        return center, half_width
    low, high = inside.amin(0).cpu().double() - voxel, inside.amax(0).cpu().double() + voxel
    return (low + high) / 2, float((high - low).max()) / 2
