"""Recoloring a photo in its own pixels: seconds, peak memory, and whether all that no object covers keeps its bits.

A test photo of a learned project is enlarged, noise is added as a sensor does, and a process of its own reads it, finds
its mattes, recolors it and writes it. The seconds are those of the processor from reading to having written; the memory
is the process's highest, with all that is loaded.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import OpenEXR

import karf_engine as karf
from karf_engine.capture.capture import View
from karf_engine.compute.progress import peak_memory_bytes
from karf_engine.io.color import srgb_to_linear
from karf_engine.palettes.palette import Edit, Palette
from karf_engine.recolor.full_resolution import PhotoView, make_photo_view
from karf_engine.recolor.matting.photo_mattes import make_mattes
from karf_engine.recolor.matting.thin_parts import Marks
from karf_engine.recolor.model import Model
from karf_engine.recolor.photos import open_photo, suffix_for, write_photo

MEGAPIXELS, OBJECTS = (1, 12, 24), (1, 3)
NOISE = 2 / 255  # standard deviation
TARGET_GIB = 2.0  # at 24 megapixels with three objects


def run(project: Path) -> list[dict[str, Any]]:
    """A row for each size and number of objects, then one for each format at the smallest size."""
    model = karf.load(project)
    most = len(model.objects)
    cases = [(".png", size, count) for size in MEGAPIXELS for count in OBJECTS if count <= most]
    cases += [(name, MEGAPIXELS[0], most) for name in WRITERS if name != ".png"]
    with tempfile.TemporaryDirectory(prefix="karf-photos-") as folder:
        return [measured(project, model, Path(folder), *case) for case in cases]


def measured(project: Path, model: Model, folder: Path, name: str, megapixels: int, count: int) -> dict[str, Any]:
    """One case, in a process of its own."""
    photo = folder / f"photo{name}"
    WRITERS[name](photo, enlarged(model, megapixels))
    command = [sys.executable, "-m", "tools.speed.photo_size", str(project), str(photo), str(count)]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return {"photo": name[1:], "megapixels": megapixels, "objects": count} | json.loads(done.stdout.splitlines()[-1])


def enlarged(model: Model, megapixels: float) -> np.ndarray:
    """The first test photo at another size, with noise: float32 sRGB [H, W, 3] in [0, 1]."""
    small = open_photo(model.capture.split("test")[0].image).colors()
    factor = (megapixels * 1e6 / (small.shape[0] * small.shape[1])) ** 0.5
    large = cv2.resize(small, None, fx=factor, fy=factor, interpolation=cv2.INTER_CUBIC)
    noise = np.random.default_rng(0).standard_normal(large.shape, np.float32)
    return np.clip(large + NOISE * noise, 0, 1)


def write_unsigned(largest: int) -> Callable[[Path, np.ndarray], None]:
    """A writer of whole numbers up to `largest`, in the format of the file's name."""

    def write(path: Path, picture: np.ndarray) -> None:
        values = np.rint(picture[..., ::-1] * largest).astype(np.min_scalar_type(largest))
        if not cv2.imwrite(str(path), values):
            raise OSError(f"{path} could not be written")

    return write


def write_exr(path: Path, picture: np.ndarray) -> None:
    """Write linear light in half floats."""
    light = srgb_to_linear(picture).astype(np.float16)
    OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": light}).write(str(path))


WRITERS: dict[str, Callable[[Path, np.ndarray], None]] = {
    ".png": write_unsigned(255),
    ".16-bit.png": write_unsigned(65535),
    ".jpg": write_unsigned(255),
    ".16-bit.tif": write_unsigned(65535),
    ".exr": write_exr,
}


def main() -> None:
    """Recolor one photo, and print what it took."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("project", type=Path)
    parser.add_argument("photo", type=Path)
    parser.add_argument("objects", type=int, help="the project's first so many")
    options = parser.parse_args()
    model = karf.load(options.project)
    view = model.capture.split("test")[0]
    width, height = open_photo(options.photo).size
    view = replace(view, image=options.photo, camera=view.camera.scaled(width, height))
    start = time.process_time()
    ready = photo_view(model, view, options.objects)
    recolored = ready.recolor(other_colors(ready.palettes))
    out = options.photo.with_name(f"recolored{suffix_for(recolored)}")
    write_photo(out, recolored)
    figures = {"seconds": round(time.process_time() - start, 2), "peak_gib": round(peak_memory_bytes() / 2**30, 2)}
    print(json.dumps(figures | {"outside_equal": outside_is_equal(ready, out)}))


def photo_view(model: Model, view: View, count: int) -> PhotoView:
    """`Model.photo_view` of a project that had only the first so many objects."""
    seen = model.render_field(model.working_camera(view))
    seen = replace(seen, probabilities=seen.probabilities[:count])
    refine = partial(make_mattes, model.settings.render.edges)
    unmarked = Marks(None, (False,) * count)
    return make_photo_view(view, "photo", seen, unmarked, refine, model.objects[:count], model.palettes[:count])


def other_colors(palettes: Sequence[Palette]) -> Edit:
    """An edit that changes every swatch but black."""
    return Edit(
        {palette.name: np.concatenate([palette.colors[:1], 1 - palette.colors[1:]]) for palette in palettes}, "delta"
    )


def outside_is_equal(ready: PhotoView, out: Path) -> bool:
    """Whether what was written has the photo's bits in every pixel that no object covers, and others in some."""
    before, after = ready.photo.pixels, open_photo(out).pixels
    covered = covered_by(ready)
    return bool((before[~covered] == after[~covered]).all() and (before[covered] != after[covered]).any())


def covered_by(ready: PhotoView) -> np.ndarray:
    """Pixels that an object covers, bool [H, W]."""
    result = np.zeros(ready.photo.pixels.shape[:2], bool)
    for matte in ready.mattes:
        result[slice(*matte.rows), slice(*matte.columns)] |= matte.coverage > 0
    return result


if __name__ == "__main__":
    main()
