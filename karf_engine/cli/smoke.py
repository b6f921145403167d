"""The smoke run and the speed test: stages on a tiny capture, two diffuse balls under one lamp, in a temporary folder."""

from __future__ import annotations

import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..capture import Camera, View, write_cameras
from ..errors import KarfError
from ..io.failures import translate_error
from ..io.images import write_png
from ..worker.findings import OK, Finding, error_finding

OBJECT = "ball"  # the marked object
SIZE = 32  # pixels along each side of a photo
PHOTOS = 12
FOCAL_LENGTH = 1.35 * SIZE
DISTANCE = 3.6  # of the cameras from the origin; all balls are within distance 1 of it
LAMP = np.array([0.4, -0.5, 0.77])
RADIUS = 0.45
BALLS = (((-0.5, 0.0, 0.1), (0.85, 0.15, 0.1)), ((0.5, 0.1, -0.1), (0.15, 0.3, 0.8)))  # center and color; marked first
TEST = 1  # the held-out photo
SETTINGS = (
    "geometry.long_side=32",
    'geometry.levels=[{"voxels": 24, "iterations": 100, "step": 1.0}]',
    "geometry.samples=8000",
    "geometry.max_rays=1024",
    "segmentation.iterations=60",
    "segmentation.rate=0.01",
    "segmentation.batch=128",
    "segmentation.width=8",
    "segmentation.cache_long_side=32",
    "recoloring.iterations=10",
    "recoloring.batch=128",
    "recoloring.width=8",
    "splats.iterations=5",
    "splats.count=1000",
    "splats.long_side=32",
)
RED, BLUE = "#b5302c", "#3059b8"  # the marked ball's color, and its new one
SAMPLES = 80_000  # per iteration, as in the preset demo
WARM_UP, ITERATIONS = 10, 40  # the first iterations allocate, and choose kernels
# speed on a real capture relative to the tiny scene, with its small grid and single level; measured on two threads
REAL_SPEED = 0.2
SPEED_SETTINGS = (
    "geometry.long_side=32",
    f'geometry.levels=[{{"voxels": 96, "iterations": {ITERATIONS}, "step": 0.75}}]',
    f"geometry.samples={SAMPLES}",
    "geometry.max_rays=8192",
)


def stages(device: str | None = None, threads: int | None = None) -> Iterator[Finding]:
    """Run and time the stages, up to the first that fails; one thread, the default, is fastest at this size."""
    with tempfile.TemporaryDirectory(prefix="karf-doctor-", ignore_cleanup_errors=True) as folder:
        for name, run in _runs(Path(folder), {"device": device, "threads": threads or 1}):
            finding = _timed(name, run)
            yield finding
            if finding.status != OK:
                return


def _runs(folder: Path, run: dict[str, Any]) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield each stage's name and a call of its library function."""
    from .. import api
    from ..compute.runtime import find_device
    from ..palettes.project_edit import edit_of
    from ..project import Project
    from ..splats.rasterizer import backend

    capture, masks, project, edit = (folder / name for name in ("capture", "masks", "project", "edit.json"))

    def learn_geometry():
        write_scene(capture, masks)
        api.learn_geometry(capture, project=project, overrides=SETTINGS, **run)

    def render():
        edit_of(Project(project)).becomes(OBJECT, RED, BLUE).save(edit)
        api.render(project, folder / "out", edit=edit, **run)

    yield "geometry", learn_geometry
    yield "segmentation", lambda: api.segment(project, masks, **run)
    yield "palette", lambda: api.extract_palettes(project, **run)
    yield "recoloring", lambda: api.learn_recoloring(project, **run)
    if backend(find_device(run["device"])):
        yield "splats", lambda: api.learn_splats(project, **run)
    yield "render", render


def _timed(name: str, run: Callable[[], None]) -> Finding:
    start = time.monotonic()
    try:
        run()
    except Exception as error:  # any failure of a stage is a finding
        known = translate_error(error)
        if known is None:
            traceback.print_exception(error)
            known = KarfError(f"{error!r}.", "Report it with what was printed.")
        broken = type(known)(f"The stage {name} does not run: {known.sentence}", known.hint)
        return error_finding(name, broken, round(time.monotonic() - start, 3))
    seconds = time.monotonic() - start
    return Finding(name, OK, f"The stage {name} works: {seconds:.1f} s for a tiny scene.", seconds=round(seconds, 3))


def samples_per_second(device: str | None = None, threads: int | None = None) -> float:
    """Return how many samples of a capture the geometry learns from per second."""
    from .. import api

    seen: list[tuple[int, float]] = []  # iterations and their times

    def emit(kind: str, /, **values: Any) -> None:
        if kind == "progress" and values["stage"] == "geometry":
            seen.append((values["step"], time.perf_counter()))

    with tempfile.TemporaryDirectory(prefix="karf-speed-", ignore_cleanup_errors=True) as folder:
        capture, project = Path(folder) / "capture", Path(folder) / "project"
        write_scene(capture, Path(folder) / "masks")
        api.learn_geometry(
            capture, project=project, overrides=SPEED_SETTINGS, device=device, threads=threads, emit=emit
        )
    (first, start), (last, end) = next(pair for pair in seen if pair[0] >= WARM_UP), seen[-1]
    return REAL_SPEED * SAMPLES * (last - first) / max(end - start, 1e-6)


def write_scene(capture: Path, masks: Path) -> None:
    """Write the photos with their cameras, and the mask of the marked ball in the first one."""
    views = []
    for number in range(PHOTOS):
        camera = _camera(2 * np.pi * number / PHOTOS, (0.35, 0.75, 1.1)[number % 3])
        photo, is_marked = _photograph(camera)
        name = f"photo_{number}"
        views.append(View(name, name, camera, None, "test" if number == TEST else "train"))
        write_png(capture / f"{name}.png", photo)
        if number == 0:
            write_png(masks / OBJECT / f"{name}.png", is_marked)
    write_cameras(capture / "transforms.json", views)


def _camera(azimuth: float, elevation: float) -> Camera:
    """Return a camera at these angles in radians that faces the origin, z up."""
    back = np.array([np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)])
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(back, right), back], 1)
    pose[:3, 3] = DISTANCE * back
    return Camera(SIZE, SIZE, FOCAL_LENGTH, FOCAL_LENGTH, SIZE / 2, SIZE / 2, pose)


def _photograph(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """Return a photo with alpha [H, W, 4], and the mask of the marked ball [H, W]."""
    origins, directions = camera.rays(camera.pixel_centers())
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    nearest, photo, shown = np.full(len(origins), np.inf), np.zeros((len(origins), 4)), np.full(len(origins), -1)
    for index, (center, color) in enumerate(BALLS):
        offset = origins - center
        half_b = (offset * directions).sum(1)
        discriminant = half_b**2 - (offset**2).sum(1) + RADIUS**2
        distance = -half_b - np.sqrt(np.maximum(discriminant, 0))
        is_hit = (discriminant > 0) & (distance < nearest)
        normals = (offset + distance[:, None] * directions)[is_hit] / RADIUS
        shade = 0.55 + 0.45 * np.clip(normals @ LAMP, 0, 1)
        photo[is_hit] = np.c_[shade[:, None] * color, np.ones(len(shade))]
        nearest[is_hit], shown[is_hit] = distance[is_hit], index
    return photo.reshape(SIZE, SIZE, 4), (shown == 0).reshape(SIZE, SIZE)
