"""A learned scene that leaves as a splat and comes back without photos: what is lost. Prints JSON.

    python -m tools.judging.imported_splats CAPTURE PROJECT --out DIR [--preset demo] [--up z]

CAPTURE is laid out like the demo, with one rough mask an object in the one view of `coarse_masks/one`. The splats of
PROJECT are exported to DIR, imported without the photos, and learned with that view as one of one's own and the same
masks. Both projects are then judged at the capture's test cameras: IoU of each object, CIEDE2000 of each edit.
"""

from __future__ import annotations

import argparse
import json
import shutil
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture import Camera, write_cameras
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.metrics.masks import iou
from karf_engine.recolor.model import Model

from .recolors import edit_to_judge
from .truth import Truth

OWN_VIEW = "view_000"  # as an import calls the first camera of one's own


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("project", type=Path)
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="a new folder")
    parser.add_argument("--preset", default="demo")
    parser.add_argument("--up", default="auto")
    options = parser.parse_args()
    imported = come_back(options)
    truth, capture = Truth(options.capture), karf.open_capture(options.capture)
    cameras = [view.camera.reduced(imported.settings.geometry.long_side) for view in capture.split("test")]
    scores = {"photos": judge(karf.load(options.project), truth, cameras), "imported": judge(imported, truth, cameras)}
    print(json.dumps(scores, indent=1))


def come_back(options: argparse.Namespace) -> Model:
    """Export, import and learn."""
    out, masks = options.out, options.capture / "coarse_masks" / "one"
    drawn = sorted(masks.glob("*/*.png"))
    for file in drawn:
        own = out / "masks" / file.parent.name / f"{OWN_VIEW}.png"
        own.parent.mkdir(parents=True)
        shutil.copy(file, own)
    write_cameras(out / "own.json", [karf.open_capture(options.capture).view(drawn[0].stem)])
    karf.export_splat(options.project, out / "scene.ply")
    karf.import_splat(out / "scene.ply", out / "capture", cameras=out / "own.json", up=options.up, threads=1)
    return karf.learn(
        out / "capture", out / "masks", project=out / "project", preset=options.preset, threads=1, progress=print
    )


def judge(model: Model, truth: Truth, cameras: list[Camera]) -> dict[str, dict[str, float]]:
    """What test cameras show of a project, against the truth."""
    frames = [model.render(camera) for camera in cameras]
    labels = truth.masks("test")
    scores = {"iou": {}, "ciede2000": {}}
    for number, name in enumerate(model.objects):
        shown, true = (np.stack(each) for each in ([frame.masks[number] for frame in frames], labels[name]))
        scores["iou"][name] = round(iou(shown, true), 3)
    for name in truth.edits:
        edit = edit_to_judge(model, truth, name)
        views = zip(frames, truth.recolored(name), truth.inside(name), strict=True)
        found = [mean_ciede2000(model.composite(frame, edit), true, inside) for frame, true, inside in views]
        scores["ciede2000"][name] = round(float(np.mean(found)), 2)
    return scores


if __name__ == "__main__":
    main()
