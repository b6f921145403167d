"""Leave Gaussians out of a project's splats, as floaters, by boxes; their file keeps them, to bring them back."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.files import link_or_copy
from ..project import Project
from ..project.locking import write_lock
from ..splats.files import load_all_gaussians, save_gaussians
from ..splats.gaussians import Gaussians
from .options import EraseOptions

SMALLEST = 1e-30  # determinant of a box
ROUNDED = 1e-5  # of its last row, from single precision


def run(options: EraseOptions, emit: Emit, should_stop: Callable[[], bool]) -> int:
    """Erase what is in the boxes, or bring all back; return how many Gaussians are erased now.

    Raises BadRequest without splats, for a matrix that makes no box, a box without splats, and where nothing
    would be left.
    """
    project = Project(options.project)
    project.require("splats")
    boxes = [_checked(np.reshape(box, (4, 4))) for box in options.boxes]
    with write_lock(project):
        path = project.verified(project.splats_file)
        gaussians, before = load_all_gaussians(path)
        erased = np.zeros_like(before) if options.restore else before | _inside(gaussians, before, boxes)
        if erased[: gaussians.n_foreground].all():
            raise BadRequest("The boxes hold all splats: nothing would be left.", "Give smaller boxes.")
        if not np.array_equal(erased, before):
            _write(project, gaussians, erased)
    count, left = int(erased.sum()), int((~erased).sum())
    emit("stage", name="erase", text=f"{count:,} Gaussians are erased, {left:,} are left")
    return count


def _checked(box: np.ndarray) -> np.ndarray:
    """Return a box. Raises BadRequest if it has no volume, or is not finite or affine."""
    is_affine = np.isfinite(box).all() and np.allclose(box[3], (0, 0, 0, 1), rtol=0, atol=ROUNDED)
    if not is_affine or abs(np.linalg.det(box[:3, :3])) < SMALLEST:
        raise BadRequest(
            "The matrix {matrix} makes no box.",
            "Give a box with a volume: a finite, invertible matrix whose last row is 0,0,0,1.",
            matrix=box.tolist(),
        )
    return box


def _inside(gaussians: Gaussians, erased: np.ndarray, boxes: Sequence[np.ndarray]) -> np.ndarray:
    """Return which centers are in a box, [n] bool. Raises BadRequest for a box with none that is not erased yet."""
    centers, found = gaussians.table[:, :3].astype(np.float64), np.zeros(len(gaussians), bool)
    for number, box in enumerate(boxes, 1):
        to_cube = np.linalg.inv(box)
        inside = (np.abs(centers @ to_cube[:3, :3].T + to_cube[:3, 3]) <= 1).all(1)
        if not (inside & ~erased).any():
            raise BadRequest(
                "Box {number} of {count} holds no splats.",
                "Move it, or make it larger; the centers of splats count.",
                number=number,
                count=len(boxes),
            )
        found |= inside
    return found


def _write(project: Project, gaussians: Gaussians, erased: np.ndarray) -> None:
    """Make a new result of the splats, with the draft of the old one."""
    result, is_detailed = project.new_result("splats"), "draft" in project.require("splats")
    try:
        save_gaussians(gaussians, result / project.splats_file.name, erased)
        if is_detailed:
            link_or_copy(project.verified(project.draft_file), result / project.draft_file.name)
        project.amend("splats", result, erased=int(erased.sum()))
    except BaseException:
        project.discard(result)
        raise
