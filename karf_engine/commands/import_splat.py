"""Make a capture of Gaussians of another program, with or without the photos that they were learned from.

OUT/transforms.json has the views and names OUT/splat.*, a hard link to the file or a copy. Without photos, OUT/images/ has
renderings from cameras chosen around the Gaussians. OUT appears only when it is complete.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..capture import FORMATS, open_capture
from ..capture.camera import Camera
from ..capture.capture import Capture, CapturedSplats, View
from ..capture.splat_cameras import cameras_beside, folders_around, read_splat_cameras
from ..capture.training_images import load_views
from ..capture.transforms import write_capture
from ..compute.cores import limit_torch_threads
from ..compute.kernels import has_kernels
from ..compute.progress import Emit, Progress
from ..compute.runtime import start_runtime
from ..errors import BadRequest, DataError, Message, missing_package
from ..io.color import to_bytes
from ..io.files import link_or_copy, new_folder, read_json
from ..io.images import unpremultiply, write_png
from ..splats.formats import ply
from ..splats.formats.registry import read_splats, warn_of_skipped
from ..splats.formats.splat_file import SplatFile
from ..splats.gaussians import Gaussians, imported_gaussians
from .options import ImportSplatOptions

COMPARED_VIEWS, COMPARED_LONG_SIDE = 6, 400  # photos that the Gaussians must reproduce
MIN_PSNR = 15.0  # dB
MIN_FILTER_GAIN = 0.5  # dB between the two screen filters for the photos to decide
THUMBNAIL = 100  # pixels of the renderings that decide whether the background is empty
MIN_VIEWS = 3
MAX_EMPTY = 0.1  # share of empty pixels above which the views get an alpha channel
AXES: dict[str, np.ndarray] = dict(zip(("x", "y", "z", "-x", "-y", "-z"), [*np.eye(3), *-np.eye(3)], strict=True))


def run(options: ImportSplatOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the capture. Raises DataError where the file is damaged or does not reproduce the photos."""
    if not has_kernels():
        raise missing_package("numba")
    start_runtime(0, options.threads, options.device)
    limit_torch_threads()
    out = options.out.absolute()
    with new_folder(out) as folder:
        emit("stage", name="import_splat", text=f"reading {options.splat.name}")
        found = read_splats(options.splat)
        emit("stage", name="import_splat", text=f"{len(found)} Gaussians")
        warn_of_skipped(found, options.splat, emit)
        path = _linked(options.splat, found, folder)
        splats = CapturedSplats(path, options.antialiased or bool(found.is_antialiased))
        if options.photos is not None:
            capture = _with_photos(options, found.table, splats, emit)
        else:
            _suggest_photos(options.splat, emit)
            views = _write_views(options, found.table, splats.is_antialiased, folder / "images", emit, should_stop)
            capture = Capture(folder, "transforms", tuple(views), splats=splats)
        for remark in capture.warnings:
            emit("warning", code="capture", sentence=remark)
        write_capture(folder / "transforms.json", capture, out)
    emit("artifact", kind="capture", path=str(out))


def _linked(splat: Path, found: SplatFile, folder: Path) -> Path:
    """Link or copy the file into the folder and return its path; a .gltf, which refers to other files, becomes a .ply."""
    if splat.suffix.lower() == ".gltf":
        ply.write(folder / "splat.ply", found)
        return folder / "splat.ply"
    is_compressed = splat.name.lower().endswith(".compressed.ply")
    linked = folder / f"splat{'.compressed' if is_compressed else ''}{splat.suffix.lower()}"
    link_or_copy(splat, linked)
    return linked


def _suggest_photos(splat: Path, emit: Emit) -> None:
    """Warn where folders around the file have photos with poses; only the user knows whether they belong to it."""
    for folder in folders_around(splat):
        if _has_photos(folder):
            sentence = Message(
                "{folder} has photos with their poses. If {name} was learned from them, import it with them (--photos): "
                "then they are recolored too.",
                folder=folder,
                name=splat.name,
            )
            emit("warning", code="photos", sentence=sentence)
            return


def _has_photos(folder: Path) -> bool:
    """Return whether this is a capture of photos, not one made of Gaussians."""
    if not any(known.recognizes(folder) for known in FORMATS):
        return False
    try:
        return open_capture(folder).splats is None
    except DataError:
        return False


def _write_views(
    options: ImportSplatOptions,
    table: np.ndarray,
    is_antialiased: bool,
    folder: Path,
    emit: Emit,
    should_stop: Callable[[], bool],
) -> list[View]:
    """Choose cameras and write their renderings into the folder; return the views."""
    from ..splats.rasterizer import rasterize

    everything = imported_gaussians(table, is_antialiased, ())
    cameras = _cameras(options, everything, emit, Progress(emit, should_stop, "import_splat", 1))
    gaussians = imported_gaussians(table, is_antialiased, cameras)
    thumbnails = [rasterize(gaussians, camera.reduced(THUMBNAIL)).image for camera in cameras]
    has_alpha = float(np.mean([(image[..., 3] > 0.5).mean() for image in thumbnails])) > MAX_EMPTY
    progress = Progress(emit, should_stop, "import_splat", len(cameras))
    folder.mkdir()
    views = []
    for number, camera in enumerate(cameras):
        name = f"view_{number:03d}"
        image = rasterize(gaussians, camera).image
        image[..., 3] = 1 - image[..., 3]
        image = image.clip(0, 1)
        picture = np.dstack([unpremultiply(image), image[..., 3]]) if has_alpha else image[..., :3]
        write_png(folder / f"{name}.png", to_bytes(picture))
        views.append(View(name, name, camera, folder / f"{name}.png", "train"))
        progress.step()
    return views


def _cameras(options: ImportSplatOptions, gaussians: Gaussians, emit: Emit, progress: Progress) -> list[Camera]:
    """Return the user's cameras, and those beside the splat or chosen around it."""
    cameras = _read_cameras(options.cameras) if options.cameras else []
    if options.views:
        cameras += _known_cameras(options, emit) or _chosen_cameras(options, gaussians, emit, progress)
    if len(cameras) < MIN_VIEWS:
        raise BadRequest(f"{len(cameras)} views are too few to learn from.", "Give more --views, or more --cameras.")
    return cameras


def _known_cameras(options: ImportSplatOptions, emit: Emit) -> list[Camera]:
    """Return evenly chosen training cameras from a file beside the splat, if there is one."""
    for path in cameras_beside(options.splat):
        try:
            found = read_splat_cameras(path)
        except DataError as error:  # a file of another program or scene
            emit("warning", code="cameras", sentence=error.sentence)
            continue
        emit("stage", name="import_splat", text=f"cameras of {path}")
        numbers = np.linspace(0, len(found) - 1, min(len(found), options.views)).round().astype(int)
        return [found[number].reduced(options.size) for number in numbers]
    return []


def _chosen_cameras(options: ImportSplatOptions, gaussians: Gaussians, emit: Emit, progress: Progress) -> list[Camera]:
    from ..splats.viewpoints import cameras_around, estimate_target

    emit("stage", name="import_splat", text="choosing cameras")
    up = None if options.up == "auto" else AXES[options.up]
    return cameras_around(
        gaussians, estimate_target(gaussians, up), options.views, options.size, lambda: progress.step(0)
    )


def _read_cameras(path: Path) -> list[Camera]:
    """Read the cameras of a transforms.json or of a cameras.json."""
    if isinstance(read_json(path, "cameras"), list):
        return read_splat_cameras(path)
    return [view.camera.without_distortion() for view in open_capture(path, photos=False).views]


def _with_photos(options: ImportSplatOptions, table: np.ndarray, splats: CapturedSplats, emit: Emit) -> Capture:
    """Return the photos' capture with the Gaussians and the screen filter that reproduces the photos better."""
    from ..splats.fit import Photo, psnr  # need numba

    assert options.photos is not None
    capture = open_capture(options.photos)
    views = capture.views[:: max(1, len(capture.views) // COMPARED_VIEWS)][:COMPARED_VIEWS]
    cameras = [view.camera for view in capture.views]
    photos = [Photo.of(image) for image in load_views(views, COMPARED_LONG_SIDE)]
    scores = [psnr(imported_gaussians(table, is_antialiased, cameras), photos) for is_antialiased in (False, True)]
    best = int(np.argmax(scores)) if abs(scores[1] - scores[0]) > MIN_FILTER_GAIN else int(splats.is_antialiased)
    if scores[best] < MIN_PSNR:
        raise DataError(
            "{splat} shows the photos of {capture} at {psnr:.1f} dB only.",
            "Give the photos that it was learned from, with the poses that it was learned with.",
            splat=options.splat,
            capture=options.photos,
            psnr=scores[best],
        )
    text = f"shows the photos at {scores[best]:.1f} dB" + (", antialiased" if best else "")
    emit("stage", name="import_splat", text=text)
    return replace(capture, splats=replace(splats, is_antialiased=bool(best)))
