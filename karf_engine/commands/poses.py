"""Make a capture of photos without poses, or of a video: photos and a COLMAP model in a new folder.

OUT/images/ has hard links to the photos, or copies where the file system has no links; photos with an Exif orientation
and EXR files become upright 8-bit copies, because COLMAP works on stored pixels. OUT/sparse/0/ is the model. OUT appears
only when it is complete.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from PIL import Image, ImageOps

from ..capture.child_process import work_folder
from ..capture.reader_utils import photos_in
from ..capture.structure_from_motion import FEWEST_PHOTOS, SfmResult, SfmTask, reconstruct, write_sharpest_frames
from ..compute.progress import Emit, Progress
from ..errors import DataError, missing_package
from ..io.files import errors_naming_path, link_or_copy, new_folder
from ..io.image_size import KINDS, image_header
from ..io.images import read_photo, write_png
from .options import PosesOptions

MAX_EXHAUSTIVE = 250  # photos; matching all pairs of more takes hours
GOOD_SHARE = 0.9  # share of registered photos below which more sensitive features are tried, and the user is warned
MIN_SHARE = 0.3  # share of registered photos below which the command fails
MIN_AGREEMENT = 0.8  # of matches with poses; correct poses reach 0.88 among repetitive structures


def run(options: PosesOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Find the poses and write the capture. Raises DataError where too few photos can be registered."""
    source, out = options.photos.absolute(), options.out.absolute()
    if not source.exists():
        raise DataError("{path} does not exist.", "Give a folder of photos, or a video file.", path=source)
    if find_spec("pycolmap") is None:
        raise missing_package("pycolmap")
    with new_folder(out) as capture, work_folder(out.parent, f".{out.name[:100]}-poses-") as work:
        (capture / "images").mkdir()
        names = _gather(source, capture / "images", emit, should_stop)
        task = SfmTask(
            photos=capture / "images",
            names=names,
            work=work,
            model=capture / "sparse" / "0",
            single_camera=len({image_header(capture / "images" / name).stored_size for name in names}) == 1,
            sequential=options.matching == "sequential" or (options.matching == "auto" and len(names) > MAX_EXHAUSTIVE),
            threads=options.threads or -1,
        )
        result = _reconstruct_twice(task, emit, should_stop)
        _judge(source, result, len(names), emit)
    emit("artifact", kind="capture", path=str(out))


def _gather(source: Path, folder: Path, emit: Emit, should_stop: Callable[[], bool]) -> tuple[str, ...]:
    """Put the photos into `folder` and return their names there, in order."""
    emit("stage", name="poses", text="reading photos")
    if source.is_file():
        names = write_sharpest_frames(source, folder, should_stop)
    else:
        photos = photos_in(source)
        progress = Progress(emit, should_stop, "poses", len(photos))
        names = []
        for photo in photos:
            progress.step()
            names.append(_add_photo(photo, folder))
    if len(names) < FEWEST_PHOTOS:
        raise DataError(
            "{path} holds {count} photos; poses need at least {fewest}.",
            "Give a folder with photos ({kinds}), 30 or more from all sides, or a video.",
            path=source,
            count=len(names),
            fewest=FEWEST_PHOTOS,
            kinds=KINDS,
        )
    return tuple(names)


def _add_photo(photo: Path, folder: Path) -> str:
    """Link or copy the photo into `folder`, upright, and return its name there. Raises DataError where it is damaged."""
    header = image_header(photo)
    if header.orientation == 1 and header.kind not in ("exr", "heic", "avif"):  # which COLMAP does not read
        link_or_copy(photo, folder / photo.name)
        return photo.name
    if header.kind == "jpeg":  # keeps the Exif focal length, COLMAP's initial guess
        with errors_naming_path(folder / photo.name), Image.open(photo) as picture:
            upright = ImageOps.exif_transpose(picture)
            upright.save(folder / photo.name, quality=95, exif=upright.getexif())
        return photo.name
    name = f"{photo.name}.png"
    write_png(folder / name, read_photo(photo))
    return name


def _reconstruct_twice(task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Reconstruct; if many photos are left out, try more sensitive features too and keep the better model."""
    best = SfmResult()
    for sensitive, text in ((False, "finding poses"), (True, "finding poses with more sensitive features")):
        emit("stage", name="poses", text=text)
        attempt = task.work / ("second" if sensitive else "first")
        (attempt / "model").mkdir(parents=True)
        found = reconstruct(
            replace(task, work=attempt, model=attempt / "model", sensitive=sensitive), emit, should_stop
        )
        if found.registered > best.registered:
            best = found
            shutil.rmtree(task.model, ignore_errors=True)
            shutil.copytree(attempt / "model", task.model)
        if best.registered >= GOOD_SHARE * len(task.names):
            break
    return best


def _judge(source: Path, result: SfmResult, count: int, emit: Emit) -> None:
    registered = result.registered
    if registered < max(FEWEST_PHOTOS, MIN_SHARE * count):
        raise DataError(
            "Only {registered} of the {count} photos of {path} could be placed.",
            "Take more photos with more overlap (everything in at least three of them), of a scene that has texture and "
            "stands still, sharp and without zooming.",
            registered=registered,
            count=count,
            path=source,
        )
    if registered < GOOD_SHARE * count:
        emit(
            "warning",
            code="poses",
            sentence=f"{registered} of the {count} photos were placed; the others are left out. More photos between them "
            "and their neighbors would help.",
        )
    if result.agreement < MIN_AGREEMENT:
        emit(
            "warning",
            code="poses",
            sentence=f"Only {result.agreement:.0%} of the matches between the photos agree with the poses: places "
            "that look alike may be confused. Look at the cameras; more photos between neighbors would help.",
        )
