"""The smoke run: every stage on a tiny capture in a temporary folder, with few iterations."""

from __future__ import annotations

import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from ...errors import KarfError
from ...io.failures import translate_error
from ...worker.findings import OK, Finding, error_finding

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


def stages(device: str | None = None, threads: int | None = None) -> Iterator[Finding]:
    """Run and time the stages, up to the first that fails.

    Args:
        device: As of the stages' options.
        threads: As of the stages' options; by default one, which is fastest at this size.
    """
    with tempfile.TemporaryDirectory(prefix="karf-doctor-", ignore_cleanup_errors=True) as folder:
        for name, run in _runs(Path(folder), {"device": device, "threads": threads or 1}):
            finding = _timed(name, run)
            yield finding
            if finding.status != OK:
                return


def _runs(folder: Path, run: dict[str, Any]) -> Iterator[tuple[str, Callable[[], None]]]:
    """Yield each stage's name and a call of its library function."""
    from ... import api
    from ...compute.kernels import has_kernels
    from ...palettes.project_edit import edit_of
    from ...project import Project
    from .scene import OBJECT, write_scene

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
    if has_kernels():
        yield "splats", lambda: api.learn_splats(project, **run)
    yield "render", render


def _timed(name: str, run: Callable[[], None]) -> Finding:
    start = time.monotonic()
    try:
        run()
    except Exception as error:  # any failure of a stage is a finding
        return _broken(name, error, time.monotonic() - start)
    seconds = time.monotonic() - start
    return Finding(name, OK, f"The stage {name} works: {seconds:.1f} s for a tiny scene.", seconds=round(seconds, 3))


def _broken(name: str, error: Exception, seconds: float) -> Finding:
    known = translate_error(error)
    if known is None:
        traceback.print_exception(error)
        known = KarfError(f"{error!r}.", "Report it with what was printed.")
    return error_finding(
        name, type(known)(f"The stage {name} does not run: {known.sentence}", known.hint), round(seconds, 3)
    )
