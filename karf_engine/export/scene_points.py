"""Recolorable surface points of a learned scene, for 3D viewers. K objects, M palette entries, N points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..errors import DataError
from ..io.color import to_bytes
from ..io.files import atomic_write
from ..io.names import check_names
from ..io.npz import has_arrays, read_arrays
from ..io.ply import encode_ply
from ..palettes.added import extended_palettes, split_weights_of_objects
from ..palettes.compositing import delta_composite, stack_palettes
from ..palettes.edge_shape import Borders, EdgeShape, active_edges, apply_edges_to_points
from ..palettes.palette import AddedColor, Palette
from ..palettes.star import plain_hull, star_of, star_weights_in

NUMBERS = ("positions", "normals", "sizes", "colors", "probabilities", "palette_weights", "learned")
BORDERS = ("distances", "spacings", "pixels")  # in files prefixed with "border_"
AGAIN = "Make the points again."
VERTEX = np.dtype(
    [(name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")] + [(c, "u1") for c in ("red", "green", "blue")]
)


@dataclass(frozen=True)
class ScenePoints:
    """Points on the surface of a scene."""

    objects: tuple[str, ...]  # names of the K objects
    positions: np.ndarray  # [N, 3] float32, the capture's world
    normals: np.ndarray  # [N, 3] float32, outward, of unit length
    sizes: np.ndarray  # [N] float32, local distance between points, world units
    colors: np.ndarray  # [N, 3] uint8 sRGB, as learned: the mean over the views that see the point
    probabilities: np.ndarray  # [N, K] float16 in [0, 1]
    palette_weights: np.ndarray  # [N, K, M] float16 in [0, 1], times probabilities
    learned: np.ndarray  # palettes as learned, [K, M, 3] float32 sRGB
    borders: Borders | None = None  # distances to the objects' borders; None in files of older versions

    def __len__(self) -> int:
        return len(self.positions)

    def with_added(self, palettes: Sequence[Palette], added: Mapping[str, Sequence[AddedColor]]) -> ScenePoints:
        """Spread the weights over added colors, see `palettes.added`. palettes: of the K objects as learned."""
        weights = split_weights_of_objects(self.palette_weights.transpose(1, 2, 0), palettes, added).transpose(2, 0, 1)
        learned = {each.name: each.colors for each in extended_palettes(palettes, added)}
        return replace(self, palette_weights=weights, learned=stack_palettes(self.objects, learned))

    def with_edges(self, palettes: Sequence[Palette], edges: Mapping[str, EdgeShape]) -> ScenePoints:
        """Move and fade the edges of objects; without changes, return these points. Call it before `with_added`.

        Newly covered points get palette weights by their own colors. Raises DataError for points without borders.
        """
        edges = active_edges(edges)
        if not edges:
            return self
        if self.borders is None:
            raise DataError("These surface points do not say how far they are from the objects' borders.", AGAIN)
        shares = apply_edges_to_points(self.probabilities, self.borders, self.objects, edges)
        weights = self.palette_weights.astype(np.float32)
        for k, palette in enumerate(palettes):
            if palette.name in edges:
                before, after, count = self.probabilities[:, k].astype(np.float32), shares[:, k], len(palette.colors)
                kept = np.divide(np.minimum(before, after), before, out=np.ones_like(before), where=before > 0)
                weights[:, k] *= kept[:, None]
                own = star_weights_in(star_of(palette.colors, plain_hull), self.colors / np.float32(255), count)
                weights[:, k, :count] += np.maximum(after - before, 0)[:, None] * own
        return replace(self, probabilities=shares.astype(np.float16), palette_weights=weights.astype(np.float16))

    def recolored(self, edited: np.ndarray) -> np.ndarray:
        """Recolor the points with an edit's palettes [K, M, 3], [N, 3] float32 sRGB in [0, 1], by `delta_composite`."""
        base = self.colors[None].astype(np.float32) / 255
        weights = self.palette_weights.transpose(1, 2, 0)[:, :, None].astype(np.float32)
        return delta_composite(base, weights, self.learned, edited)[0]


def write_points(path: Path, points: ScenePoints) -> None:
    """Write points as a compressed npz, atomically."""
    arrays = {name: getattr(points, name) for name in NUMBERS}
    if points.borders is not None:
        arrays |= {f"border_{name}": getattr(points.borders, name) for name in BORDERS}
    objects = np.array(points.objects, dtype=np.str_)
    atomic_write(path, lambda temporary: np.savez_compressed(temporary, objects=objects, **arrays))


def write_ply(path: Path, positions: np.ndarray, normals: np.ndarray, colors: np.ndarray) -> None:
    """Write points with positions, normals and sRGB colors in [0, 1], each [N, 3], as binary PLY, atomically."""
    table = np.empty(len(positions), VERTEX)
    columns = (*positions.T, *normals.T, *to_bytes(colors).T)
    for name, column in zip(VERTEX.names or (), columns, strict=True):
        table[name] = column
    atomic_write(path, lambda temporary: temporary.write_bytes(encode_ply({"vertex": table})))


def read_points(path: Path) -> ScenePoints:
    """Read points that `write_points` wrote. Raises DataError if the file is damaged, or its arrays do not match."""
    objects, *numbers = read_arrays(path, ("objects", *NUMBERS), "surface points", AGAIN)
    names = tuple(check_names(np.atleast_1d(objects).tolist(), path, "an object"))
    positions, normals, sizes, colors, probabilities, weights, learned = numbers
    points = ScenePoints(names, positions, normals, sizes, colors, probabilities, weights, learned)
    _check(path, points)
    stored = [f"border_{name}" for name in BORDERS]
    if not has_arrays(path, stored):
        return points
    borders = Borders(*read_arrays(path, stored, "surface points", AGAIN))
    n, k = points.probabilities.shape
    arrays = [getattr(borders, name) for name in BORDERS]
    if [each.shape for each in arrays] != [(n, k), (k,), (k,)] or any(each.dtype.kind != "f" for each in arrays):
        raise DataError(f"{path} (surface points) has borders of other points.", AGAIN)
    if np.isnan(borders.distances).any() or not all((each > 0).all() for each in arrays[1:]):
        raise DataError(f"{path} (surface points) has a border at no distance.", AGAIN)
    return replace(points, borders=borders)


def _check(path: Path, points: ScenePoints) -> None:
    n, k = len(np.atleast_1d(points.sizes)), len(points.objects)
    m = points.learned.shape[1] if points.learned.ndim == 3 else 0
    wanted = ((n, 3), (n, 3), (n,), (n, 3), (n, k), (n, k, m), (k, m, 3))
    shapes = {name: getattr(points, name).shape for name in NUMBERS}
    are_numbers = all(getattr(points, name).dtype.kind == "f" for name in NUMBERS if name != "colors")
    if tuple(shapes.values()) != wanted or not are_numbers or points.colors.dtype != np.uint8:
        raise DataError(f"{path} (surface points) has arrays that contradict each other: {shapes}.", AGAIN)
    if not all(np.isfinite(getattr(points, name)).all() for name in NUMBERS):
        raise DataError(f"{path} (surface points) has a number that is not finite.", AGAIN)
