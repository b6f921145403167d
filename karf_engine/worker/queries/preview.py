"""The picture of any camera as edit planes: a coarse one in a fraction of a second, finer ones while it stands still."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...capture.camera import Camera
from ...capture.transforms_frames import camera_from_json
from ...errors import BadRequest
from ...palettes.compositing import Planes, write_planes
from .options import fade, needed
from .session import Session

if TYPE_CHECKING:
    from ...recolor.model import Model

SIDES = range(1, 8193)  # pixels that a preview may be long
COARSE_SIDE = 256  # pixels: up to here fewer samples a ray do
BAND_RAYS = 1 << 14  # rendered between two looks at whether another camera is wanted by now: half a second


def preview(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Render a camera, whose lens distortion is left out, from what is learned of a project now.

    Options: `project`; `camera`, as a frame of a CAMERAS.json; `long_side`, the pixels to which its picture is reduced;
    `unseen`, see `fade`.
    Before palettes are learned the planes have no swatches: the picture is the scene as learned.

    Returns:
        `planes`, the file; the caller's to delete. `size`, width and height.

    Raises:
        KarfError: Nothing is learned, or an option is wrong.
        Cancelled: Another camera is wanted by now.
    """
    long_side = needed(options, "long_side", int)
    if long_side not in SIDES:
        raise BadRequest(f"The option long_side = {long_side} is out of range.", f"Allowed: 1 to {SIDES[-1]}.")
    camera = camera_from_json(needed(options, "camera", dict), "the query").without_distortion().reduced(long_side)
    model = session.model(needed(options, "project", str))
    fade(model, options)
    planes = _planes(session, model, camera)
    path = session.file("preview.npz")
    write_planes(path, planes)
    return {"planes": str(path), "size": [camera.width, camera.height]}


def _planes(session: Session, model: Model, camera: Camera) -> Planes:
    # these need torch, without which some kinds of queries can be answered
    from ...recolor.field_rendering import MASK_SAMPLES, WEIGHT_SAMPLES, frame_of
    from ...recolor.frames import bands_of, joined, planes_of

    session.check()
    if model.splats is not None:
        return planes_of(model.render(camera), model.objects)
    samples = MASK_SAMPLES if max(camera.width, camera.height) <= COARSE_SIDE else WEIGHT_SAMPLES
    frames = []
    for band in bands_of(camera, 1, BAND_RAYS):
        session.check()
        picture = model.scene.render(band, samples)
        frames.append(frame_of(model, picture, picture.color.cpu().numpy(), model.recoloring is not None))
    return planes_of(joined(frames), model.objects)
