"""Solve an edit from color pairs, "this color of the object becomes that color", or from a painted or graded view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.color import srgb_to_lab
from ..palettes.color_histogram import read_object_colors
from ..palettes.matching.paints import pigment_gate
from ..palettes.palette import rgb_to_hex
from ..palettes.prediction import evaluate_edit
from ..palettes.project_edit import ProjectEdit, as_color, edit_of
from ..project import Project
from .calibration import reference_light
from .options import MatchOptions


def run(options: MatchOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Solve the edit and write it; other objects keep their part of `options.edit`."""
    del should_stop  # seconds at most
    project = Project(options.project).snapshot()
    project.require("palette")
    edit = edit_of(project, options.edit)
    edit = (_match_picture if options.is_of_picture else _match_colors)(project, options, edit, emit)
    edit.save(options.out)
    emit("artifact", kind="edit", path=str(options.out))


def _match_colors(project: Project, options: MatchOptions, edit: ProjectEdit, emit: Emit) -> ProjectEdit:
    """Return the edit that turns the source colors of an object into the target colors."""
    assert options.object and options.source and options.target  # `MatchOptions` requires them
    light = reference_light(options, emit)
    pairs = [(options.source, options.target), *options.also]
    if light is not None:
        pairs = [(source, rgb_to_hex(light.photographed(as_color(target)))) for source, target in pairs]
    edit = edit.becomes(options.object, *pairs[0], options.rule, pairs[1:], options.is_metal)
    if options.rule != "paint":
        _report(edit, options.object, pairs, emit)
    return edit


def _report(edit: ProjectEdit, name: str, pairs: list[tuple[str, str]], emit: Emit) -> None:
    """Emit the share of an object that the edit repaints, and warn of missed colors."""
    palette = next(each for each in edit.palettes if each.name == name)
    seen = read_object_colors(edit.project.verified(edit.project.object_colors_file), name)
    sources = [as_color(source) for source, _ in pairs]
    for source, (before, after) in zip(sources, pairs, strict=True):
        wanted = srgb_to_lab(as_color(after))
        reached, left, reason = evaluate_edit(edit.colors[name], palette.colors, seen, source, wanted)
        if reason:
            sentence = (
                f"{name}: {before} becomes {rgb_to_hex(reached)}, not {after} (CIEDE2000 {left:.0f}), because {reason}."
            )
            emit("warning", code="missed", sentence=sentence)
    gate = np.max([pigment_gate(seen.colors, source) for source in sources], axis=0)
    share = np.average(gate, weights=seen.counts)
    emit("stage", name="match", text=f"{name}: {share:.0%} of it is of the paint that becomes another; the rest stays")


def _match_picture(project: Project, options: MatchOptions, edit: ProjectEdit, emit: Emit) -> ProjectEdit:
    """Return the edit that brings a view closest to a picture of it, and emit the remaining differences."""
    from ..compute.runtime import start_runtime
    from ..recolor.model import Model  # needs torch; color pairs do not

    assert options.view and options.picture  # `MatchOptions` requires them
    project.require("recoloring")
    runtime = start_runtime(0, options.threads, options.device)
    model = Model(project, runtime.device)
    matches = model.match(model.capture.view(options.view), options.picture, edit)
    if not matches:
        raise BadRequest(
            f"{options.picture} shows all objects of {options.view!r} as they are.",
            "Paint on the objects, or give a picture of another view.",
        )
    for match in matches:
        left = f"CIEDE2000 to the picture {match.before:.1f} before, {match.after:.1f} now"
        emit("stage", name="match", text=f"{match.name}: {left}, {100 * match.painted:.0f} % of it painted")
    return replace(edit, colors=edit.colors | {match.name: match.colors for match in matches})
