"""A capture from photos without poses, or from a video: photos and a COLMAP model in a new folder.

Pairs of up to 250 photos are all matched, of more those of neighbors by name, where nothing else is asked for.

OUT/images/ holds hard links to the photos, or copies where the file system has none; photos that Exif turns and EXR
files become upright 8-bit copies, because COLMAP works on stored pixels. OUT/sparse/0/ is the model. OUT appears only
when it is complete.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

from PIL import Image, ImageOps

from ..capture.poses.structure_from_motion import FEWEST_PHOTOS, SfmResult, SfmTask, reconstruct
from ..capture.poses.video import write_sharpest_frames
from ..capture.poses.work_folder import work_folder
from ..capture.reading import photos_in
from ..compute.progress import Emit, Progress
from ..errors import DataError, missing_package
from ..io.files import copy_file, naming
from ..io.image_size import image_header
from ..io.images import read_photo, write_png
from .options.capturing import PosesOptions
from .output_folder import new_folder

MOST_EXHAUSTIVE = 250  # photos; all pairs of more take hours
ENOUGH = 0.9  # share of registered photos below which a second, more sensitive try is made, and the user warned
TOO_FEW = 0.3  # share of registered photos that is not a result
# agreement of matches and poses below which the poses may be wrong; right ones keep 0.88 amid look-alikes
MIN_AGREEMENT = 0.8


def run(options: PosesOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Find the poses and write the capture. Raises DataError where too few photos can be placed."""
    source, out = _checked(options), options.out.absolute()
    with new_folder(out) as capture, work_folder(out.parent, f".{out.name[:100]}-poses-") as work:
        (capture / "images").mkdir()
        names = _gather(source, capture / "images", emit, should_stop)
        task = SfmTask(
            photos=capture / "images",
            names=names,
            work=work,
            model=capture / "sparse" / "0",
            one_lens=len({image_header(capture / "images" / name).stored for name in names}) == 1,
            sequential=options.matching == "sequential"
            or (options.matching == "auto" and len(names) > MOST_EXHAUSTIVE),
            threads=options.threads or -1,
        )
        result = _reconstruct_twice(task, emit, should_stop)
        _judge(source, result, len(names), emit)
    emit("artifact", kind="capture", path=str(out))


def _checked(options: PosesOptions) -> Path:
    """Where the photos are, absolute."""
    source = options.photos.absolute()
    if not source.exists():
        raise DataError("{path} does not exist.", "Give a folder of photos, or a video file.", path=source)
    if find_spec("pycolmap") is None:
        raise missing_package("pycolmap")
    return source


# --------------------------------------------------------------------------------------------------------------- photos
def _gather(source: Path, folder: Path, emit: Emit, should_stop: Callable[[], bool]) -> tuple[str, ...]:
    """Put the photos into `folder`; returns their names there, in order."""
    emit("stage", name="poses", text="reading photos")
    if source.is_file():
        names = write_sharpest_frames(source, folder, should_stop)
    else:
        photos = photos_in(source)
        progress = Progress(emit, should_stop, "poses", len(photos))
        names = []
        for photo in photos:
            progress.step()
            names.append(_take(photo, folder))
    if len(names) < FEWEST_PHOTOS:
        raise DataError(
            "{path} holds {count} photos; poses need at least {fewest}.",
            "Give a folder with photos (PNG, JPEG, TIFF, BMP, WebP, EXR), 30 or more from all sides, or a video.",
            path=source,
            count=len(names),
            fewest=FEWEST_PHOTOS,
        )
    return tuple(names)


def _take(photo: Path, folder: Path) -> str:
    """Link or copy the photo into `folder`, upright; returns its name there. Raises DataError where it is damaged."""
    header = image_header(photo)
    if header.orientation == 1 and header.kind != "exr":
        try:
            os.link(photo.resolve(), folder / photo.name)
        except OSError:  # another disk, or a file system without links
            copy_file(photo, folder / photo.name)
        return photo.name
    if header.kind == "jpeg":  # keeps the Exif focal length, where the search for the lens begins
        with naming(folder / photo.name), Image.open(photo) as picture:
            upright = ImageOps.exif_transpose(picture)
            upright.save(folder / photo.name, quality=95, exif=upright.getexif())
        return photo.name
    name = f"{photo.name}.png"
    write_png(folder / name, read_photo(photo))
    return name


# ---------------------------------------------------------------------------------------------------------------- poses
def _reconstruct_twice(task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Reconstruct; where that leaves many photos out, try more sensitive features too. The better model is kept."""
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
        if best.registered >= ENOUGH * len(task.names):
            break
    return best


def _judge(source: Path, result: SfmResult, count: int, emit: Emit) -> None:
    registered = result.registered
    if registered < max(FEWEST_PHOTOS, TOO_FEW * count):
        raise DataError(
            "Only {registered} of the {count} photos of {path} could be placed.",
            "Take more photos with more overlap (everything in at least three of them), of a scene that has texture and "
            "stands still, sharp and without zooming.",
            registered=registered,
            count=count,
            path=source,
        )
    if registered < ENOUGH * count:
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
