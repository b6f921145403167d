"""Pictures of splats beside those of the field they were begun on: milliseconds by size, and held-out photos."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np

from karf_engine.capture.training_images import TrainingImage
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.images import alpha_composite
from karf_engine.project import Project
from karf_engine.project.contents import settings_for
from karf_engine.project.settings import Settings
from karf_engine.recolor.model import Model
from tools.speed.rows import Row, median_seconds

SIDES = (256, 800, 1600)  # pixels of the long side
FIELD_SIDES = SIDES[:1]  # at which the field is asked too: a larger picture of it takes minutes
REPEATS = 5


def run(project: Path, threads: int) -> tuple[list[Row], list[Row]]:
    """Times, and PSNR of the held-out photos at the size that was learned from, of splats and field."""
    start_runtime(0, threads, "cpu")
    splats = Model(Project(project), settings=_rendering(project, "splats"))
    field = Model(Project(project), settings=_rendering(project, "field"))
    if splats.splats is None:
        raise SystemExit(f"{project} has no finished splats stage. Run: karf splats {project}")
    views = splats.capture.split("test")
    camera = splats.working_camera((views or splats.capture.views)[0])
    edit = splats.edit() if splats.palettes else None
    feathered = (edit.edge(splats.objects[0], 0, 4 + 4 * share) for share in cycle((0.0, 0.5, 1.0)))
    cases = {}
    for side in SIDES:
        factor = side / max(camera.width, camera.height)
        scaled = camera.scaled(round(camera.width * factor), round(camera.height * factor))
        if edit is not None:
            cases["recolored splats", side] = lambda scaled=scaled: splats.render_recolored(scaled, edit)
            cases["with a dragged feather", side] = lambda scaled=scaled: splats.render_recolored(
                scaled, next(feathered)
            )
        cases["splats with planes", side] = lambda scaled=scaled: splats.render(scaled)
        if side in FIELD_SIDES:
            cases["field with planes", side] = lambda scaled=scaled: field.render(scaled)
    seconds = median_seconds(cases, REPEATS)
    times = [{"what": what, "side": side, "ms": round(1000 * value)} for (what, side), value in seconds.items()]
    images = [splats.training_image(view) for view in views]
    return times, [_held_out("field", field, images), _held_out("splats", splats, images)] if images else []


def _rendering(project: Path, source: str) -> Settings:
    settings = settings_for(Project(project), "render")
    return replace(settings, render=replace(settings.render, source=source))


def _held_out(name: str, model: Model, images: Sequence[TrainingImage]) -> Row:
    values = []
    for image in images:
        squares = np.square(model.render(image.camera).base - alpha_composite(image.color, image.alpha))
        values.append(-10 * np.log10((squares if image.valid is None else squares[image.valid]).mean()))
    return {
        "what": name,
        "photos": len(values),
        "mean_db": round(np.mean(values), 2),
        "worst_db": round(min(values), 2),
    }
