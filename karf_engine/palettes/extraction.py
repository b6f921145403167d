"""Extract an object's palette: the hull of its colors and black, simplified by moving vertices outward.

Cells [c, 3] are mean colors of histogram bins, with pixel counts [c]. The cloud spans rank r = 1, 2 or 3 about black;
`lift` [3, r] maps coordinates of the span to colors. A collapse replaces two neighboring vertices by one outside all
their facets, which keeps all colors inside, with the least added volume (Tan, Echevarria, Gingold 2018).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
from scipy.spatial import ConvexHull

from ..errors import DataError
from ..project.settings import PaletteSettings
from .color_histogram import ColorHistogram, cell_support, color_cells, weighted_quantile
from .palette import Palette
from .palette_weights import outside_distance, star_weights

FLAT_EXTENT, FLAT_SHARE = 8 / 255, 0.995  # a cloud is flat if this share of its pixels is thinner
OUTLIER_SHARE = 0.0005  # share of the pixels in a cell and its 26 neighbors below which it is an outlier
MANY_VIEWS = 3  # with this number of views a color must occur in two
EXACT_VERTICES = 10  # with at most this number lossy collapses are compared by their measured loss
COARSE_LOSS = 0.25 / 255  # RMS distance of pixels to the hull before simplification
COARSE_VERTICES = 48  # limit for round clouds, which would keep hundreds
TOUCH = 1e-9


def extract_palettes(
    names: Sequence[str], pixels: Sequence[Sequence[np.ndarray]], settings: PaletteSettings, seed: int = 0
) -> list[Palette]:
    """Extract one palette per object, or with `settings.shared` one from all colors.

    Pixels are the photo colors of each object in each view, [n, 3] sRGB in [0, 1], at least one per object. The seed is
    for the random colors of `settings.start="random"`.
    """
    random = np.random.default_rng(seed)
    groups = [[view for own in pixels for view in own]] if settings.shared else pixels
    found = []
    for views in groups:
        cells, counts = color_cells(np.concatenate(views))
        colors = extract_palette(
            cells, counts, settings.colors or None, settings.tolerance, support=cell_support(cells, views)
        )
        if settings.start == "random":
            colors = np.concatenate([colors[:1], random.random((len(colors) - 1, 3), np.float32)])
        found.append(colors)
    return [Palette(name, found[0 if settings.shared else k]) for k, name in enumerate(names)]


def color_histograms(palettes: Sequence[Palette], pixels: Sequence[Sequence[np.ndarray]]) -> dict[str, ColorHistogram]:
    """Return each object's color histogram with palette weights, from its photo colors [n, 3] in each view."""
    histograms = {}
    for palette, views in zip(palettes, pixels, strict=True):
        cells, counts = color_cells(np.concatenate(views))
        histograms[palette.name] = ColorHistogram(cells.astype(np.float32), counts, star_weights(cells, palette.colors))
    return histograms


def extract_palette(
    cells: np.ndarray,  # [c, 3] sRGB in [0, 1]
    counts: np.ndarray,  # [c] number of pixels
    n_colors: int | None = None,  # M with black, at least 2; fewer if the cloud is too flat
    tolerance: float = 2 / 255,  # RMS distance in units of color
    n_max: int = 8,  # at least 2
    support: np.ndarray | None = None,  # [c] number of views of each cell
) -> np.ndarray:
    """Extract a palette whose convex combinations give an object's colors, [M, 3] float32 sRGB in [0, 1].

    Black comes first, then the others, most used first. Gray and single-hue clouds give black and one color, flat ones
    3 or more colors, others 4 or more. Without `n_colors`, M is the smallest number up to n_max whose hull leaves the
    pixels within `tolerance`. If any cell is in 3 or more views, cells of a single view are dropped as spill. Raises
    DataError without cells.
    """
    if not len(cells):
        raise DataError("An object without pixels has no palette.", "Check its masks and the segmentation.")
    keep = _trusted(np.asarray(cells, np.float64), counts, support)
    cells, counts = np.asarray(cells, np.float64)[keep], np.asarray(counts, np.float64)[keep]
    if cells.max() < 1 / 255:
        return np.array([[0, 0, 0], [1, 1, 1]], np.float32)  # black alone: white is a neutral partner
    axes, rank = _span(cells, counts)
    rank = rank if n_colors is None else min(rank, n_colors - 1)
    if rank == 1:
        palette = np.clip([np.zeros(3), (cells @ axes[0]).max() * axes[0]], 0, 1)
    else:
        lift = np.eye(3) if rank == 3 else axes[:2].T
        palette = _simplify(_Cloud(cells, counts, lift), n_colors, tolerance, n_max)
    use = counts @ star_weights(cells, palette)
    # clipping may have moved a vertex into the hull, where it has no weight
    order = [0] + [j for j in np.argsort(-use, kind="stable") if j > 0 and use[j] > 0]
    return palette[order].astype(np.float32)


def _trusted(cells: np.ndarray, counts: np.ndarray, support: np.ndarray | None) -> np.ndarray:
    """Return the cells, bool [c], that are neither outliers nor spill of a single view."""
    bins = 32
    grid = np.zeros((bins + 2,) * 3)
    red, green, blue = np.clip((cells * bins).astype(int), 0, bins - 1).T + 1
    np.add.at(grid, (red, green, blue), counts)
    shifts = range(-1, 2)
    around = sum(grid[red + i, green + j, blue + k] for i in shifts for j in shifts for k in shifts)
    keep = around >= OUTLIER_SHARE * np.sum(counts)
    if support is not None and np.max(support) >= MANY_VIEWS:
        keep &= np.asarray(support) > 1
    return keep if keep.any() else np.ones(len(cells), bool)


def _span(cells: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, int]:
    """Return the principal axes about black [3, 3], longest first, and the rank."""
    moment = (cells * counts[:, None]).T @ cells
    axes = np.linalg.eigh(moment)[1].T[::-1]
    axes *= np.where(axes.sum(axis=1) < 0, -1, 1)[:, None]
    along = cells @ axes.T
    off_line = np.linalg.norm(along[:, 1:], axis=1)
    off_plane = np.abs(along[:, 2])
    rank = 1 + sum(weighted_quantile(extent, counts, FLAT_SHARE) > FLAT_EXTENT for extent in (off_line, off_plane))
    return axes, rank


@dataclass(frozen=True)
class _Cloud:
    """Cells [c, 3] with counts [c], and the span `lift` [3, r] of their hull."""

    cells: np.ndarray
    counts: np.ndarray
    lift: np.ndarray

    def loss(self, vertices: np.ndarray) -> float:
        """Return the RMS distance of the pixels outside the hull of vertices [V, r]."""
        squared = outside_distance(self.cells, self.palette(vertices)) ** 2
        return float(np.sqrt(self.counts @ squared / self.counts.sum()))

    def palette(self, vertices: np.ndarray) -> np.ndarray:
        return np.clip(vertices @ self.lift.T, 0, 1)


@dataclass
class _Mesh:
    """Shrinking hull: all points ever made, ids of the current vertices (0 is black), and cached collapses."""

    lift: np.ndarray
    points: list[np.ndarray]
    ids: list[int]
    solved: dict[tuple, tuple[float, np.ndarray, bool] | None] = field(default_factory=dict)

    def vertices(self, ids: Sequence[int] | None = None) -> np.ndarray:
        return np.array([self.points[i] for i in (self.ids if ids is None else ids)])

    def replaced(self, pair: tuple[int, int], point: np.ndarray) -> np.ndarray:
        return np.vstack([self.vertices([i for i in self.ids if i not in pair]), point])

    def collapse(self, pair: tuple[int, int], point: np.ndarray) -> None:
        """Collapse the pair into the point; drop vertices inside the larger hull."""
        self.points.append(point)
        self.ids = [i for i in self.ids if i not in pair] + [len(self.points) - 1]
        corners = set(ConvexHull(self.vertices()).vertices)
        self.ids = [i for place, i in enumerate(self.ids) if place in corners or i == 0]

    def collapses(self) -> list[tuple[tuple[int, int], float, np.ndarray, bool]]:
        """Return all possible collapses: pair, added volume, new point, and whether it is inside the color cube."""
        hull = ConvexHull(self.vertices())
        facets = np.array(self.ids)[hull.simplices]
        sizes = _facet_sizes(self.vertices()[hull.simplices])
        pairs = {tuple(sorted(pair)) for facet in facets.tolist() for pair in combinations(facet, 2)}
        found = []
        for pair in sorted(pair for pair in pairs if 0 not in pair):
            near = np.isin(facets, pair).any(axis=1)
            key = (pair, frozenset(map(tuple, np.sort(facets[near], axis=1).tolist())))
            if key not in self.solved:
                self.solved[key] = _outward_point(hull.equations[near], sizes[near], self.lift)
            collapse = self.solved[key]
            if collapse is not None:
                found.append((pair, *collapse))
        return found


def _simplify(cloud: _Cloud, n_colors: int | None, tolerance: float, n_max: int) -> np.ndarray:
    """Return the palette of the simplified hull of the cloud and black."""
    mesh = _coarse_hull(cloud)
    smallest = cloud.lift.shape[1] + 1
    wanted = smallest if n_colors is None else max(n_colors, smallest)
    while len(mesh.ids) > (n_max if n_colors is None else wanted):
        mesh.collapse(*_best_collapse(mesh, cloud))
    while len(mesh.ids) > wanted:
        pair, point = _best_collapse(mesh, cloud)
        if n_colors is None and cloud.loss(mesh.replaced(pair, point)) > tolerance:
            break
        mesh.collapse(pair, point)
    return cloud.palette(mesh.vertices())


def _coarse_hull(cloud: _Cloud) -> _Mesh:
    """Return the hull of black and a few cells that contain nearly all pixels: a simplex grown by the farthest cells."""
    points = np.vstack([np.zeros(cloud.lift.shape[1]), cloud.cells @ cloud.lift])
    share = np.append(0, cloud.counts) / cloud.counts.sum()
    ids = _simplex(points)
    while True:
        equations = ConvexHull(points[ids]).equations
        outside = np.maximum((points @ equations[:, :-1].T + equations[:, -1]).max(axis=1), 0)
        if np.sqrt(share @ outside**2) <= COARSE_LOSS or len(ids) == COARSE_VERTICES:
            corners = ConvexHull(points[ids]).vertices
            return _Mesh(cloud.lift, list(points), [i for place, i in enumerate(ids) if place in corners or i == 0])
        ids.append(int(outside.argmax()))


def _simplex(points: np.ndarray) -> list[int]:
    """Return the indices of r + 1 points [n, r] that span space: point 0, then each time the farthest one."""
    ids, rest = [0], points - points[0]
    for _ in range(points.shape[1]):
        ids.append(int((rest**2).sum(axis=1).argmax()))
        direction = rest[ids[-1]] / np.linalg.norm(rest[ids[-1]])
        rest = rest - (rest @ direction)[:, None] * direction
    return ids


def _best_collapse(mesh: _Mesh, cloud: _Cloud) -> tuple[tuple[int, int], np.ndarray]:
    """Return the collapse of least added volume inside the color cube, otherwise that of least loss."""
    found = mesh.collapses()
    lossless = [(volume, pair, point) for pair, volume, point, inside in found if inside]
    if lossless:
        _, pair, point = min(lossless, key=lambda each: each[:2])
        return pair, point
    lossy = [(volume, pair, point) for pair, volume, point, _ in found]
    if len(mesh.ids) <= EXACT_VERTICES or not lossy:
        # removing a vertex is a collapse onto another one
        others = mesh.ids[1:]
        lossy += [(0.0, (i, j), mesh.points[j]) for i, j in zip(others, others[1:] + others[:1], strict=True)]
        lossy = [(cloud.loss(mesh.replaced(pair, point)), pair, point) for _, pair, point in lossy]
    _, pair, point = min(lossy, key=lambda each: each[:2])
    return pair, point


def _facet_sizes(corners: np.ndarray) -> np.ndarray:
    """Return the lengths or areas of facets [F, r, r], r = 2 or 3."""
    sides = corners[:, 1:] - corners[:, :1]
    gram = sides @ sides.transpose(0, 2, 1)
    return np.sqrt(np.maximum(np.linalg.det(gram), 0)) / (1 if corners.shape[1] == 2 else 2)


def _outward_point(equations: np.ndarray, sizes: np.ndarray, lift: np.ndarray) -> tuple[float, np.ndarray, bool] | None:
    """Find the point outside facets [k, r + 1] (normal, offset) of given sizes [k] that adds the least volume.

    Returns the volume, the point [r] clipped to the color cube, and whether it was inside; None if there is none.
    """
    rank = lift.shape[1]
    gradient, constant = sizes @ equations[:, :rank] / rank, sizes @ equations[:, rank] / rank
    free = _least_vertex(equations[:, :rank], -equations[:, rank], gradient)
    if free is None:
        return None
    color = lift @ free
    inside = bool((color > -TOUCH).all() and (color < 1 + TOUCH).all())
    if not inside:
        planes = np.vstack([equations[:, :rank], lift, -lift])
        floors = np.concatenate([-equations[:, rank], np.zeros(3), -np.ones(3)])
        boxed = _least_vertex(planes, floors, gradient)
        if boxed is not None:
            free, inside = boxed, True
    return float(gradient @ free + constant), lift.T @ np.clip(lift @ free, 0, 1), inside


def _least_vertex(planes: np.ndarray, floors: np.ndarray, gradient: np.ndarray) -> np.ndarray | None:
    """Minimise gradient @ x subject to planes @ x >= floors, planes [k, r]; None if infeasible. Enumerates corners."""
    k, rank = planes.shape
    chosen = np.array(list(combinations(range(k), rank)), int).reshape(-1, rank)
    sides = np.zeros((k, 3))
    sides[:, :rank] = planes
    first, second = sides[chosen[:, 0]], sides[chosen[:, 1]]
    # in 2D the third side is the plane itself
    third = sides[chosen[:, 2]] if rank == 3 else np.broadcast_to([0.0, 0.0, 1.0], first.shape)
    levels = [floors[chosen[:, i]][:, None] if i < rank else 0.0 for i in range(3)]
    second_third = _cross(second, third)
    volume = (first * second_third).sum(axis=1)
    mixed = levels[0] * second_third + levels[1] * _cross(third, first) + levels[2] * _cross(first, second)
    regular = np.abs(volume) > TOUCH
    corners = mixed[regular, :rank] / volume[regular, None]
    corners = corners[(corners @ planes.T >= floors - TOUCH).all(axis=1)]
    return corners[(corners @ gradient).argmin()] if len(corners) else None


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    # several times faster than np.cross on small stacks
    return a[:, (1, 2, 0)] * b[:, (2, 0, 1)] - a[:, (2, 0, 1)] * b[:, (1, 2, 0)]
