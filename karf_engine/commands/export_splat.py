"""Export a project's Gaussian splats for other programs, with an edit baked into their colors, or a file per colorway.

Gaussians that the edit does not change keep their bits. An imported .ply file, exported whole, as .ply and without a
transform, keeps all other bytes too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest, DataError, missing_package
from ..palettes.colorways import plan_colorways
from ..palettes.palette import Edit
from ..palettes.palette_files import read_edit_file
from ..project import Project
from ..recolor.model import Model
from ..recolor.splatted_scene import WEIGHT, columns_of
from ..splats.files import load_all_gaussians
from ..splats.formats import ply
from ..splats.formats.registry import end_of, is_plain_ply, write_splats
from ..splats.formats.splat_file import SplatFile
from ..splats.similarity import transform_gaussians
from .job import Job, open_job
from .options import ExportSplatOptions

MIN_PROBABILITY = 0.5  # above which a Gaussian belongs to an object


def run(options: ExportSplatOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Write the splats. Raises BadRequest where none are learned, or the format cannot store the request."""
    if options.attributes and end_of(options.out) != ".ply":
        raise BadRequest(f"{options.out} holds no attributes.", "Give a .ply to write.")
    project = Project(options.project).snapshot()
    project.require("splats")
    if options.edit or options.sheet or options.objects or options.attributes:
        project.require("recoloring")
    job = open_job(options, emit, should_stop, project)
    model = load_splats(job)
    exporter = _Exporter(job, model, options)
    files = exporter.files()
    progress = job.progress("export-splat", len(files))
    for path, edit in files:
        exporter.write(path, edit)
        job.artifact("splats", path)
        progress.step()


def load_splats(job: Job) -> Model:
    """Load the model of a job whose project has splats, whatever its settings render from."""
    settings = replace(job.settings, render=replace(job.settings.render, source="splats"))
    model = Model(job.project, job.runtime.device, settings)
    if model.splats is None:
        raise missing_package("numba")
    return model


class _Exporter:
    """Writes the splats of a model to files."""

    def __init__(self, job: Job, model: Model, options: ExportSplatOptions) -> None:
        assert model.splatted is not None
        self._job, self._model, self._options = job, model, options
        self._splatted, self._splats = model.splatted, model.splatted.gaussians
        self._matrix = np.eye(4) if options.matrix is None else np.array(options.matrix, np.float64).reshape(4, 4)
        self._source = job.capture().splats
        self._rows = self._chosen_rows()
        self._original = self._original_file()
        self._attributes = self._attribute_columns()

    def files(self) -> list[tuple[Path, Edit | None]]:
        """Return each file with its edit; the files of a sheet are named by colorway."""
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
        gaussians = self._splats if edit is None else self._model.recolored_splats(edit)
        is_whole = self._rows.all() and np.array_equal(self._matrix, np.eye(4))
        if is_whole and self._original is not None and not self._original.is_text and self._kept.all():
            ply.rewrite(self._original, path, gaussians.table, self._attributes)
            return
        table = np.ascontiguousarray(transform_gaussians(gaussians, self._matrix).table[self._rows])
        columns = {**self._foreign_columns, **self._attributes}
        chosen = {name: column[self._rows] for name, column in columns.items()}
        is_antialiased = self._source is None or self._source.is_antialiased
        write_splats(path, SplatFile(table, is_antialiased, chosen), self._options.spz_version)

    @property
    def _foreign_columns(self) -> Mapping[str, np.ndarray]:
        if self._original is None:
            return {}
        return {name: column[self._kept] for name, column in self._original.splats.columns.items()}

    @cached_property
    def _kept(self) -> np.ndarray:
        """The rows of the original that are not erased, [n] bool."""
        return ~load_all_gaussians(self._model.project.splats_file)[1]

    def _original_file(self) -> ply.Original | None:
        """Return the imported .ply file where its other contents can be kept."""
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
        table = original.splats.table
        if len(table) != len(self._kept) or not np.array_equal(table[self._kept], self._splats.table):
            raise DataError(
                "{path} has been changed since the splats were learned from it.",
                "Learn the splats again, or put the file back.",
                path=path,
            )
        return original

    def _chosen_rows(self) -> np.ndarray:
        """Return the mask of the Gaussians to write, bool [n]."""
        splats = self._splats
        if not self._options.objects:
            return np.arange(len(splats)) < (splats.n_foreground if self._options.solid else len(splats))
        unknown = sorted(set(self._options.objects) - set(self._model.objects))
        if unknown:
            raise BadRequest(
                f"There is no object {unknown[0]!r:.200}.", f"Objects are: {', '.join(self._model.objects)}."
            )
        numbers = [self._model.objects.index(name) for name in self._options.objects]
        belongs = self._splatted.shares[:, numbers] > MIN_PROBABILITY
        empty = [name for name, rows in zip(self._options.objects, belongs.T, strict=True) if not rows.any()]
        if empty:
            raise BadRequest(
                f"No Gaussian is of {empty[0]!r:.200}.", "Mark it in more views and learn again, or leave it out."
            )
        return np.any(belongs, axis=1)

    def _attribute_columns(self) -> dict[str, np.ndarray]:
        """Return the requested attributes of all rows; weights of an earlier export with more colors become 0."""
        if not self._options.attributes:
            return {}
        own = columns_of(self._splatted.shares, self._splatted.objects)
        foreign = self._foreign_columns
        stale = [name for name in foreign if name.startswith(WEIGHT) and name not in own]
        return own | {name: np.zeros_like(foreign[name]) for name in stale}
