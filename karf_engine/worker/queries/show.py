"""The recolored picture of any camera as pixels, and what a renderer gives with it: alpha, depth and mattes."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.transforms_frames import camera_from_json
from ...errors import BadRequest
from ...palettes.edge_shape import shaped_edges
from .arrays import write_arrays
from .options import edit_of, fade, needed
from .session import Session

if TYPE_CHECKING:
    from ...palettes.palette import Edit
    from ...recolor.frames import Frame
    from ...recolor.model import Model

PASSES = ("color", "alpha", "depth", "cryptomatte", "weights", "seen")
BAND_RAYS = 1 << 14  # of the field, between two looks at whether another picture is wanted by now: half a second


def show(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Render a camera, whose lens distortion is left out, with an edit; splats where they are learned.

    Options: `project`; `camera`, as a frame of a CAMERAS.json; `edit`, as edit.json, by default none; `passes`, a list of
    `PASSES`, by default the color; `cryptomatte`, what the names of its layers begin with; `unseen`, see `fade`.

    color: [H, W, 3] sRGB in [0, 1]; with alpha it is straight, without what lies behind the scene.
    alpha: [H, W] in [0, 1], how much of each pixel the scene covers.
    depth: [H, W] along the optical axis, world units; 0 where the scene covers less than half of the pixel.
    cryptomatte: [L, H, W, 4], layers of two pairs of id and coverage.
    weights: [K, M, H, W] in [0, 1], of each object's palette entries; M is 0 before palettes are learned.
    seen: [H, W] in [0, 1], how well photos know what splats show there; 1 of voxels.
    Mattes and weights end where the edit's edges end.

    Returns:
        `pixels`, a file of arrays one behind the other; the caller's to delete. `arrays`, of each its `shape`, `dtype` and
        `offset` in bytes. `size`, width and height. `metadata`, of Cryptomatte. `seconds` that rendering took.

    Raises:
        KarfError: Nothing is learned, or an option is wrong.
        Cancelled: Another picture is wanted by now.
    """
    passes = options.get("passes") or ["color"]
    if not isinstance(passes, list) or not set(passes) <= set(PASSES):
        raise BadRequest(f"There are no passes {passes!r:.200}.", f"Use some of: {', '.join(PASSES)}.")
    camera = camera_from_json(needed(options, "camera", dict), "the query").without_distortion()
    model = session.model(needed(options, "project", str))
    edit = edit_of(model, options.get("edit"))
    fade(model, options)
    begun = time.perf_counter()
    if passes == ["color"]:
        arrays = {"color": _color(session, model, camera, edit)}
    else:
        frame = _frame(session, model, camera)
        color = _of_frame(model, frame, edit)
        if edit is not None:
            frame = model.with_edges(frame, edit.edges)
        arrays = {"color": color} | _passes(model, camera, frame, passes)
        if "alpha" in passes:
            arrays["color"] = _uncovered(arrays["color"], frame, model.behind(camera))
    answer = {"size": [camera.width, camera.height], "seconds": time.perf_counter() - begun}
    if "cryptomatte" in passes:
        from ...export.cryptomatte import NAME, header

        answer["metadata"] = header(model.objects, options.get("cryptomatte") or NAME)
    return answer | write_arrays(session.file("show.pixels"), arrays)


def _bands(model: Model, camera: Camera) -> list[Camera]:
    """The camera whole where it is made of splats, else in bands of rows, between which the caller is heard."""
    from ...recolor.frames import bands_of  # needs torch, without which some kinds can be answered

    return bands_of(camera, 1, BAND_RAYS if model.splats is None else camera.width * camera.height)


def _color(session: Session, model: Model, camera: Camera, edit: Edit | None) -> np.ndarray:
    if model.splats is None and edit is not None and shaped_edges(edit.edges):  # edges reach from band to band
        return model.composite(_frame(session, model, camera), edit)
    pictures = []
    for band in _bands(model, camera):
        session.check()
        pictures.append(model.render(band).base if edit is None else model.shown(band, edit))
    return np.concatenate(pictures)


def _frame(session: Session, model: Model, camera: Camera) -> Frame:
    from ...recolor.frames import joined

    frames = []
    for band in _bands(model, camera):
        session.check()
        frames.append(model.render(band))
    return frames[0] if len(frames) == 1 else joined(frames)


def _of_frame(model: Model, frame: Frame, edit: Edit | None) -> np.ndarray:
    return frame.base if edit is None else model.composite(frame, edit)


def _uncovered(color: np.ndarray, frame: Frame, behind: np.ndarray) -> np.ndarray:
    from ...recolor.frames import with_alpha

    return with_alpha(color, frame.opacity, behind)[..., :3]


def _passes(model: Model, camera: Camera, frame: Frame, passes: list[str]) -> dict[str, np.ndarray]:
    """What is asked for beside the color."""
    found = {}
    if "alpha" in passes:
        found["alpha"] = frame.opacity
    if "depth" in passes:
        found["depth"] = np.where(frame.opacity >= 0.5, frame.depth, 0)  # what little there is floats anywhere
    if "cryptomatte" in passes:
        from ...export.cryptomatte import channels

        planes = np.stack(list(channels(model.objects, frame.probabilities).values()), -1)
        found["cryptomatte"] = np.moveaxis(planes.reshape(camera.height, camera.width, -1, 4), 2, 0)
    if "weights" in passes:
        none = np.zeros((len(model.objects), 0, camera.height, camera.width))
        found["weights"] = none if frame.palette_weights is None else frame.palette_weights
    if "seen" in passes:
        found["seen"] = np.ones(frame.opacity.shape, np.float32) if frame.seen is None else frame.seen
    return found
