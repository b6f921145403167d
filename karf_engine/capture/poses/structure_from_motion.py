"""Camera poses of photos that have none, by pycolmap's incremental mapper (Schönberger and Frahm 2016) on the processor.

pycolmap cannot be interrupted everywhere, and it aborts its process where it meets what it does not expect: it works
in a child process, which is killed on cancel. The child reports by a pipe; how far it got stands in its database.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...compute.progress import Emit, Progress
from ...io.files import naming
from .child import Message, child_messages

LONG_SIDE = 1600  # pixels of the longer side of the photos in which features are found
MOST_FEATURES = 4096  # features of a photo; matching takes time with their square
SEQUENTIAL_OVERLAP = 12  # neighbors a photo is matched with on each side, then 2, 4, 8 .. times as far away
PAIR_BLOCK = 10  # photos whose features are matched between two reports
FEWEST_PHOTOS = 3
EPIPOLAR_TOLERANCE = 4.0  # pixels; a match this near to its epipolar line agrees with the poses


@dataclass(frozen=True)
class SfmTask:
    """Structure from motion to be run: of the photos `names` in the folder `photos`; work files go to the existing folder `work`, the best model
    (COLMAP's binary tables) to the existing folder `model`.

    one_lens: all photos share one lens. sequential: only neighbors in the order of the names are matched. threads: -1
    for all cores. sensitive: for small or smooth photos, more and better described features, looser matches and a
    pinhole.
    """

    photos: Path
    names: tuple[str, ...]
    work: Path
    model: Path
    one_lens: bool
    sequential: bool
    threads: int
    sensitive: bool = False

    @property
    def database(self) -> Path:
        """Where the child keeps features and matches."""
        return self.work / "database.db"

    @property
    def pairs(self) -> int:
        """About how many pairs of photos are matched."""
        count = len(self.names)
        return count * min(count - 1, 2 * SEQUENTIAL_OVERLAP) // 2 if self.sequential else count * (count - 1) // 2


@dataclass(frozen=True)
class SfmResult:
    """What came of it.

    Attributes:
        registered: Number of photos whose pose was found; 0 where no model is written.
        agreement: Share in [0, 1] of the matches between registered photos, each verified for its pair alone, that also
            fit the poses. Of a wrong model, made of places that look alike, it is much less than 1.
    """

    registered: int = 0
    agreement: float = 0.0


def reconstruct(task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Find the photos' poses and write the model.

    Raises:
        Cancelled: `should_stop` returned true.
        KarfError: pycolmap fails.
    """
    with naming(task.work), child_messages("pycolmap", _reconstruct, task) as messages:
        return _follow(messages, task, emit, should_stop)


def _follow(messages: Iterator[Message], task: SfmTask, emit: Emit, should_stop: Callable[[], bool]) -> SfmResult:
    """Report the child's progress until it has a result."""
    count = len(task.names)
    totals = {"start": 0, "features": count, "matching": task.pairs, "mapping": count}
    part, done, progress = "start", 0, Progress(emit, should_stop, "poses", count)
    for kind, value in messages:
        reached = totals[part] if kind in ("part", "result") else _reached(task.database, part, kind, value)
        if reached > done or should_stop():
            progress.step(min(reached, totals[part]) - done)
            done = min(reached, totals[part])
        if kind == "result":
            break
        if kind == "part":
            part, done, progress = value, 0, Progress(emit, should_stop, value, totals[value])
    return value


def _reached(database: Path, part: str, kind: str, value: Any) -> int:
    """How many steps of this part are done, as far as is known now."""
    if kind == "registered":
        return value
    table = {"features": "keypoints", "matching": "two_view_geometries"}.get(part)
    if table is None or not database.exists():
        return 0
    try:
        with closing(sqlite3.connect(f"{database.as_uri()}?mode=ro", uri=True, timeout=0.1)) as connection:
            return connection.execute(f"select count(*) from {table}").fetchone()[0]
    except sqlite3.Error:  # being written, or not there yet
        return 0


# ---------------------------------------------------------------------------------------------------------- the child
def _reconstruct(send: Callable[..., None], task: SfmTask) -> SfmResult:
    import pycolmap

    pycolmap.logging.minloglevel = pycolmap.logging.FATAL.value
    pycolmap.set_random_seed(0)
    send("part", "features")
    _find_features(pycolmap, task)
    send("part", "matching")
    _match_features(pycolmap, task)
    send("part", "mapping")
    return _map(pycolmap, task, lambda registered: send("registered", registered))


def _find_features(pycolmap: Any, task: SfmTask) -> None:
    reading, finding = pycolmap.ImageReaderOptions(), pycolmap.FeatureExtractionOptions()
    reading.camera_model = "SIMPLE_PINHOLE" if task.sensitive else "SIMPLE_RADIAL"
    finding.num_threads, finding.use_gpu, finding.max_image_size = task.threads, False, LONG_SIDE
    finding.sift.max_num_features = MOST_FEATURES
    if task.sensitive:
        finding.sift.peak_threshold = 0.001
        finding.sift.estimate_affine_shape = finding.sift.domain_size_pooling = True
    pycolmap.extract_features(
        task.database,
        task.photos,
        image_names=list(task.names),
        camera_mode=pycolmap.CameraMode.SINGLE if task.one_lens else pycolmap.CameraMode.AUTO,
        reader_options=reading,
        extraction_options=finding,
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
    options.min_model_size = min(10, max(FEWEST_PHOTOS, len(task.names) // 2))  # a smaller one is tried again
    if task.sensitive:
        options.min_num_matches = 8
        options.mapper.init_min_num_inliers, options.mapper.abs_pose_min_num_inliers = 30, 12
    registered = 0

    def count() -> None:
        nonlocal registered
        registered += 1
        report(registered)

    models = pycolmap.incremental_mapping(task.database, task.photos, task.work, options, next_image_callback=count)
    sane = [model for model in models.values() if not _is_bogus(model)]
    if not sane:
        return SfmResult()
    best = max(sane, key=lambda model: model.num_reg_images())
    best.write_binary(task.model)
    return SfmResult(best.num_reg_images(), _agreement(pycolmap, task.database, best))


def _agreement(pycolmap: Any, database: Path, model: Any) -> float:
    """Share of the verified matches between registered photos that lie near their epipolar lines."""
    registered = {image.image_id: image for image in model.images.values() if image.has_pose}
    with pycolmap.Database.open(database) as content:
        rays = {number: _rays(model, image, content.read_keypoints(number)) for number, image in registered.items()}
        pairs = zip(*content.read_two_view_geometries(), strict=True)
        count = agreeing = 0
        for pair_id, geometry in pairs:
            first, second = pycolmap.pair_id_to_image_pair(pair_id)
            if first in registered and second in registered:
                matches = geometry.inlier_matches
                turn = registered[second].cam_from_world() * registered[first].cam_from_world().inverse()
                errors = _epipolar_errors(turn.matrix(), rays[first][matches[:, 0]], rays[second][matches[:, 1]])
                focal = model.cameras[registered[first].camera_id].mean_focal_length()
                count += len(matches)
                agreeing += int((errors * focal < EPIPOLAR_TOLERANCE).sum())
    return agreeing / max(count, 1)


def _rays(model: Any, image: Any, keypoints: np.ndarray) -> np.ndarray:
    """Directions [n, 3] of features, in the camera with depth 1."""
    directions = model.cameras[image.camera_id].cam_from_img(keypoints[:, :2].astype(np.float64))
    return np.concatenate([directions, np.ones((len(directions), 1))], 1)


def _epipolar_errors(second_from_first: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Sampson's distance [n] of matched directions from each other's epipolar lines, at depth 1 (Hartley and Zisserman,
    Eq. 11.9). second_from_first: [3, 4]; first, second: [n, 3].
    """
    rotation, (x, y, z) = second_from_first[:, :3], second_from_first[:, 3]
    essential = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ rotation
    lines, lines_back = first @ essential.T, second @ essential
    slopes = np.hypot(np.linalg.norm(lines[:, :2], axis=1), np.linalg.norm(lines_back[:, :2], axis=1))
    return np.abs((second * lines).sum(1)) / np.maximum(slopes, np.finfo(float).tiny)


def _is_bogus(model: Any) -> bool:
    """Whether a lens of the model cannot be one: too few matches let it take any value."""
    return any(camera.has_bogus_params(0.1, 10.0, 1.0) for camera in model.cameras.values())
