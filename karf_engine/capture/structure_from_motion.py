"""Estimate camera poses of photos, or of a video's sharpest frames, by pycolmap's incremental mapper on the CPU.

pycolmap (Schönberger and Frahm 2016) cannot be interrupted everywhere, and may abort its process, so it runs in a child
process. The child reports by a pipe; progress within a phase is read from its database.
"""

from __future__ import annotations

import sqlite3
import sys
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ..compute.progress import Emit, Progress
from ..errors import Cancelled, DataError
from ..io.files import check_file, errors_naming_path, library_path
from ..io.images import write_png
from .child_process import Message, child_messages

LONG_SIDE = 1600  # longer side for feature extraction, pixels
MOST_FEATURES = 4096  # per photo; matching time grows with the square
SEQUENTIAL_OVERLAP = 12  # neighbors matched on each side, then those 2, 4, 8, ... times as far away
PAIR_BLOCK = 10  # photos matched between two reports
FEWEST_PHOTOS = 3
MOST_FRAMES = 100  # of a video
SHARPNESS_WIDTH = 480  # width of the measured frame, pixels; at full size grain counts as sharpness
EPIPOLAR_TOLERANCE = 4.0  # pixels; matches closer to their epipolar line agree with the poses


@dataclass(frozen=True)
class SfmTask:
    """Options of a structure-from-motion run."""

    photos: Path  # folder of the photos
    names: tuple[str, ...]
    work: Path  # existing folder for temporary files
    model: Path  # existing folder for the best model, as COLMAP's binary tables
    single_camera: bool  # all photos share one lens
    sequential: bool  # match only neighbors in the order of the names
    threads: int  # -1 for all cores
    sensitive: bool = False  # for small or smooth photos: more features, looser matches and a pinhole model

    @property
    def database(self) -> Path:
        return self.work / "database.db"

    @property
    def pairs(self) -> int:
        """Approximate number of photo pairs to match."""
        count = len(self.names)
        return count * min(count - 1, 2 * SEQUENTIAL_OVERLAP) // 2 if self.sequential else count * (count - 1) // 2


@dataclass(frozen=True)
class SfmResult:
    """Result of a structure-from-motion run."""

    registered: int = 0  # number of photos with a pose; 0 if no model was written
    # share in [0, 1] of the pairwise verified matches that fit the poses; low for wrong models of repeated structures
    agreement: float = 0.0


def reconstruct(task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Estimate the photos' poses and write the model. Raises Cancelled, or KarfError if pycolmap failed."""
    with errors_naming_path(task.work), child_messages("pycolmap", _reconstruct, task) as messages:
        return _follow(messages, task, emit, should_stop)


def _follow(messages: Iterator[Message], task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Report the child's progress and return its result."""
    count, value = len(task.names), None
    totals = {"start": 0, "features": count, "matching": task.pairs, "mapping": count}
    phase, done, progress = "start", 0, Progress(emit, should_stop, "poses", count)
    for kind, value in messages:
        steps = totals[phase] if kind in ("phase", "result") else _steps_done(task.database, phase, kind, value)
        if steps > done or should_stop():
            progress.step(min(steps, totals[phase]) - done)
            done = min(steps, totals[phase])
        if kind == "result":
            break
        if kind == "phase":
            phase, done, progress = value, 0, Progress(emit, should_stop, value, totals[value])
    assert isinstance(value, SfmResult)
    return value


def _steps_done(database: Path, phase: str, kind: str, value: Any) -> int:
    """Return the number of finished steps of a phase, as far as known."""
    if kind == "registered":
        return value
    table = {"features": "keypoints", "matching": "two_view_geometries"}.get(phase)
    if table is None or not database.exists():
        return 0
    try:
        with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True, timeout=0.1)) as connection:
            return connection.execute(f"select count(*) from {table}").fetchone()[0]
    except sqlite3.Error:  # locked, or the table does not exist yet
        return 0


# ---------------------------------------------------------------------------------------------------------- the child
def _reconstruct(send: Callable[..., None], task: SfmTask) -> SfmResult:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    pycolmap.set_random_seed(0)
    send("phase", "features")
    _extract_features(pycolmap, task)
    send("phase", "matching")
    _match_features(pycolmap, task)
    send("phase", "mapping")
    return _map(pycolmap, task, lambda registered: send("registered", registered))


def _extract_features(pycolmap: Any, task: SfmTask) -> None:
    reading, extraction = pycolmap.ImageReaderOptions(), pycolmap.FeatureExtractionOptions()
    reading.camera_model = "SIMPLE_PINHOLE" if task.sensitive else "SIMPLE_RADIAL"
    extraction.num_threads, extraction.use_gpu, extraction.max_image_size = task.threads, False, LONG_SIDE
    extraction.sift.max_num_features = MOST_FEATURES
    if task.sensitive:
        extraction.sift.peak_threshold = 0.001
        extraction.sift.estimate_affine_shape = extraction.sift.domain_size_pooling = True
    pycolmap.extract_features(
        task.database,
        task.photos,
        image_names=list(task.names),
        camera_mode=pycolmap.CameraMode.SINGLE if task.single_camera else pycolmap.CameraMode.AUTO,
        reader_options=reading,
        extraction_options=extraction,
        device=pycolmap.Device.cpu,
    )


def _match_features(pycolmap: Any, task: SfmTask) -> None:
    matching = pycolmap.FeatureMatchingOptions()
    matching.num_threads, matching.use_gpu = task.threads, False
    if task.sensitive:
        matching.sift.max_ratio = 0.9
    if task.sequential:
        pairing, match = pycolmap.SequentialPairingOptions(), pycolmap.match_sequential
        pairing.overlap = SEQUENTIAL_OVERLAP
    else:
        pairing, match = pycolmap.ExhaustivePairingOptions(), pycolmap.match_exhaustive
        pairing.block_size = PAIR_BLOCK
    match(task.database, matching_options=matching, pairing_options=pairing, device=pycolmap.Device.cpu)


def _map(pycolmap: Any, task: SfmTask, report: Callable[[int], None]) -> SfmResult:
    options = pycolmap.IncrementalPipelineOptions()
    options.num_threads = options.mapper.num_threads = task.threads
    options.random_seed = 0
    options.min_model_size = min(10, max(FEWEST_PHOTOS, len(task.names) // 2))  # smaller models are retried
    if task.sensitive:
        options.min_num_matches = 8
        options.mapper.init_min_num_inliers, options.mapper.abs_pose_min_num_inliers = 30, 12
    registered = 0

    def count() -> None:
        nonlocal registered
        registered += 1
        report(registered)

    models = pycolmap.incremental_mapping(task.database, task.photos, task.work, options, next_image_callback=count)
    plausible = [  # too few matches allow impossible intrinsics
        model
        for model in models.values()
        if not any(camera.has_bogus_params(0.1, 10.0, 1.0) for camera in model.cameras.values())
    ]
    if not plausible:
        return SfmResult()
    best = max(plausible, key=lambda model: model.num_reg_images())
    best.write_binary(task.model)
    return SfmResult(best.num_reg_images(), _agreement(pycolmap, task.database, best))


def _agreement(pycolmap: Any, database: Path, model: Any) -> float:
    """Return the share of verified matches between registered photos near their epipolar lines."""
    registered = {image.image_id: image for image in model.images.values() if image.has_pose}
    with pycolmap.Database.open(database) as content:
        rays = {number: _rays(model, image, content.read_keypoints(number)) for number, image in registered.items()}
        pairs = zip(*content.read_two_view_geometries(), strict=True)
        count = agreeing = 0
        for pair_id, geometry in pairs:
            first, second = pycolmap.pair_id_to_image_pair(pair_id)
            if first in registered and second in registered:
                matches = geometry.inlier_matches
                relative = registered[second].cam_from_world() * registered[first].cam_from_world().inverse()
                errors = _sampson_errors(relative.matrix(), rays[first][matches[:, 0]], rays[second][matches[:, 1]])
                focal = model.cameras[registered[first].camera_id].mean_focal_length()
                count += len(matches)
                agreeing += int((errors * focal < EPIPOLAR_TOLERANCE).sum())
    return agreeing / max(count, 1)


def _rays(model: Any, image: Any, keypoints: np.ndarray) -> np.ndarray:
    """Return the directions [n, 3] of features in the camera, with depth 1."""
    directions = model.cameras[image.camera_id].cam_from_img(keypoints[:, :2].astype(np.float64))
    return np.concatenate([directions, np.ones((len(directions), 1))], 1)


def _sampson_errors(second_from_first: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return Sampson distances [n] of matched directions [n, 3] at depth 1 (Hartley and Zisserman, Eq. 11.9)."""
    rotation, (x, y, z) = second_from_first[:, :3], second_from_first[:, 3]
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ rotation
    lines, lines_back = first @ essential.T, second @ essential
    slopes = np.hypot(np.linalg.norm(lines[:, :2], axis=1), np.linalg.norm(lines_back[:, :2], axis=1))
    return np.abs((second * lines).sum(1)) / np.maximum(slopes, np.finfo(float).tiny)


# ---------------------------------------------------------------------------------------------------------------- video
def write_sharpest_frames(video: Path, folder: Path, should_stop: Callable[[], bool]) -> list[str]:
    """Write about 100 frames at most, evenly spaced, as `frame_0001.png` ... into `folder`, and return their names.

    Frames are rotated as the video declares. Raises DataError if the file is not a readable video, or Cancelled.
    """
    names: list[str] = []
    segment = max(1, round(_count_frames(video, should_stop) / MOST_FRAMES))
    best, best_sharpness = np.empty(0), -1.0
    for number, reader in enumerate(_frames(video, should_stop), 1):
        frame = reader.retrieve()[1]
        sharpness = _sharpness(frame)
        if sharpness > best_sharpness:
            best, best_sharpness = frame, sharpness
        if number % segment == 0:
            names.append(f"frame_{len(names) + 1:04d}.png")
            write_png(folder / names[-1], cv2.cvtColor(best, cv2.COLOR_BGR2RGB))
            best_sharpness = -1.0
    return names


def _count_frames(video: Path, should_stop: Callable[[], bool]) -> int:
    """Count the frames, since headers are unreliable."""
    check_file(video, sys.maxsize)
    count = sum(1 for _ in _frames(video, should_stop))
    if count == 0:
        raise DataError(
            "{path} is not a video that can be read.", "Give a folder of photos, or an MP4 video.", path=video
        )
    return count


def _frames(video: Path, should_stop: Callable[[], bool]) -> Iterator[cv2.VideoCapture]:
    """Yield the reader at each frame; its `retrieve` decodes the frame as BGR."""
    with library_path(video) as readable:
        reader = cv2.VideoCapture(readable)
    try:
        while reader.grab():
            if should_stop():
                raise Cancelled(f"Reading {video} was cancelled.", "Start it again when you like.")
            yield reader
    finally:
        reader.release()


def _sharpness(frame: np.ndarray) -> float:
    """Return the variance of the Laplacian, which blur lowers."""
    gray = cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)
    scale = min(1.0, SHARPNESS_WIDTH / gray.shape[1])
    small = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return float(cv2.Laplacian(small, cv2.CV_32F).var())
