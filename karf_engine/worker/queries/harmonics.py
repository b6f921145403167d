"""The query `harmonics`: the colors of the recolored Gaussians, for programs that render the Gaussians themselves."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import BadRequest
from .arrays import write_arrays
from .options import edit_of, require_option
from .session import Session

if TYPE_CHECKING:
    from ...recolor.model import Model
    from ...splats.gaussians import Gaussians


def harmonics(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Return the spherical harmonics of the scene's splats with an edit.

    Options: `project`; `edit`, as edit.json, by default none; `points`, an object of another program that displays the
    splats: its number of points `count`, and the `positions` [m][3] of some `rows`. The harmonics are then rotated like
    the object.

    Returns:
        `pixels` and `arrays`, as of `show`: `harmonics` [n, 3 K] float32, in the order of the splats' table, red, green and
        blue of each harmonic. `n_solid`: the number of Gaussians before the background's. `seconds` of computation.

    Raises:
        KarfError: The project has no splats, an option is wrong, or the points do not match the splats.
        Cancelled: A later query of this kind is waiting.
    """
    model = session.model(require_option(options, "project", str))
    session.check()
    begun = time.perf_counter()
    gaussians = _splats(model, options.get("edit"))
    if options.get("points") is None:
        colors = _colors(gaussians)
    else:
        colors = _rotated(gaussians, require_option(options, "points", dict))
    answer = {"n_solid": gaussians.n_foreground, "seconds": time.perf_counter() - begun}
    return answer | write_arrays(session.file("harmonics.pixels"), {"harmonics": colors})


def _splats(model: Model, edit: Any) -> Gaussians:
    if model.splats is None:
        raise BadRequest(
            "{folder} shows no splats.",
            "Learn splats first; they need the package numba and render.source=splats.",
            folder=model.project.folder,
        )
    wanted = None if edit is None else edit_of(model, edit)
    return model.splats if wanted is None else model.recolored_splats(wanted)


def _colors(gaussians: Gaussians) -> np.ndarray:
    from ...splats.kernels.arrays import COLOR

    return gaussians.table[:, COLOR:]


def _rotated(gaussians: Gaussians, points: dict[str, Any]) -> np.ndarray:
    """Return the harmonics rotated like an object's points."""
    from ...splats.similarity import estimate_rotation, rotate_harmonics

    count = require_option(points, "count", int)
    if count not in (len(gaussians), gaussians.n_foreground):
        raise BadRequest(
            "The object has {count} points, and the scene {n} splats, {n_solid} of them without the background.",
            "Choose an object that was imported from this scene's splats.",
            count=count,
            n=len(gaussians),
            n_solid=gaussians.n_foreground,
        )
    try:
        rows, positions = np.array(points["rows"], np.intp), np.array(points["positions"], np.float64)
        turn = estimate_rotation(gaussians.table[rows, :3], positions)
    except (KeyError, TypeError, IndexError, ValueError) as error:
        raise BadRequest(
            "The object's points are not where the scene's splats are.",
            "Choose an object that was imported from this scene's splats, and whose points were not moved.",
        ) from error
    return rotate_harmonics(_colors(gaussians)[:count], turn)
