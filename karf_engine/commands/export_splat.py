"""A project's Gaussian splats as other programs read them, with an edit baked into their colors, or a file a colorway.

What an edit does not reach keeps its bits; of splats that came as .ply and leave as .ply, whole and in their place, all
other bytes of the file are kept too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest, DataError, missing_package
from ..palettes.colorways.planned import plan_colorways
from ..palettes.palette import Edit
from ..palettes.palette_files import read_edit_file
from ..project.locking import consistent, opened
from ..recolor.model import Model
from ..recolor.splat_colors import WEIGHT, columns_of
from ..splats.formats import ply
from ..splats.formats.registry import end_of, is_plain_ply, write_splats
from ..splats.formats.splat_file import SplatFile
from ..splats.gaussians import Gaussians
from ..splats.similarity import moved
from .job import Job, open_job
from .options.editing import ExportSplatOptions

MOSTLY = 0.5  # probability of an object above which a Gaussian is cut out with it
STAY = tuple(np.eye(4).ravel())


def run(options: ExportSplatOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the splats. Raises BadRequest where none are learned, or what is asked for cannot be written so."""
    if options.attributes and end_of(options.out) != ".ply":
        raise BadRequest(f"{options.out} holds no attributes.", "Give a .ply to write.")
    project = opened(options.project)
    project.require("splats")
    if options.edit or options.sheet or options.objects or options.attributes:
        project.require("recoloring")
    with consistent(project):
        job = open_job(options, emit, should_stop)
        settings = replace(job.settings, render=replace(job.settings.render, source="splats"))
        model = Model(project, job.runtime.device, settings)
    if model.splats is None:
        raise missing_package("numba")
    work = _Work(job, model, options)
    files = work.files()
    progress = job.progress("export-splat", len(files))
    for path, edit in files:
        work.write(path, edit)
        job.artifact("splats", path)
        progress.step()


class _Work:
    """The splats of a project on their way into files."""

    def __init__(self, job: Job, model: Model, options: ExportSplatOptions) -> None:
        self._job, self._model, self._options = job, model, options
        self._matrix = np.array(options.matrix or STAY, np.float64).reshape(4, 4)
        self._source = job.capture().splats
        self._rows = self._chosen_rows()
        self._original = self._original_file()
        self._own_columns = self._made_columns()

    def files(self) -> list[tuple[Path, Edit | None]]:
        """Each file and the edit that it gets; of a sheet the colorways' names are added to the file's."""
        out = self._options.out
        if self._options.sheet is not None:
            planned = plan_colorways(self._job.project, self._options.sheet)
            ends = end_of(out)
            stem = out.name[: -len(ends)]
            return [(out.with_name(f"{stem}_{plan.colorway.folder}{ends}"), plan.edit) for plan in planned]
        if self._options.edit is None:
            return [(out, None)]
        return [(out, read_edit_file(self._options.edit, self._model.palettes, self._job.settings.compositing))]

    def write(self, path: Path, edit: Edit | None) -> None:
        """Write one file."""
        gaussians = self._model.splats if edit is None else self._model.recolored_splats(edit)
        if self._keeps_bytes:
            ply.rewrite(self._original, path, gaussians.table, self._own_columns)
            return
        table = np.ascontiguousarray(moved(gaussians, self._matrix).table[self._rows])
        columns = (self._original.splats.columns if self._original else {}) | self._own_columns
        chosen = {name: column[self._rows] for name, column in columns.items()}
        write_splats(path, SplatFile(table, self._is_antialiased, chosen))

    @property
    def _is_antialiased(self) -> bool:
        return True if self._source is None else self._source.is_antialiased

    @property
    def _keeps_bytes(self) -> bool:
        is_whole = self._rows.all() and np.array_equal(self._matrix, np.eye(4))
        return is_whole and self._original is not None and not self._original.is_text

    def _original_file(self) -> ply.Original | None:
        """The .ply file that the splats came with, where more of it than Gaussians can be kept."""
        if self._source is None or end_of(self._options.out) != ".ply":
            return None
        path = self._source.path
        if not path.is_file():
            raise DataError(
                "{path}, from which the splats come, is missing.",
                "Put it back, or write another kind of file than .ply.",
                path=path,
            )
        if not is_plain_ply(path):
            return None
        original = ply.open_original(path)
        if not np.array_equal(original.splats.table, self._model.splats.table):
            raise DataError(
                "{path} has been changed since the splats were learned from it.",
                "Learn the splats again, or put the file back.",
                path=path,
            )
        return original

    def _chosen_rows(self) -> np.ndarray:
        """Which Gaussians are written, bool [n]."""
        splats: Gaussians = self._model.splats
        if not self._options.objects:
            return np.arange(len(splats)) < (splats.n_solid if self._options.solid else len(splats))
        unknown = sorted(set(self._options.objects) - set(self._model.objects))
        if unknown:
            raise BadRequest(
                f"There is no object {unknown[0]!r:.200}.", f"Objects are: {', '.join(self._model.objects)}."
            )
        numbers = [self._model.objects.index(name) for name in self._options.objects]
        are_of = self._model.splatted.shares[:, numbers] > MOSTLY
        empty = [name for name, rows in zip(self._options.objects, are_of.T, strict=True) if not rows.any()]
        if empty:
            raise BadRequest(
                f"No Gaussian is of {empty[0]!r:.200}.", "Mark it in more views and learn again, or leave it out."
            )
        return are_of.any(1)

    def _made_columns(self) -> dict[str, np.ndarray]:
        """Those that are asked for, of all rows; what an earlier export with more colors has left becomes 0."""
        if not self._options.attributes:
            return {}
        own = columns_of(self._model.splatted.shares, self._model.splatted.objects)
        foreign = self._original.splats.columns if self._original else {}
        stale = [name for name in foreign if name.startswith(WEIGHT) and name not in own]
        return own | {name: np.zeros_like(foreign[name]) for name in stale}
