"""An edit from one color pair, "this color of the object becomes that color", or from a painted or graded view."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..compute.progress import Emit
from ..errors import BadRequest
from ..io.color import srgb_to_lab
from ..palettes.colorways.reached import reached_by
from ..palettes.matching.paints import pigment_gate
from ..palettes.object_colors import read_object_colors
from ..palettes.palette import rgb_to_hex
from ..palettes.project_edit import ProjectEdit, as_color, edit_of
from ..palettes.reference_light import ReferenceLight
from ..project import Project
from ..project.locking import consistent, opened
from .calibration import light_of
from .options.editing import MatchOptions


def run(options: MatchOptions, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Solve the edit and write it; other objects keep what `edit` says of them."""
    del should_stop  # seconds at most
    project = opened(options.project)
    project.require("palette")
    edit = edit_of(project, options.edit)
    if options.is_of_picture:
        edit = _match_picture(project, options, edit, emit)
    else:
        light = light_of(options, emit)
        pairs = [(source, _in_photos(target, light)) for source, target in _pairs(options)]
        if options.rule == "added":
            for source, target in pairs:
                edit = edit.add_color(options.object, source, target)
        else:
            edit = edit.becomes(options.object, *pairs[0], options.rule, pairs[1:], options.is_metal)
            _tell(edit, options.object, pairs, emit)
    edit.save(options.out)
    emit("artifact", kind="edit", path=str(options.out))


def _pairs(options: MatchOptions) -> list[tuple[str, str]]:
    return [(options.source, options.target), *options.also]


def _in_photos(target: str, light: ReferenceLight | None) -> str:
    """A target color as photos show it, where it is meant under a reference light."""
    return target if light is None else rgb_to_hex(light.photographed(as_color(target)))


def _tell(edit: ProjectEdit, name: str, pairs: list[tuple[str, str]], emit: Emit) -> None:
    """Say how much of an object the edit repaints, and which of the colors are missed, and why."""
    palette = next(each for each in edit.palettes if each.name == name)
    seen = read_object_colors(edit.project.checked(edit.project.object_colors_file), name)
    sources = [as_color(source) for source, _ in pairs]
    for source, (before, after) in zip(sources, pairs, strict=True):
        reached, left, reason = reached_by(edit.colors[name], palette, seen, source, srgb_to_lab(as_color(after)))
        if reason:
            told = (
                f"{name}: {before} becomes {rgb_to_hex(reached)}, not {after} (CIEDE2000 {left:.0f}), because {reason}."
            )
            emit("warning", code="missed", sentence=told)
    named = np.max([pigment_gate(seen.colors, source) for source in sources], axis=0)
    share = np.average(named, weights=seen.counts)
    emit("stage", name="match", text=f"{name}: {share:.0%} of it is of the paint that becomes another; the rest stays")


def _match_picture(project: Project, options: MatchOptions, edit: ProjectEdit, emit: Emit) -> ProjectEdit:
    """The edit that brings a view closest to a picture of it; what is left is told."""
    from ..compute.runtime import start_runtime
    from ..recolor.model import Model  # needs torch, which a color pair does not

    project.require("recoloring")
    runtime = start_runtime(0, options.threads, options.device)
    with consistent(project):
        model = Model(project, runtime.device)
    matches = model.match(model.capture.view(options.view), options.picture, edit)
    if not matches:
        raise BadRequest(
            f"{options.picture} shows all objects of {options.view!r} as they are.",
            "Paint on the objects, or give a picture of another view.",
        )
    for match in matches:
        left = f"CIEDE2000 to the picture {match.before:.1f} before, {match.left:.1f} now"
        emit("stage", name="match", text=f"{match.name}: {left}, {100 * match.painted:.0f} % of it painted")
    return replace(edit, colors=edit.colors | {match.name: match.colors for match in matches})
