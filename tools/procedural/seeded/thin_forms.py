"""Things with a thin part on purpose: a solid body, and of the same paint what is one to six pixels wide in a photo.

Each is built at the origin, of size 1 or less, on z = 0; `wire` is the radius of its thin part at that size.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ..shapes import THIN_PART, box, grid_object, lathe, tube

WIRES = 0.005, 0.022  # least and most radius; some 140 pixels are a scene unit in a photo of 320
STRAP_FLATNESS = 0.35
STRAP_WIDENING = 1.6


def build_thin(form: str, rng: np.random.Generator, paint) -> list:
    """Return the objects of a thing of that form; the thin ones have the pass index `THIN_PART`."""
    least, most = np.log(WIRES)
    return BUILDERS[form](rng, paint, math.exp(rng.uniform(least, most)))


def _bucket(rng, paint, wire) -> list:
    """A bucket and its wire handle, upright or leaning."""
    foot, top, height = rng.uniform(0.18, 0.22), rng.uniform(0.26, 0.30), rng.uniform(0.42, 0.52)
    profile = [(0.0, 0.0), (foot, 0.0), (foot + 0.01, 0.02), (top, height), (top - 0.02, height), (foot, 0.06)]
    arch, rise = np.linspace(0.0, math.pi, 9), rng.uniform(0.32, 0.42)
    handle = np.column_stack([top * np.cos(arch), height - 0.02 + rise * np.sin(arch)])
    return [_turned([*profile, (0.0, 0.05)], paint), _thin(tube(handle, wire, 0.0, columns=12), paint)]


def _mug(rng, paint, wire) -> list:
    """A wide mug with a thin handle."""
    top, height = rng.uniform(0.26, 0.32), rng.uniform(0.45, 0.6)
    profile = [(0.0, 0.0), (0.22, 0.0), (0.25, 0.03), (top, 0.5 * height), (top, height), (top - 0.03, height)]
    reach = rng.uniform(0.14, 0.2)
    handle = [(top - 0.01, 0.88 * height), (top + 0.8 * reach, 0.84 * height), (top + reach, 0.5 * height)]
    handle += [(top + 0.7 * reach, 0.22 * height), (top - 0.01, 0.18 * height)]
    return [_turned([*profile, (0.0, 0.06)], paint), _thin(tube(handle, wire, 0.0, columns=12), paint)]


def _wheel(rng, paint, wire) -> list:
    """An upright bicycle wheel: tire and hub are solid, spokes thin."""
    thick, hub, middle = rng.uniform(0.045, 0.065), rng.uniform(0.06, 0.09), 0.5
    turn = np.linspace(0.0, 2 * math.pi, 33)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    rings = [(middle - thick) * circle + (0.0, middle), 0.5 * hub * circle + (0.0, middle)]
    solid = [
        grid_object("wheel", tube(rings[0], thick, 0.0), paint),
        grid_object("hub", tube(rings[1], hub, 0.0), paint),
    ]
    spokes = []
    for angle in np.linspace(0.0, 2 * math.pi, int(rng.integers(9, 15)), endpoint=False):
        along = np.array([math.cos(angle), math.sin(angle)])
        ends = [hub * along + (0.0, middle), (middle - thick) * along + (0.0, middle)]
        spokes.append(_thin(tube(ends, wire, 0.0, columns=12), paint))
    return solid + spokes


def _chair(rng, paint, wire) -> list:
    """Seat and back of a chair on four thin legs."""
    seat, height = rng.uniform(0.42, 0.5), rng.uniform(0.42, 0.5)
    solid = [
        box("seat", (seat, seat, 0.06), (0.0, 0.0, height), paint),
        box("back", (seat, 0.05, 0.4), (0.0, 0.5 * seat, height + 0.23), paint),
    ]
    reach, splay = 0.62 * seat, rng.uniform(0.0, 0.08)
    legs = [[(reach + splay, 0.0), (reach, height)]] * 4
    azimuths = math.pi / 4 + 0.5 * math.pi * np.arange(4)
    return solid + [_thin(tube(leg, wire, at, columns=12), paint) for leg, at in zip(legs, azimuths, strict=True)]


def _bag(rng, paint, wire) -> list:
    """A bag with two flat straps."""
    size = rng.uniform(0.5, 0.62), rng.uniform(0.2, 0.28), rng.uniform(0.42, 0.5)
    arch = np.linspace(0.0, math.pi, 9)
    strap = np.column_stack([0.3 * size[0] * np.cos(arch), size[2] - 0.02 + rng.uniform(0.3, 0.4) * np.sin(arch)])
    flat = tube(strap, STRAP_WIDENING * wire, 0.0, columns=12, flatness=STRAP_FLATNESS)
    moved = [flat + (0.0, side * 0.4 * size[1], 0.0) for side in (-1.0, 1.0)]
    return [box("bag", size, (0.0, 0.0, 0.5 * size[2]), paint), *(_thin(grid, paint) for grid in moved)]


def _cable(rng, paint, wire) -> list:
    """A round lamp base with cables that sink to the ground."""
    height = rng.uniform(0.42, 0.5)
    profile = [(0.0, 0.0), (0.2, 0.0), (0.28, 0.1), (0.3, 0.5 * height), (0.22, 0.85 * height), (0.0, height)]
    parts = [_turned(profile, paint)]
    for azimuth in rng.uniform(0.0, 2 * math.pi) + np.array([0.0, 2.2]):
        top = height + rng.uniform(0.05, 0.2)
        path = [(0.15, 0.9 * height), (0.3, top), (0.42, 0.6 * height), (0.48, 0.08), (0.55, wire), (0.66, wire)]
        parts.append(_thin(tube(path, wire, azimuth, columns=12), paint))
    return parts


def _stalks(rng, paint, wire) -> list:
    """A pot with bare stalks that end in small heads."""
    profile = [(0.0, 0.0), (0.18, 0.0), (0.2, 0.02), (0.27, 0.3), (0.25, 0.31), (0.0, 0.27)]
    parts = [_turned(profile, paint)]
    for number in range(int(rng.integers(5, 9))):
        reach, top = rng.uniform(0.1, 0.38), rng.uniform(0.75, 1.0)
        path = [(0.03, 0.26), (0.3 * reach, 0.6 * top), (0.7 * reach, 0.9 * top), (reach, top)]
        azimuth = number * math.pi * (3.0 - math.sqrt(5.0))
        parts.append(_thin(tube(path, wire, azimuth, columns=12), paint))
        head = lathe([(0.0, -0.045), (0.035, -0.02), (0.04, 0.01), (0.0, 0.05)], columns=24)
        at = np.array([reach * math.cos(azimuth), reach * math.sin(azimuth), top])
        parts.append(grid_object("head", head + at, paint))
    return parts


def _turned(profile, paint):
    return grid_object("turned", lathe(profile), paint)


def _thin(grid: np.ndarray, paint):
    return grid_object("thin", grid, paint, THIN_PART)


BUILDERS: dict[str, Callable] = {
    "bucket": _bucket,
    "mug": _mug,
    "wheel": _wheel,
    "chair": _chair,
    "bag": _bag,
    "cable": _cable,
    "stalks": _stalks,
}
