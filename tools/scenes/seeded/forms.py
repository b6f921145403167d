"""The drawn things in Blender. Each form is built at the origin, of size 1 or less, on z = 0."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from mathutils import Matrix

from ..materials import bands, checks, clouds, material, rise
from ..shapes import box, grid_object, lathe, tube
from .scene import Paint, Thing

GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
WIRE = 0.011


def add_thing(thing: Thing) -> None:
    """Add a thing, all of one material that has its name."""
    offset = np.random.default_rng((thing.proportions, 1)).uniform(0, 0.3)  # the same on twins
    paint, rng = _material(thing.name, thing.paint, offset), np.random.default_rng(thing.proportions)
    moved = Matrix.Translation(thing.position) @ Matrix.Rotation(thing.azimuth, 4, "Z") @ Matrix.Scale(thing.size, 4)
    for part in BUILDERS[thing.form](rng, paint):
        part.name, part.pass_index = thing.name, thing.object_id
        part.matrix_world = moved @ part.matrix_world


def _material(name: str, paint: Paint, offset: float):
    patterns = {
        "bands": bands(0.3, offset),
        "checks": checks(4, 0.4),
        "clouds": clouds(6.0, 1.0),
        "rise": rise(0.15, 0.6),
    }
    second = paint.colors[1] if len(paint.colors) > 1 else None
    made = material(name, paint.colors[0], paint.roughness, second, patterns.get(paint.pattern))
    if paint.translucency:
        shader = next(node for node in made.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Subsurface Weight"].default_value = paint.translucency
        shader.inputs["Subsurface Scale"].default_value = 0.1
    return made


def _vase(rng, paint) -> list:
    """A slender turned shape with a neck, open above."""
    foot, belly, neck = rng.uniform(0.12, 0.2), rng.uniform(0.22, 0.32), rng.uniform(0.07, 0.14)
    waist = rng.uniform(0.3, 0.55)
    outside = [(0.0, 0.0), (foot, 0.0), (foot + 0.02, 0.02), (belly, waist), (neck, 0.8), (neck + 0.05, 1.0)]
    return [_turned(outside + [(neck + 0.03, 0.99), (neck - 0.03, 0.8), (0.0, 0.7)], paint)]


def _bowl(rng, paint) -> list:
    """A wide open bowl on a foot."""
    foot, height = rng.uniform(0.15, 0.25), rng.uniform(0.28, 0.42)
    outside = [(0.0, 0.0), (foot, 0.0), (foot, 0.04), (0.4, 0.6 * height), (0.5, height)]
    return [_turned(outside + [(0.47, height), (0.36, 0.6 * height), (0.0, 0.1)], paint)]


def _gourd(rng, paint) -> list:
    """A ribbed round fruit."""
    height = rng.uniform(0.5, 0.85)
    profile = [(0.0, 0.03), (0.2, 0.0), (0.42, 0.2 * height), (0.5, 0.5 * height), (0.4, 0.82 * height)]
    grid = lathe([*profile, (0.12, height), (0.0, 0.92 * height)], int(rng.integers(0, 11)), rng.uniform(0.03, 0.2))
    return [grid_object("gourd", grid, paint)]


def _block(rng, paint) -> list:
    """A box, or two stacked."""
    low = (rng.uniform(0.4, 0.9), rng.uniform(0.3, 0.6), rng.uniform(0.2, 0.45))
    parts = [box("block", low, (0.0, 0.0, 0.5 * low[2]), paint)]
    if rng.random() < 0.6:
        high = (low[0] * rng.uniform(0.3, 0.7), low[1] * rng.uniform(0.5, 0.9), 0.75 - low[2])
        parts.append(box("block", high, (rng.uniform(-0.1, 0.1), 0.0, low[2] + 0.5 * high[2]), paint))
    return parts


def _ring(rng, paint) -> list:
    """An upright ring."""
    thick = rng.uniform(0.05, 0.12)
    angle = np.linspace(-0.5 * math.pi, 1.5 * math.pi, 17)
    path = np.column_stack([(0.5 - thick) * np.cos(angle), 0.5 + (0.5 - thick) * np.sin(angle)])
    return [grid_object("ring", tube(path, thick, 0.0, columns=32), paint)]


def _stone(rng, paint) -> list:
    """A smooth lump without symmetry."""
    grid = lathe([(0.0, 0.0), (0.3, 0.01), (0.42, 0.2), (0.36, 0.45), (0.15, 0.58), (0.0, 0.6)])
    lumps = sum(0.1 * np.sin(grid @ rng.normal(0, 5, 3) + rng.uniform(0, 6)) for _ in range(3))
    return [grid_object("stone", grid * (1 + lumps[..., None] * (grid[..., 2:] > 0.005)), paint)]


def _cup(rng, paint) -> list:
    """A cup with a handle."""
    top, height = rng.uniform(0.2, 0.28), rng.uniform(0.5, 0.75)
    outside = [(0.0, 0.0), (0.18, 0.0), (0.2, 0.03), (top, 0.5 * height), (top, height)]
    cup = _turned(outside + [(top - 0.03, height), (top - 0.04, 0.5 * height), (0.0, 0.08)], paint)
    handle = [(top - 0.02, 0.85 * height), (top + 0.12, 0.8 * height), (top + 0.13, 0.4 * height)]
    handle.append((top - 0.02, 0.25 * height))
    return [cup, grid_object("cup", tube(handle, 0.035, 0.0), paint)]


def _plant(rng, paint) -> list:
    """Leaves with pointed tips that rise from one spot and arch over."""
    count, width = int(rng.integers(9, 22)), rng.uniform(0.02, 0.06)
    parts = []
    for number, bow in enumerate(np.linspace(0.1, 1.0, count)):
        reach, top = 0.12 + 0.3 * bow, rng.uniform(0.85, 1.0) - 0.4 * bow
        path = [(0.01, 0.0), (0.25 * reach, 0.5 * top), (0.6 * reach, 0.95 * top), (reach, top * (1 - 0.2 * bow))]
        blade = tube(path, (0.4 * width, width, width, 0.002), number * GOLDEN_ANGLE, columns=12, flatness=0.12)
        parts.append(grid_object("plant", blade, paint))
    return parts


def _cage(rng, paint) -> list:
    """Upright wires between three rings."""
    rings = [_wire_ring(0.36, height) for height in (0.02, 0.5, 0.94)]
    azimuths = np.linspace(0, 2 * math.pi, int(rng.integers(10, 18)), endpoint=False)
    rods = [tube([(0.36, 0.0), (0.36, 0.5), (0.36, 0.95)], WIRE, azimuth, columns=10) for azimuth in azimuths]
    return [grid_object("cage", grid, paint) for grid in rings + rods]


def _wire_ring(radius: float, height: float) -> np.ndarray:
    angle = np.linspace(0, 2 * math.pi, 9)
    return lathe(np.column_stack([radius + WIRE * np.cos(angle), height + WIRE * np.sin(angle)]))


def _turned(profile, paint):
    return grid_object("turned", lathe(profile), paint)


BUILDERS: dict[str, Callable] = {
    "vase": _vase,
    "bowl": _bowl,
    "gourd": _gourd,
    "block": _block,
    "ring": _ring,
    "stone": _stone,
    "cup": _cup,
    "plant": _plant,
    "cage": _cage,
}
