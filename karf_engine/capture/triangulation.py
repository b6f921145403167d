"""Triangulate sparse points of photos with known cameras, by pycolmap (Schönberger and Frahm 2016) in a child process."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..compute.progress import Progress
from ..io.color import to_bytes
from ..io.files import errors_naming_path
from ..io.images import encode_image
from .camera import Camera
from .capture import SparsePoints
from .child_process import child_messages, work_folder
from .training_images import TrainingImage

MAX_FEATURES = 2500  # per photo
AT_ONCE = 16  # photos per batch of feature extraction
NEIGHBORS = 10  # photos matched with each photo
TURN = 2.0  # weight of rotation against distance in units of the rig's size


@dataclass(frozen=True)
class _Task:
    folder: Path
    names: list[str]
    cameras: list[Camera]
    threads: int

    @property
    def database(self) -> Path:
        return self.folder / "features.db"


def triangulate(training_images: list[TrainingImage], threads: int, progress: Progress) -> SparsePoints:
    """Triangulate the points that at least two images share; `progress` counts the images.

    `view`, `pixels` and `errors` of the points refer to the images. Raises KarfError if pycolmap failed or `progress`
    was cancelled.
    """
    with work_folder(Path(tempfile.gettempdir()), "karf-points-") as folder, errors_naming_path(folder):
        names, cameras = [f"{n:05d}.png" for n in range(len(training_images))], [p.camera for p in training_images]
        for name, training_image in zip(names, training_images, strict=True):
            (folder / name).write_bytes(encode_image(".png", to_bytes(training_image.color)))
        value = None
        with child_messages("pycolmap", _triangulate, _Task(folder, names, cameras, threads)) as messages:
            for kind, value in messages:
                progress.step(value if kind == "photos" else 0)
    assert isinstance(value, SparsePoints)
    return value


# ---------------------------------------------------------------------------------------------------------- the child
def _triangulate(send: Callable[..., None], task: _Task) -> SparsePoints:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    _add_cameras(pycolmap, task)
    for first in range(0, len(task.names), AT_ONCE):
        names = task.names[first : first + AT_ONCE]
        _extract_features(pycolmap, task, names)
        send("photos", len(names))
    _match_features(pycolmap, task)
    options = pycolmap.IncrementalPipelineOptions(num_threads=task.threads)
    out = task.folder / "points"
    out.mkdir()
    model = _posed_model(pycolmap, task)
    return _sparse_points(pycolmap.triangulate_points(model, task.database, task.folder, out, options=options))


def _extract_features(pycolmap: Any, task: _Task, names: list[str]) -> None:
    options = pycolmap.FeatureExtractionOptions(num_threads=task.threads, use_gpu=False)
    options.sift.max_num_features = MAX_FEATURES
    options.sift.peak_threshold = 0.003  # small photos have weak features only
    pycolmap.extract_features(
        task.database,
        task.folder,
        names,
        pycolmap.CameraMode.PER_IMAGE,
        pycolmap.ImageReaderOptions(camera_model="PINHOLE"),
        options,
        pycolmap.Device.cpu,
    )


def _add_cameras(pycolmap: Any, task: _Task) -> None:
    """Add the photos to the database in a fixed order, before features are extracted in parallel."""
    with pycolmap.Database.open(task.database) as content:
        for name, camera in zip(task.names, task.cameras, strict=True):
            lens = {"params": [camera.fx, camera.fy, camera.cx, camera.cy]}
            pinhole = pycolmap.Camera(model="PINHOLE", width=camera.width, height=camera.height, **lens)
            content.write_image(pycolmap.Image(name=name, camera_id=content.write_camera(pinhole)))


def _match_features(pycolmap: Any, task: _Task) -> None:
    pairs = task.folder / "pairs.txt"
    lines = "\n".join(f"{task.names[a]} {task.names[b]}" for a, b in neighbor_pairs(task.cameras))
    pairs.write_text(lines, encoding="utf-8", newline="\n")
    pycolmap.match_image_pairs(
        task.database,
        pycolmap.FeatureMatchingOptions(num_threads=task.threads, use_gpu=False),
        pycolmap.ImportedPairingOptions(match_list_path=str(pairs)),
        device=pycolmap.Device.cpu,
    )


def neighbor_pairs(cameras: Sequence[Camera], count: int = NEIGHBORS) -> list[tuple[int, int]]:
    """Return pairs of cameras (a < b) with near positions and similar directions, about `count` per camera."""
    positions = np.stack([camera.position for camera in cameras])
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    size = np.median(np.linalg.norm(positions - positions.mean(0), axis=1)) + 1e-12
    distances = np.linalg.norm(positions[:, None] - positions, axis=2) / size + TURN * (1 - axes @ axes.T)
    nearest = distances.argsort(1)[:, 1 : count + 1]
    return sorted({(min(a, int(b)), max(a, int(b))) for a, row in enumerate(nearest) for b in row})


def _posed_model(pycolmap: Any, task: _Task) -> Any:
    """Make a COLMAP model with the photos at their poses (COLMAP's optical axis is +z, y is down)."""
    model = pycolmap.Reconstruction()
    with pycolmap.Database.open(task.database) as content:
        for camera in content.read_all_cameras():
            model.add_camera_with_trivial_rig(camera)
        for image in content.read_all_images():
            pose = np.diag([1.0, -1, -1, 1]) @ task.cameras[int(image.name[:-4])].world_to_camera
            bare = pycolmap.Image(name=image.name, camera_id=image.camera_id, image_id=image.image_id)
            model.add_image_with_trivial_frame(bare, pycolmap.Rigid3d(pose[:3]))
    return model


def _sparse_points(model: Any) -> SparsePoints:
    index = {point_id: n for n, point_id in enumerate(model.points3D)}
    points = list(model.points3D.values())
    observations = [
        (int(image.name[:-4]), index[feature.point3D_id], *feature.xy)
        for image in model.images.values()
        for feature in image.get_observation_points2D()
    ]
    view, point, *pixels = np.array(observations, np.float64).reshape(-1, 4).T
    return SparsePoints(
        positions=np.array([p.xyz for p in points], np.float64).reshape(-1, 3),
        colors=np.array([p.color for p in points], np.uint8).reshape(-1, 3),
        errors=np.array([p.error for p in points], np.float32),
        view=view.astype(np.int32),
        point=point.astype(np.int32),
        pixels=np.stack(pixels, 1).astype(np.float32),
    )
