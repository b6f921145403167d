"""What choke and feather do to recolored photos, and whether Blender's picture shows what is written.

    .venv/engine/bin/python -m tools.judging.edge_shapes PROJECT [--edit EDIT.json]

Of a learned project, every object in up to eight views, held-out ones where there are some. The edit is by default that
which reverses each swatch's channels. Pictures have the photo's size, or the planes' where that is smaller. Printed for
each shape: how many numbers of the pictures it changes, none with both at 0; by how much pixels change that lie further
from the object than it reaches; and CIEDE2000 of the picture of planes, as Blender has it, to the picture that is
written, in the band that the shape changes, beside the same without the shape.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.io.color import ciede2000, srgb_to_lab, to_bytes
from karf_engine.palettes.calibration import to_mean_exposure, to_photo_exposure
from karf_engine.palettes.compositing import delta_composite, stack_palettes
from karf_engine.palettes.edge_planes import apply_edges_to_planes
from karf_engine.palettes.edge_shape import EdgeShape, apply_edge_shape
from karf_engine.palettes.project_edit import ProjectEdit
from karf_engine.recolor.frames import edit_planes
from karf_engine.recolor.matting.matte import NEGLIGIBLE, dense_coverage
from karf_engine.recolor.model import Model

SHAPES = (
    EdgeShape(),
    *(EdgeShape(choke=choke) for choke in (-2.0, -1.0, 1.0, 2.0)),
    *(EdgeShape(feather=feather) for feather in (4.0, 12.0)),
    *(EdgeShape(choke, 4.0) for choke in (-2.0, 2.0)),
)
MOST_VIEWS = 8


def opposite(model: Model) -> ProjectEdit:
    """The edit that gives each swatch its channels in reverse."""
    edit = model.edit()
    for palette in model.palettes:
        for index, color in enumerate(palette.colors):
            edit = edit.swatch(palette.name, index, color[::-1].copy()) if index else edit
    return edit


def judge(model: Model, view: karf.View, edit: ProjectEdit, name: str, shape: EdgeShape) -> dict[str, float]:
    """The figures of an object in a view; those of the band are NaN where the shape changes nothing."""
    side = min(model.settings.render.preview, max(view.camera.width, view.camera.height))
    finished, with_shape = model.photo_view(view, side), edit.edge(name, shape.choke, shape.feather)
    before, after = (to_bytes(finished.over_white(finished.recolor(each))) for each in (edit, with_shape))
    k, scale = model.objects.index(name), finished.scale
    coverage = dense_coverage(finished.mattes, before.shape[:2])[k]
    reached = apply_edge_shape(coverage > 0, EdgeShape(choke=-min(16.0, shape.reach(1.0))), scale) > 0
    found = {"outside": float(np.abs(before.astype(int) - after)[~reached].max(initial=0))}
    band = np.abs(apply_edge_shape(coverage, shape, scale) - coverage) > NEGLIGIBLE
    frame = model.preview(view, side)
    if frame.base.shape != after.shape or not view.camera.is_pinhole:  # Blender shows it without its lens
        band[:] = False
    planes = edit_planes(frame, model.objects)
    palettes = model.learned_colors, stack_palettes(model.objects, edit.colors)
    shown, exposed = (
        to_mean_exposure(planes.base, planes.gains),
        [to_photo_exposure(each, planes.gains) for each in palettes],
    )
    for key, wanted, edges in (("live", after, with_shape.edges), ("live without", before, {})):
        weights, _ = apply_edges_to_planes(
            shown, planes.palette_weights, planes.probabilities, model.palettes, edges, scale
        )
        live = delta_composite(planes.base.astype(np.float32) / 255, weights, *exposed)
        off = ciede2000(srgb_to_lab(live[band]), srgb_to_lab(wanted[band] / 255))
        found[key] = float(off.mean()) if band.any() else float("nan")
    found["differ"] = float((before != after).sum())
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("project", type=Path)
    parser.add_argument("--edit", type=Path)
    args = parser.parse_args()
    model = karf.load(args.project)
    edit = model.edit(args.edit) if args.edit else opposite(model)
    views = (model.capture.split("test") or model.capture.views)[:MOST_VIEWS]
    print("| choke | feather | numbers that differ | most outside, of 255 | live to written | without the shape |")
    print("|---|---|---|---|---|---|")
    for shape in SHAPES:
        found = [judge(model, view, edit, name, shape) for view in views for name in model.objects]
        means = [np.nanmean(values) if np.isfinite(values := [each[key] for each in found]).any() else float("nan")
                 for key in ("live", "live without")]  # fmt: skip
        differ, outside = sum(each["differ"] for each in found), max(each["outside"] for each in found)
        print(
            f"| {shape.choke:g} | {shape.feather:g} | {differ:.0f} | {outside:.0f} | {means[0]:.2f} | {means[1]:.2f} |"
        )


if __name__ == "__main__":
    main()
