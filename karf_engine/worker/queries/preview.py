"""The query `preview`: edit planes of any camera, coarse ones in a fraction of a second."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...capture.camera import Camera
from ...capture.transforms_frames import camera_from_json
from ...errors import BadRequest
from ...palettes.compositing import Planes, write_planes
from .options import fades_of, require_option
from .session import Session

if TYPE_CHECKING:
    from ...recolor.model import Model

SIDES = range(1, 8193)  # allowed long sides, pixels
COARSE_SIDE = 256  # pixels; pictures up to this long side need fewer samples per ray
BAND_RAYS = 1 << 14  # rays between two checks for a later query: half a second


def preview(session: Session, options: dict[str, Any]) -> dict[str, Any]:
    """Render a camera, without its lens distortion, as edit planes; before palettes are learned they have no swatches.

    Options: `project`; `camera`, as a frame of a CAMERAS.json; `long_side`, the picture's long side in pixels; `unseen`,
    see `fades_of`.

    Returns:
        `planes`, the file, for the caller to delete. `size`, width and height.

    Raises:
        KarfError: Nothing is learned, or an option is wrong.
        Cancelled: A later query of this kind is waiting.
    """
    long_side = require_option(options, "long_side", int)
    if long_side not in SIDES:
        raise BadRequest(f"The option long_side = {long_side} is out of range.", f"Allowed: 1 to {SIDES[-1]}.")
    camera = camera_from_json(require_option(options, "camera", dict), "the query")
    camera = camera.without_distortion().reduced(long_side)
    model = session.model(require_option(options, "project", str))
    planes = _planes(session, model, camera, fades_of(options))
    path = session.file("preview.npz")
    write_planes(path, planes)
    return {"planes": str(path), "size": [camera.width, camera.height]}


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
