"""Queries about captured photos: advice, the light of a color chart, and masks. Their files are for the caller to delete."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...capture.camera import Camera
from ...capture.capture import View
from ...capture.distortion import undistort_points
from ...capture.training_images import read_photo_of_view
from ...capture.transforms import camera_from_json
from ...compute.progress import Progress
from ...errors import BadRequest
from ...io.files import checksum
from ...io.images import alpha_composite, resize, write_png
from ...project import Project
from ...project.contents import read_capture, settings_for
from ...project.volumes import read_volumes
from .session import Session, query

if TYPE_CHECKING:
    from ...segmentation.coarse_masks import CoarseMask
    from ...segmentation.labels import CorrectionSession


@query
def chart(session: Session, photo: str) -> dict[str, Any]:
    """Measure the light by a color chart in a photo; return `ReferenceLight.matrix` and `ChartFit.mean_residual`."""
    from ...commands.calibration import fit_chart

    fit = fit_chart(Path(photo), None)
    return {"light": fit.light.matrix.ravel().tolist(), "left": fit.mean_residual}


@query
def inspect(
    session: Session, capture: str, holdout: int | None = None, masks: str | None = None, without: list | None = None
) -> dict[str, Any]:
    """Return advice about a capture before learning, with options of the command: `advice`, `is_poor`, and `picture`.

    `advice` has the sentence and the findings (`Message.to_json`); `picture` is a map of where more photos would help.
    `blurred` are the names of blurred photos.
    """
    from ...capture.advice import draw_map
    from ...commands.inspect import run
    from ...commands.options import InspectOptions

    options = InspectOptions.from_json(
        {"capture": capture, "holdout": holdout, "masks": masks, "without": without or ()}
    )
    advice = run(options, lambda *_, **__: None, session.is_superseded)
    picture = session.file("more_photos.png")
    draw_map(picture, advice)
    messages = [each.to_json() for each in (advice.sentence, *advice.findings)]
    found = {"advice": messages, "is_poor": advice.is_poor, "blurred": advice.inspection.blurred}
    return found | {"picture": str(picture)}


@query
def photo(session: Session, photo: str, camera: dict) -> dict[str, Any]:
    """Write a `photo` that the asker cannot read as its camera sees it: an 8-bit PNG in sRGB, upright, over white."""
    path = Path(photo)
    pixels = read_photo_of_view(View(path.name, path.name, camera_from_json(camera, "the query"), path, "train"))
    copy = session.file("photo.png")
    write_png(copy, alpha_composite(pixels[..., :3], pixels[..., 3] if pixels.shape[-1] == 4 else None))
    return {"photo": str(copy)}


@query
def propose(
    session: Session, capture: str = "", view: str = "", prompts: dict | None = None, weights: str | None = None
) -> dict[str, Any]:
    """Write the `mask` of an object in one photo, an 8-bit PNG, from `prompts` (see `Prompts.from_json`).

    `weights` is the folder of a Segment Anything model. The last photo is cached.
    """
    from ...segmentation.marking.prompts import Prompts
    from ...segmentation.marking.proposals import make_marker

    missing = [name for name, value in (("capture", capture), ("view", view), ("prompts", prompts)) if not value]
    if missing:
        raise BadRequest(f"A mask was asked for without {' and '.join(missing)}.", "Give capture, view and prompts.")
    folder = Path(capture)
    version = folder, view, weights, folder.stat().st_mtime_ns
    marker = session.cached("marker", version, lambda: make_marker(folder, view, weights))
    path = session.file("mask.png")
    write_png(path, marker.propose(Prompts.from_json(prompts)))
    return {"mask": str(path)}


@query
def masks(session: Session, project: str, view: str) -> dict[str, Any]:
    """Write each object's coverage of a view at the training size, with lens distortion: `masks`, {object: 8-bit PNG}."""
    model = session.model(project)
    if not model.objects:
        raise BadRequest("No object is segmented yet.", "Segment first.")
    captured = model.capture.view(view)
    coverages = model.render_field(model.working_camera(captured)).probabilities
    return _write_masks(session, captured, dict(zip(model.objects, coverages, strict=True)))


@query
def correct(
    session: Session, project: str, view: str, masks: str | None = None, corrections: str | None = None
) -> dict[str, Any]:
    """Apply corrections and write the masks of a view: `masks`, {object: path of a PNG} in the photo's pixel grid.

    `masks` and `corrections` are folders, by default the project's own. The first call labels the whole scene.
    """
    from ...segmentation.coarse_masks import find_masks  # need torch
    from ...segmentation.corrections import find_corrections
    from ...segmentation.labels import CorrectionSession

    owner = Project(project)
    geometry = owner.require("geometry")["fingerprint"]
    capture = read_capture(owner)
    captured = capture.view(view)
    rough = find_masks(owner.check_inside(Path(masks or owner.masks_folder)), capture)
    marks = find_corrections(owner.check_inside(Path(corrections or owner.corrections_folder)), capture)

    def start() -> CorrectionSession:
        field = session.model(str(owner.folder)).scene.field
        progress = Progress(lambda *_, **__: None, session.is_superseded, "surface", 1)
        settings, volumes = settings_for(owner, "segmentation"), read_volumes(owner.volumes_file)
        return CorrectionSession(field, capture, rough, marks, settings, progress, volumes)

    volumes = checksum(owner.volumes_file) if owner.volumes_file.exists() else ""
    objects = sorted({mark.object_name for mark in (*rough, *marks)})
    correcting = session.cached(("correcting", owner.folder), (geometry, _digests(rough), objects, volumes), start)
    version = id(correcting), _digests(marks)
    session.cached(("corrected", owner.folder), version, lambda: correcting.correct(marks))
    found = correcting.masks(captured).items()
    return _write_masks(session, captured, {name: _distorted(mask, captured.camera) for name, mask in found})


def _digests(marks: list[CoarseMask]) -> list:
    return [(mark.object_name, mark.view.name, checksum(mark.path)) for mark in marks]


def _write_masks(session: Session, view: View, pictures: dict[str, np.ndarray]) -> dict[str, Any]:
    files = {name: session.file(f"{name}-{view.name}.png") for name in pictures}
    for name, path in files.items():
        write_png(path, pictures[name])
    return {"masks": {name: str(path) for name, path in files.items()}}


def _distorted(mask: np.ndarray, stored: Camera) -> np.ndarray:
    """Resample an undistorted mask, bool [H, W] of any size, to the grid of a photo taken with this lens."""
    height, width = mask.shape
    lens = stored.scaled(width, height)
    x, y = np.nan_to_num(undistort_points(lens, lens.pixel_centers()), nan=-1).T
    inside = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    distorted = np.zeros(mask.size, np.float32)
    distorted[inside] = mask[y[inside].astype(int), x[inside].astype(int)]
    return resize(distorted.reshape(mask.shape), stored.width, stored.height) >= 0.5
