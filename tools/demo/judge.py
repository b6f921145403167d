"""Judge a finished demo by the truth of its scene: OUT/summary.json and OUT/contact_sheet.png.

Run by `tools/dev.py demo` in the engine's environment after `tools/demo/run.py`. Only held-out test views count.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import imageio.v3 as iio
import numpy as np

import karf_engine as karf
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.files import write_json
from karf_engine.io.images import write_png

from ..evaluate.judging import Pictures, baselines, ciede2000_of, outside_of
from ..evaluate.segmentation import mask_figures
from ..evaluate.views import TestViews, matted, render_test_views
from ..metrics import METRICS
from ..metrics.scores import score_pictures
from ..metrics.truth import Truth, reduced

SHEET_ROWS = 4


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    start_runtime(threads=options.threads)
    model, truth = karf.load(options.out / "project"), Truth()
    test = render_test_views(model)
    frames = recolored_frames(options.out / "frames", test, truth)
    summary = json.loads((options.out / "main_job.json").read_text()) | {"figures": figures(test, frames, truth)}
    write_json(options.out / "summary.json", summary)
    write_png(options.out / "contact_sheet.png", contact_sheet(test, frames, truth))
    report(options.out, summary)


def recolored_frames(folder: Path, test: TestViews, truth: Truth) -> Pictures:
    """Return what the demo has written for each edit, FRAMES/<edit>/<view>.png, in the size of the truth."""

    def read(edit: str, view: str) -> np.ndarray:
        return reduced(iio.imread(folder / edit / f"{view}.png")[..., :3] / 255)

    return {edit: [read(edit, image.view.name) for image in test.training_images] for edit in truth.edits}


def figures(test: TestViews, frames: Pictures, truth: Truth) -> dict[str, float]:
    """Return all figures, by the names of `tools.metrics`."""
    photos = [frame.base for frame in test.frames]
    mean, worst = score_pictures([frame.color for frame in test.frames], photos)
    splats, _ = score_pictures([test.model.render(image.camera).base for image in test.training_images], photos)
    masks = truth.masks("test")
    found = {"psnr": mean, "psnr_worst": worst, "psnr_splats": splats, **mask_figures(test, masks)}
    found |= {"iou_photo": mask_figures(matted(test), masks)["iou"], "ciede2000": ciede2000_of(frames, truth)}
    found |= {**baselines(photos, truth), "mse_outside_photo": outside_of(frames, photos, truth)}
    return {name: float(f"{value:.5g}") for name, value in found.items()}


def contact_sheet(test: TestViews, frames: Pictures, truth: Truth) -> np.ndarray:
    """Return a picture: the photo, the learned view, then each edit beside its truth; a row for some of the views."""
    rows = []
    for number in np.linspace(0, len(test.frames) - 1, SHEET_ROWS).astype(int):
        row = [test.frames[number].base, test.frames[number].color]
        for edit in truth.edits:
            row += [frames[edit][number], truth.recolored(edit)[number]]
        rows.append(np.concatenate(row, 1))
    return np.rint(255 * np.clip(np.concatenate(rows), 0, 1)).astype(np.uint8)


def report(out: Path, summary: dict) -> None:
    """Print the figures, and where everything is."""
    print(f"\n{'main job':28} {summary['seconds_main_job']} s")
    for name, value in summary["figures"].items():
        print(f"{METRICS[name].title:28} {value:{METRICS[name].format}}")
    print(f"\nframes     {out / 'frames'}\nBlender    {out / 'demo.blend'}\nsheet      {out / 'contact_sheet.png'}")
    print(f"figures    {out / 'summary.json'}")


if __name__ == "__main__":
    main()
