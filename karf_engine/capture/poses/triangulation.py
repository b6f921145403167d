"""Sparse points of photos whose cameras are known: features, their matches between neighboring photos, triangulation.

All by COLMAP (Schönberger and Frahm 2016) through pycolmap, in a child process; the cameras stay as they are.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...compute.progress import Progress
from ...io.color import to_bytes
from ...io.files import naming
from ...io.images import encoded
from ..camera import Camera
from ..capture import SparsePoints
from ..training_images import TrainingImage
from .child import child_messages
from .work_folder import work_folder

MAX_FEATURES = 2500  # features of a photo
AT_ONCE = 16  # photos that share the cores
NEIGHBORS = 10  # photos that each photo is matched with
TURN = 2.0  # weight of a view's rotation against its distance in units of the rig's typical distance


@dataclass(frozen=True)
class _Task:
    """folder: holds `names` as pictures, taken by `cameras`."""

    folder: Path
    names: list[str]
    cameras: list[Camera]
    threads: int

    @property
    def database(self) -> Path:
        return self.folder / "features.db"


def triangulate(training_images: list[TrainingImage], threads: int, progress: Progress) -> SparsePoints:
    """Points that at least two of the images share; `view` numbers the images, pixels and errors are of their size.

    progress: gets one step for each training image. Raises KarfError where pycolmap fails, and what progress raises.
    """
    with work_folder(Path(tempfile.gettempdir()), "karf-points-") as folder, naming(folder):
        task = _Task(
            folder, [f"{n:05d}.png" for n in range(len(training_images))], [p.camera for p in training_images], threads
        )
        for photo, training_image in zip(task.names, training_images, strict=True):
            (task.folder / photo).write_bytes(encoded(".png", to_bytes(training_image.color)))
        with child_messages("pycolmap", _find, task) as messages:
            for kind, found in messages:
                progress.step(found if kind == "photos" else 0)
    return found


# ---------------------------------------------------------------------------------------------------------- the child
def _find(send: Callable[..., None], task: _Task) -> SparsePoints:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    _note_cameras(pycolmap, task)
    for first in range(0, len(task.names), AT_ONCE):
        names = task.names[first : first + AT_ONCE]
        _extract(pycolmap, task, names)
        send("photos", len(names))
    _match_features(pycolmap, task)
    options = pycolmap.IncrementalPipelineOptions(num_threads=task.threads)
    out = task.folder / "points"
    out.mkdir()
    model = _posed_model(pycolmap, task)
    return _sparse_points(pycolmap.triangulate_points(model, task.database, task.folder, out, options=options))


def _extract(pycolmap: Any, task: _Task, names: list[str]) -> None:
    options = pycolmap.FeatureExtractionOptions(num_threads=task.threads, use_gpu=False)
    options.sift.max_num_features = MAX_FEATURES
    options.sift.peak_threshold = 0.003  # photos of some hundred pixels have faint features only
    pycolmap.extract_features(
        task.database,
        task.folder,
        names,
        pycolmap.CameraMode.PER_IMAGE,
        pycolmap.ImageReaderOptions(camera_model="PINHOLE"),
        options,
        pycolmap.Device.cpu,
    )


def _note_cameras(pycolmap: Any, task: _Task) -> None:
    """Number the photos by their names: several are looked at at once, and any may be ready first."""
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
    """Pairs of cameras (a < b) that stand near each other and look the same way, about `count` for each."""
    positions = np.stack([camera.position for camera in cameras])
    axes = np.stack([-camera.camera_to_world[:3, 2] for camera in cameras])
    size = np.median(np.linalg.norm(positions - positions.mean(0), axis=1)) + 1e-12
    away = np.linalg.norm(positions[:, None] - positions, axis=2) / size + TURN * (1 - axes @ axes.T)
    nearest = away.argsort(1)[:, 1 : count + 1]
    return sorted({(min(a, int(b)), max(a, int(b))) for a, row in enumerate(nearest) for b in row})


def _posed_model(pycolmap: Any, task: _Task) -> Any:
    """A COLMAP model of the photos at their poses (COLMAP's cameras look down +z, y is down)."""
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
    number = {point_id: n for n, point_id in enumerate(model.points3D)}
    points = list(model.points3D.values())
    seen = [
        (int(image.name[:-4]), number[feature.point3D_id], *feature.xy)
        for image in model.images.values()
        for feature in image.get_observation_points2D()
    ]
    view, point, *pixels = np.array(seen, np.float64).reshape(-1, 4).T
    return SparsePoints(
        positions=np.array([p.xyz for p in points], np.float64).reshape(-1, 3),
        colors=np.array([p.color for p in points], np.uint8).reshape(-1, 3),
        errors=np.array([p.error for p in points], np.float32),
        view=view.astype(np.int32),
        point=point.astype(np.int32),
        pixels=np.stack(pixels, 1).astype(np.float32),
    )
