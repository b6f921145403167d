"""The query `show`: the recolored picture of any camera with render passes such as alpha, depth and mattes."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.transforms import camera_from_json
from ...errors import BadRequest
from ...palettes.edge_shape import active_edges
from .arrays import write_arrays
from .options import edit_of, fades_of, require_option
from .session import Session

if TYPE_CHECKING:
    from ...palettes.palette import Edit
    from ...recolor.frames import Frame
    from ...recolor.model import Model

PASSES = ("color", "alpha", "depth", "cryptomatte", "weights", "seen")
BAND_RAYS = 1 << 14  # rays of the field between two checks for a later query: half a second


def show(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Render a camera, without its lens distortion, with an edit; from splats where they are learned.

    Options: `project`; `camera`, as a frame of a CAMERAS.json; `edit`, as edit.json, by default none; `passes`, a list of
    `PASSES`, by default the color; `cryptomatte`, the prefix of its layers' names; `unseen`, see `fades_of`.

    color: [H, W, 3] sRGB in [0, 1]; with the pass alpha straight (not premultiplied), without the background.
    alpha: [H, W] in [0, 1], the scene's opacity.
    depth: [H, W] along the optical axis, world units; 0 where the opacity is below one half.
    cryptomatte: [L, H, W, 4], layers of two pairs of id and coverage.
    weights: [K, M, H, W] in [0, 1], of each object's palette entries; M is 0 before palettes are learned.
    seen: [H, W] in [0, 1], how well photos support the splats shown there; 1 for voxels.
    Mattes and weights follow the edit's edges.

    Returns:
        `pixels`, a file of consecutive arrays, for the caller to delete. `arrays`, the `shape`, `dtype` and `offset` in
        bytes of each. `size`, width and height. `metadata`, of Cryptomatte. `seconds` of rendering.

    Raises:
        KarfError: Nothing is learned, or an option is wrong.
        Cancelled: A later query of this kind is waiting.
    """
    passes = options.get("passes") or ["color"]
    if not isinstance(passes, list) or not set(passes) <= set(PASSES):
        raise BadRequest(f"There are no passes {passes!r:.200}.", f"Use some of: {', '.join(PASSES)}.")
    camera = camera_from_json(require_option(options, "camera", dict), "the query").without_distortion()
    model = session.model(require_option(options, "project", str))
    edit, fades = edit_of(model, options.get("edit")), fades_of(options)
    start = time.perf_counter()
    if passes == ["color"]:
        arrays = {"color": _color(session, model, camera, edit, fades)}
    else:
        frame = _frame(session, model, camera, fades)
        color = frame.base
        if edit is not None:
            color, frame = model.composite(frame, edit), model.with_edges(frame, edit.edges)
        arrays = {"color": color} | _passes(model, camera, frame, passes)
        if "alpha" in passes:
            from ...recolor.frames import remove_background

            arrays["color"] = remove_background(color, frame.opacity, model.render_background(camera))[..., :3]
    answer = {"size": [camera.width, camera.height], "seconds": time.perf_counter() - start}
    if "cryptomatte" in passes:
        from ...export.cryptomatte import NAME, header

        answer["metadata"] = header(model.objects, options.get("cryptomatte") or NAME)
    return answer | write_arrays(session.file("show.pixels"), arrays)


def _bands(model: Model, camera: Camera) -> list[Camera]:
    """Return the whole camera for splats, else bands of rows, so that a later query can interrupt."""
    from ...recolor.frames import split_bands  # needs torch

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
    """Return the requested passes except the color."""
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
