"""Training in a box: an object alone, or on a table in front of a distant background.

Handling of the background, by kind:

- alpha: random colors behind the matte supervise the opacity; training starts from the visual hull of the mattes.
- black, white: the plain color, but a random color behind pixels known to be solid, which must then become opaque.
  An entropy loss penalizes partial opacity.
- opaque: a function of direction, learned only from rays through empty space. In directions without such rays its color
  is random, so that what is there must become opaque. Opacity is penalized where the background alone explains the
  photo, which removes fog, and the variance of the depth along each ray is penalized.
- opaque with wide baselines (see priors.py): training starts from the cells whose color agrees between photos.
  The background is never random, which would create fog, and is drawn to the photos' colors at the same elevation.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from ...compute.runtime import Runtime
from ...project.settings import GeometrySettings, Level
from ..extent import OPAQUE_REACH, box_around_focus, is_wide_baseline, upright_axes
from ..priors import is_photo_consistent, rotate_about_vertical
from ..rendering.rays import PixelDataset
from ..scene import Background
from .field import VoxelField
from .fit import Batch, VoxelFit
from .renderer import RayBatch, RaySums

AZIMUTH_BINS, ELEVATION_BINS = 36, 36
MEAN_BACKGROUND = 0.3  # weight of the prior that a wide-baseline background only depends on the elevation
FOG_PENALTY = 3e-2  # weight of opacity where the background alone explains the photo
COLOR_DEVIATION = 0.03  # standard deviation between photo and background that count as equal
# fraction of the rays of a direction that must be free before fog is penalized; with fewer, the photos show objects there
MIN_FREE = 0.2
HULL_VIEWS = (
    0.25  # fraction of the views that must see a point of the visual hull; not all, a table may exceed a picture
)
MATTE_BOX_CELLS = 48


class BoxFit(VoxelFit[GeometrySettings]):
    """Fit of a field in a box around the cameras' focus point."""

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
        """Create a new fit. is_wide: the cameras have wide baselines."""
        background = Background().to(runtime.device) if background_kind == "opaque" else None
        super().__init__(dataset, settings, runtime, field, background)
        self.background_kind = background_kind
        self._first_voxel = field.voxel
        # fraction of the rays of each direction bin that meet no occupied cell, measured from the second level on
        self._free = torch.zeros(AZIMUTH_BINS * ELEVATION_BINS, device=runtime.device)
        self._upright = torch.from_numpy(upright_axes(dataset.cameras)).float().to(runtime.device) if is_wide else None

    @torch.no_grad()
    def _begin_level(self, level: Level) -> None:
        if self.background is None:
            return
        bins, is_free = [], []
        for rays in self._random_rays():
            bins.append(_direction_bins(rays.viewdirs))
            is_free.append(self.renderer.is_free(rays, level.step))
        n_rays, n_free = (
            torch.bincount(each, minlength=len(self._free))
            for each in (torch.cat(bins), torch.cat(bins)[torch.cat(is_free)])
        )
        self._free = n_free / n_rays.clamp_min(1)

    def _own_tensors(self) -> dict[str, Tensor]:
        return super()._own_tensors() | {"support": self._free}

    def _trained_networks(self, field: VoxelField) -> list[nn.Parameter]:
        background = [] if self.background is None else list(self.background.parameters())
        return super()._trained_networks(field) + background

    def _batch(self, number: int, level: Level, n_rays: int) -> Batch:
        index = self.dataset.draw(n_rays, self.runtime)
        rays = self.dataset.rays(index)
        target = self.dataset.normalized_colors(index)
        sums = self.renderer.render(RayBatch(rays, level.step, self.runtime.rand(n_rays), number == 0))
        backdrop = None if self.background is None else self.background(rays.viewdirs)
        free = None if number == 0 or backdrop is None else self._free[_direction_bins(rays.viewdirs)]
        behind = self._behind(index, sums, backdrop, free)
        if self.dataset.alpha is not None:
            matte = self.dataset.alpha[index].float()[:, None] / 255
            target = target * matte + (1 - matte) * behind
        error = ((sums.color + sums.final_transmittance[:, None] * behind - target) ** 2).mean()
        loss = error + self._regularization(number, sums)
        if self._upright is not None:
            elevation = self._elevation_loss(self._upright, rays.viewdirs, target, sums)
            loss = loss + MEAN_BACKGROUND * elevation
        if backdrop is not None and free is not None:
            fog = _explained_by(backdrop.detach(), target, free) * (1 - sums.final_transmittance)
            loss = loss + FOG_PENALTY * fog.mean()
        return Batch(loss, error, sums.n_samples)

    def _behind(self, index: Tensor, sums: RaySums, backdrop: Tensor | None, free: Tensor | None) -> Tensor:
        """Return the color behind each pixel's ray, [R, 3].

        Args:
            index: Pixels, [R].
            sums: Of their rays.
            backdrop: Color of the learned background, [R, 3]; None without one.
            free: Fraction of free rays in the same direction, [R]; None until it is measured.
        """
        n_rays = len(index)
        if self.background_kind == "alpha":
            return self.runtime.rand(n_rays, 3)
        if backdrop is None:
            assert self.dataset.solid is not None  # given with plain backgrounds
            plain = torch.full((n_rays, 3), 1.0 if self.background_kind == "white" else 0.0, device=self.runtime.device)
            return torch.where(self.dataset.solid[index, None], self.runtime.rand(n_rays, 3), plain)
        if free is None or self._upright is not None:
            return backdrop
        passes = (sums.final_transmittance.detach() > 1 - 1e-6)[:, None]
        color = torch.where(passes, backdrop, backdrop.detach())
        return torch.where((free > 0)[:, None] | passes, color, self.runtime.rand(n_rays, 3))

    def _elevation_loss(self, upright: Tensor, viewdirs: Tensor, target: Tensor, sums: RaySums) -> Tensor:
        """Return the difference between free rays' colors and the background in other directions of their elevation."""
        assert self.background is not None
        elsewhere = self.background(rotate_about_vertical(viewdirs, upright, self.runtime.rand(len(viewdirs))))
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
        """Return the mean squared difference of consecutive rows (neighbors along z) in a random eighth of the table."""
        n_rows = len(self.field.raw_density)
        length = max(2, n_rows // 8)
        start = self.runtime.randint(n_rows - length + 1, 1)
        rows = start + torch.arange(length, device=self.runtime.device)
        density, features = self.renderer.differences(rows[:-1], rows[1:])
        return (density + features / self.field.n_features) / (length - 1)


def _direction_bins(viewdirs: Tensor) -> Tensor:
    """Return the bin of directions [n, 3], 10 degrees of azimuth by 5 of elevation, [n]."""
    azimuth = (torch.atan2(viewdirs[:, 1], viewdirs[:, 0]) / (2 * math.pi) + 0.5) * AZIMUTH_BINS
    elevation = torch.acos(viewdirs[:, 2].clamp(-1, 1)) / math.pi * ELEVATION_BINS
    row, column = elevation.long().clamp_max(ELEVATION_BINS - 1), azimuth.long().clamp_max(AZIMUTH_BINS - 1)
    return column * ELEVATION_BINS + row


def _explained_by(backdrop: Tensor, target: Tensor, free: Tensor) -> Tensor:
    """Return how well the background alone explains each pixel, [R] in [0, 1]; 0 in directions with few free rays."""
    gap = ((backdrop - target) ** 2).sum(1)
    return torch.exp(-gap / (2 * COLOR_DEVIATION**2)) * (free > MIN_FREE)


def visual_hull(dataset: PixelDataset, points: Tensor, margin: float) -> Tensor:
    """Carve points by the mattes.

    Args:
        dataset: Photos with mattes.
        points: [n, 3], world.
        margin: Dilation of the mattes, world units.

    Returns:
        [n] bool, True for points inside all mattes of the views that see them, if HULL_VIEWS of the views do.
    """
    assert dataset.alpha is not None
    possible = torch.ones(len(points), dtype=torch.bool, device=points.device)
    n_seen = torch.zeros(len(points), dtype=torch.long, device=points.device)
    for number, camera in enumerate(dataset.cameras):
        first, last = int(dataset.offsets[number]), int(dataset.offsets[number + 1])
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
    return possible & (n_seen >= HULL_VIEWS * len(dataset.cameras))


def start_box_fit(dataset: PixelDataset, background_kind: str, settings: GeometrySettings, runtime: Runtime) -> BoxFit:
    """Create the fit of a new field in a box around the cameras' focus point."""
    center, half_width = box_around_focus(dataset.cameras, OPAQUE_REACH if background_kind == "opaque" else 0.75)
    n = settings.levels[0].voxels
    if dataset.alpha is not None:
        center, half_width = _matte_box(dataset, center, half_width)
    minimum = (center - half_width).float().to(runtime.device)
    voxel = 2 * half_width / n
    occupied = torch.ones(n, n, n, dtype=torch.bool, device=runtime.device)
    wide = background_kind == "opaque" and is_wide_baseline(dataset.cameras, center)
    if dataset.alpha is not None or wide:
        points = minimum + (torch.nonzero(occupied) + 0.5) * voxel
        possible = is_photo_consistent(dataset, points, voxel) if wide else visual_hull(dataset, points, voxel)
        # photos of very different exposures may agree nowhere
        occupied = (~possible if wide and not possible.any() else possible).view(n, n, n)
    field = VoxelField(minimum, voxel, occupied, settings.features)
    return BoxFit(dataset, background_kind, settings, runtime, field, wide)


def _matte_box(dataset: PixelDataset, center: Tensor, half_width: float) -> tuple[Tensor, float]:
    """Return center and half-width of the bounding box of the visual hull, found within 1.8 times the given box."""
    n, wide = MATTE_BOX_CELLS, half_width * 1.8
    grid = torch.stack(torch.meshgrid(*[torch.arange(n)] * 3, indexing="ij"), -1).view(-1, 3)
    voxel = 2 * wide / n
    points = ((center - wide) + (grid + 0.5) * voxel).float().to(dataset.color.device)
    inside = points[visual_hull(dataset, points, voxel)]
    if len(inside) == 0:
        return center, half_width
    low, high = inside.amin(0).cpu().double() - voxel, inside.amax(0).cpu().double() + voxel
    return (low + high) / 2, float((high - low).max()) / 2
