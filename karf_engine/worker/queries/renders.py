"""Queries that render: edit planes, pictures with passes, and colors of Gaussians."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.transforms import camera_from_json
from ...errors import BadRequest
from ...io.arguments import check_choice, check_number
from ...palettes.compositing import Planes, write_planes
from ...palettes.edge_shape import active_edges
from ...palettes.palette import edit_from_json
from .session import Session, check_option, query

if TYPE_CHECKING:
    from ...palettes.palette import Edit
    from ...recolor.frames import Frame
    from ...recolor.model import Model
    from ...splats.gaussians import Gaussians

MAX_SIDE = 8192  # pixels of a preview
COARSE_SIDE = 256  # pixels; pictures up to this long side need fewer samples per ray
BAND_RAYS = 1 << 14  # rays of the field between two checks for a later query: half a second
PASSES = ("color", "alpha", "depth", "cryptomatte", "weights", "seen")


@query
def preview(session: Session, project: str, camera: dict, long_side: int, unseen: str | None = None) -> dict[str, Any]:
    """Render a camera, without its lens distortion, as edit planes; before palettes are learned they have no swatches.

    `camera` is a frame of a CAMERAS.json, `long_side` that of the picture in pixels, `unseen` (`faded` or `shown`) what
    becomes of splats that no photo shows; by default the setting `render.unseen` counts. Returns `planes`, the file, for
    the caller to delete, and `size`, width and height.
    """
    check_number("The option long_side", long_side, 1, MAX_SIDE)
    wanted = camera_from_json(camera, "the query").without_distortion().reduced(long_side)
    model = session.model(project)
    planes = _planes(session, model, wanted, _fades(unseen))
    path = session.file("preview.npz")
    write_planes(path, planes)
    return {"planes": str(path), "size": [wanted.width, wanted.height]}


@query
def show(
    session: Session,
    project: str,
    camera: dict,
    edit: dict | None = None,
    passes: Any = None,
    cryptomatte: str | None = None,
    unseen: str | None = None,
) -> dict[str, Any]:
    """Render a camera, without its lens distortion, with an edit; from splats where they are learned.

    `camera` and `unseen` are those of `preview`, `edit` is edit.json, `passes` a list of `PASSES` (default: the color), and
    `cryptomatte` the prefix of its layers' names. Mattes and weights follow the edit's edges.

    color: [H, W, 3] sRGB in [0, 1]; with the pass alpha straight (not premultiplied), without the background.
    alpha: [H, W] in [0, 1], the scene's opacity.
    depth: [H, W] along the optical axis, world units; 0 where the opacity is below one half.
    cryptomatte: [L, H, W, 4], layers of two pairs of id and coverage.
    weights: [K, M, H, W] in [0, 1], of each object's palette entries; M is 0 before palettes are learned.
    seen: [H, W] in [0, 1], how well photos support the splats shown there; 1 for voxels.

    Returns `pixels` and `arrays` of `Session.write_arrays`, `size`, `metadata` of Cryptomatte, and `seconds` of rendering.
    """
    passes = passes or ["color"]
    if not isinstance(passes, list) or not set(passes) <= set(PASSES):
        raise BadRequest(f"There are no passes {passes!r:.200}.", f"Use some of: {', '.join(PASSES)}.")
    view = camera_from_json(camera, "the query").without_distortion()
    model = session.model(project)
    wanted, fades = _edit(model, edit), _fades(unseen)
    start = time.perf_counter()
    if passes == ["color"]:
        arrays = {"color": _color(session, model, view, wanted, fades)}
    else:
        frame = _frame(session, model, view, fades)
        color = frame.base
        if wanted is not None:
            color, frame = model.composite(frame, wanted), model.with_edges(frame, wanted.edges)
        arrays = {"color": color} | _passes(model, view, frame, passes)
        if "alpha" in passes:
            from ...recolor.frames import remove_background

            arrays["color"] = remove_background(color, frame.opacity, model.render_background(view))[..., :3]
    answer = {"size": [view.width, view.height], "seconds": time.perf_counter() - start}
    if "cryptomatte" in passes:
        from ...export.cryptomatte import NAME, header

        answer["metadata"] = header(model.objects, cryptomatte or NAME)
    return answer | session.write_arrays("show.pixels", arrays)


@query
def harmonics(session: Session, project: str, edit: dict | None = None, points: dict | None = None) -> dict[str, Any]:
    """Return the spherical harmonics of the scene's splats with an edit, for programs that render the Gaussians themselves.

    `points` is an object of such a program: its number of points `count`, and the `positions` [m][3] of some `rows`. The
    harmonics are then rotated like the object.

    Returns `pixels` and `arrays` of `Session.write_arrays`: `harmonics` [n, 3 K] float32, in the order of the splats' table,
    red, green and blue of each harmonic. `n_solid` is the number of Gaussians before the background's.
    """
    from ...splats.kernels.arrays import COLOR  # needs torch

    model = session.model(project)
    session.check()
    begun = time.perf_counter()
    gaussians = _splats(model, edit)
    colors = gaussians.table[:, COLOR:]
    if points is not None:
        colors = _rotated(gaussians, colors, points)
    answer = {"n_solid": gaussians.n_foreground, "seconds": time.perf_counter() - begun}
    return answer | session.write_arrays("harmonics.pixels", {"harmonics": colors})


def _fades(unseen: str | None) -> bool | None:
    """Return whether splats that no photo shows fade; None: by the project's setting."""
    if not unseen:
        return None
    check_choice("unseen", unseen, ("faded", "shown"))
    return unseen == "faded"


def _edit(model: Model, content: dict | None) -> Edit | None:
    """Return the edit of a query; None before palettes are learned."""
    if not model.palettes:
        return None
    return edit_from_json(content or {}, "the query", model.palettes, model.edit().compositing)


def _planes(session: Session, model: Model, camera: Camera, fades: bool | None) -> Planes:
    # these need torch, without which some kinds of queries can be answered
    from ...recolor.field_rendering import MASK_SAMPLES, WEIGHT_SAMPLES, frame_of
    from ...recolor.frames import edit_planes, split_bands, stack_bands

    session.check()
    if model.splats is not None:
        return edit_planes(model.render(camera, fades=fades), model.objects)
    samples = MASK_SAMPLES if max(camera.width, camera.height) <= COARSE_SIDE else WEIGHT_SAMPLES
    frames = []
    for band in split_bands(camera, 1, BAND_RAYS):
        session.check()
        picture = model.scene.render(band, samples)
        frames.append(frame_of(model, picture, picture.color.cpu().numpy(), from_field=True))
    return edit_planes(stack_bands(frames), model.objects)


def _bands(model: Model, camera: Camera) -> list[Camera]:
    """Return the whole camera for splats, else bands of rows, so that a later query can interrupt."""
    from ...recolor.frames import split_bands

    return split_bands(camera, 1, BAND_RAYS if model.splats is None else camera.width * camera.height)


def _color(session: Session, model: Model, camera: Camera, edit: Edit | None, fades: bool | None) -> np.ndarray:
    if model.splats is None and edit is not None and active_edges(edit.edges):  # edges reach from band to band
        return model.composite(_frame(session, model, camera, fades), edit)
    pictures = []
    for band in _bands(model, camera):
        session.check()
        if edit is None:
            pictures.append(model.render(band, fades=fades).base)
        else:
            pictures.append(model.render_recolored(band, edit, fades=fades))
    return np.concatenate(pictures)


def _frame(session: Session, model: Model, camera: Camera, fades: bool | None) -> Frame:
    from ...recolor.frames import stack_bands

    frames = []
    for band in _bands(model, camera):
        session.check()
        frames.append(model.render(band, fades=fades))
    return frames[0] if len(frames) == 1 else stack_bands(frames)


def _passes(model: Model, camera: Camera, frame: Frame, passes: list[str]) -> dict[str, np.ndarray]:
    found = {}
    if "alpha" in passes:
        found["alpha"] = frame.opacity
    if "depth" in passes:
        found["depth"] = np.where(frame.opacity >= 0.5, frame.depth, 0)
    if "cryptomatte" in passes:
        from ...export.cryptomatte import channels

        planes = np.stack(list(channels(model.objects, frame.probabilities).values()), -1)
        found["cryptomatte"] = np.moveaxis(planes.reshape(camera.height, camera.width, -1, 4), 2, 0)
    if "weights" in passes:
        empty = np.zeros((len(model.objects), 0, camera.height, camera.width))
        found["weights"] = empty if frame.palette_weights is None else frame.palette_weights
    if "seen" in passes:
        found["seen"] = np.ones(frame.opacity.shape, np.float32) if frame.visibility is None else frame.visibility
    return found


def _splats(model: Model, edit: dict | None) -> Gaussians:
    if model.splats is None:
        raise BadRequest(
            "{folder} shows no splats.",
            "Learn splats first; they need the package numba and render.source=splats.",
            folder=model.project.folder,
        )
    wanted = None if edit is None else _edit(model, edit)
    return model.splats if wanted is None else model.recolored_splats(wanted)


def _rotated(gaussians: Gaussians, colors: np.ndarray, points: dict[str, Any]) -> np.ndarray:
    """Return the harmonics rotated like an object's points."""
    from ...splats.similarity import estimate_rotation, rotate_harmonics

    count = points.get("count")
    check_option("count", count, int)
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
    return rotate_harmonics(colors[:count], turn)
