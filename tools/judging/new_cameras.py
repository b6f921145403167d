"""What the voxels and the splats of learned projects show from cameras that took no photo. Prints JSON.

    .venv/engine/bin/python -m tools.judging.new_cameras CAPTURES PROJECTS [SCENE ...] [--set splats.FIELD=VALUE]
        [--threads N]

CAPTURES/<scene> is what `tools/scenes/make_captures.py` wrote, and PROJECTS/<scene>/project what
`tools/scenes/judge_scenes.py` learned of it; splats are learned where there are none with these settings. The cameras are
those of the test views: PSNR to their photos, the masks' mean IoU, and for edits by one color pair an object CIEDE2000 to
the true recolors in the edited objects, and MSE to the unedited picture outside of them.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.camera import Camera
from karf_engine.capture.training_images import load_views
from karf_engine.io.images import alpha_composite
from karf_engine.metrics.images import mean_ciede2000, mse_outside, psnr
from karf_engine.metrics.masks import iou
from karf_engine.project import Project
from karf_engine.project.contents import settings_for
from karf_engine.recolor.model import Model

from .recolors import edit_to_judge
from .scores import rounded
from .truth import Truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("projects", type=Path)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all that are learned")
    parser.add_argument("--set", dest="overrides", action="append", default=[], metavar="splats.FIELD=VALUE")
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    for scene in options.scenes or sorted(path.parent.name for path in options.projects.glob("*/project")):
        project, truth = options.projects / scene / "project", Truth(options.captures / scene)
        karf.learn_splats(project, overrides=options.overrides, threads=options.threads)
        scores = {source: judge(model_of(project, source), truth) for source in ("field", "splats")}
        print(json.dumps({scene: rounded(scores)}), flush=True)


def model_of(project: Path, source: str) -> Model:
    """A project whose other cameras are rendered from `field` or `splats`."""
    settings = settings_for(Project(project), "render")
    return Model(Project(project), settings=replace(settings, render=replace(settings.render, source=source)))


def judge(model: Model, truth: Truth) -> dict[str, float]:
    """The figures of one project, means over test views, objects and edits."""
    images = load_views(model.capture.split("test"), model.settings.geometry.long_side)
    cameras = [image.camera for image in images]
    frames = [model.render(camera) for camera in cameras]
    values = [
        psnr(frame.base, alpha_composite(image.color, image.alpha)) for frame, image in zip(frames, images, strict=True)
    ]
    true_masks = truth.masks("test")
    masks = [
        iou(np.stack([frame.masks[number] for frame in frames]), np.stack(true_masks[name]))
        for number, name in enumerate(model.objects)
    ]
    plain = [model.render_recolored(camera, model.edit()) for camera in cameras]
    edits = [_of_edit(model, truth, name, cameras, plain) for name in truth.edits]
    difference, outside = np.mean(edits, axis=0)
    return {
        "psnr": float(np.mean(values)),
        "psnr_worst": float(np.min(values)),
        "iou": float(np.mean(masks)),
        "ciede2000": float(difference),
        "mse_outside": float(outside),
    }


def _of_edit(
    model: Model, truth: Truth, name: str, cameras: list[Camera], plain: list[np.ndarray]
) -> tuple[float, float]:
    """CIEDE2000 inside the edited objects and MSE outside of them, beside the plain pictures; means over the views."""
    edit, found = edit_to_judge(model, truth, name), []
    views = zip(cameras, plain, truth.recolored(name), truth.inside(name), strict=True)
    for camera, unedited, true, inside in views:
        shown = model.render_recolored(camera, edit)
        found.append((mean_ciede2000(shown, true, inside), mse_outside(shown, unedited, inside)))
    difference, outside = np.nanmean(found, axis=0)  # of a view that shows no edited object there is no difference
    return float(difference), float(outside)


if __name__ == "__main__":
    main()
