"""Things with parts as thin as a pixel or less: leaves with pointed tips, hair-like stems, wires."""

from __future__ import annotations

import math

import numpy as np

from .materials import material
from .shapes import grid_object, lathe, place, tube

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
LEAF_WIDTHS = (0.008, 0.022, 0.031, 0.025, 0.001)  # half of it, from the soil to the tip
WIRE, HANDLE = 0.010, 0.014


def add_plant(x: float, y: float, color, object_id: int = 0) -> None:
    """Add a plant of long pointed leaves and hair-like stems with ears, material ``leaf``, in an unmarked clay pot."""
    clay = material("clay", (0.36, 0.15, 0.08), 0.8)
    outside = [(0.0, 0.0), (0.15, 0.0), (0.17, 0.01), (0.20, 0.15), (0.22, 0.27), (0.24, 0.28), (0.24, 0.33)]
    inside = [(0.22, 0.33), (0.21, 0.28), (0.0, 0.27)]
    place([grid_object("clay pot", lathe(outside + inside), clay)], x, y)
    green = material("leaf", color, 0.5)
    rng = np.random.default_rng(11)
    grown = [leaf(number * GOLDEN_ANGLE, share, rng) for number, share in enumerate(np.linspace(0.1, 1.0, 19))]
    grown += [ear(0.7 + number * GOLDEN_ANGLE, rng) for number in range(9)]
    place([grid_object(f"leaf {number}", grid, green, object_id) for number, grid in enumerate(grown)], x, y)


def leaf(azimuth: float, bow: float, rng: np.random.Generator) -> np.ndarray:
    """Return the vertex grid of a leaf: upright with ``bow`` 0, arching over the pot's rim with 1."""
    length = rng.uniform(0.9, 1.15)
    reach, top = length * (0.12 + 0.50 * bow), length * (0.80 - 0.28 * bow)
    path = [(0.02, 0.26), (0.2 * reach, 0.27 + 0.45 * top), (0.5 * reach, 0.27 + 0.85 * top)]
    path += [(0.8 * reach, 0.27 + top), (reach, 0.27 + (1.0 - 0.22 * bow) * top)]
    return tube(path, LEAF_WIDTHS, azimuth + rng.uniform(-0.2, 0.2), columns=12, flatness=0.1)


def ear(azimuth: float, rng: np.random.Generator) -> np.ndarray:
    """Return the vertex grid of a hair-like stem that ends in a small pointed ear."""
    reach, top = rng.uniform(0.2, 0.65), rng.uniform(0.85, 1.15)
    path = [(0.02, 0.26), (0.25 * reach, 0.6 * top), (0.6 * reach, 0.9 * top)]
    path += [(0.85 * reach, top), (0.93 * reach, 1.03 * top), (reach, 1.05 * top)]
    return tube(path, (0.005, 0.0045, 0.004, 0.004, 0.012, 0.001), azimuth, columns=12)


def add_basket(x: float, y: float, color, object_id: int = 0) -> None:
    """Add a basket: a solid bowl, a grille of wires round it and a thin handle; material ``basket``."""
    paint = material("basket", color, 0.4)
    bowl = [(0.0, 0.0), (0.20, 0.0), (0.24, 0.02), (0.27, 0.08), (0.28, 0.14), (0.26, 0.14), (0.22, 0.05), (0.0, 0.03)]
    wire = [(0.275, 0.13), (0.29, 0.28), (0.31, 0.44)]
    arch = np.linspace(0.0, math.pi, 9)
    handle = np.column_stack([0.31 * np.cos(arch), 0.44 + 0.48 * np.sin(arch)])
    grids = [lathe(bowl), ring(0.29, 0.28), ring(0.31, 0.44), tube(handle, HANDLE, 0.6, columns=12)]
    grids += [tube(wire, WIRE, azimuth, columns=12) for azimuth in np.linspace(0.0, 2.0 * math.pi, 20, endpoint=False)]
    place([grid_object(f"basket {number}", grid, paint, object_id) for number, grid in enumerate(grids)], x, y)


def ring(radius: float, height: float) -> np.ndarray:
    """Return the vertex grid of a level wire ring."""
    angle = np.linspace(0.0, 2.0 * math.pi, 9)
    return lathe(np.column_stack([radius + WIRE * np.cos(angle), height + WIRE * np.sin(angle)]))
