"""From one color pair to an edit: "this color of the object becomes that color".

Options: object, source, target (#rrggbb), rule (becomes | fewest), edit (EDIT.json to start from), out (EDIT.json).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ..edit.match import match_becomes, match_fewest, nearest_weights
from ..edit.object_colors import read_object_colors
from ..edit.palette import Edit, Palette, hex_to_rgb, read_edit, read_palettes, write_edit
from ..errors import BadRequest
from ..locking import opened
from ..progress import Emit
from ..project import Project
from ..settings import from_dict
from ..wire import Request

RULES = ("becomes", "fewest")


def run(request: Request, emit: Emit, should_stop: Callable[[], bool]) -> None:
    """Solve the edit and write it; other objects keep what `edit` says of them."""
    del should_stop  # milliseconds
    project, options = opened(request.project), request.options
    project.require("palette")
    for name in ("object", "source", "target", "out"):
        if not options.get(name):
            raise BadRequest(f"The match was given no {name}.", "Give object, source color, target color and out.")
    palettes = read_palettes(project.checked(project.palette_file))
    compositing = from_dict(project.state()["settings"]).compositing
    edit = (
        read_edit(Path(options["edit"]), palettes, compositing)
        if options.get("edit")
        else Edit({p.name: p.colors for p in palettes}, compositing)
    )
    palette = _palette(palettes, options["object"])
    source, target = hex_to_rgb(options["source"]), hex_to_rgb(options["target"])
    edited = solve(project, palette, source, target, options.get("rule", "becomes"))
    out = Path(options["out"])
    write_edit(out, Edit(edit.colors | {palette.name: edited}, edit.compositing))
    emit("artifact", kind="edit", path=str(out))


def solve(project: Project, palette: Palette, source: np.ndarray, target: np.ndarray, rule: str) -> np.ndarray:
    """The edited palette [M, 3] with which `source` [3] becomes `target` [3] on the palette's object."""
    if rule not in RULES:
        raise BadRequest(f"Unknown rule {rule!r}.", f"Use one of: {', '.join(RULES)}.")
    colors, counts, weights = read_object_colors(project.checked(project.object_colors_file), palette.name)
    if rule == "becomes":
        return match_becomes(colors, counts, weights, palette.colors, source, target)
    return match_fewest(nearest_weights(colors, weights, source), palette.colors, target, shown=source)


def _palette(palettes: tuple[Palette, ...], name: str) -> Palette:
    for palette in palettes:
        if palette.name == name:
            return palette
    raise BadRequest(f"There is no object {name!r}.", f"Objects are: {', '.join(p.name for p in palettes)}.")
