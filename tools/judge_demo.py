"""Judge a finished demo against the truth that its Cycles scene knows: OUT/summary.json and OUT/contact_sheet.png.

Run by `tools/dev.py demo` in the engine's environment after `tools/demo.py`. Only held-out test views count.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict
from pathlib import Path

import imageio.v3 as iio
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from demo_truth import DEMO, Truth
from judging import (
    TestViews,
    learn_again,
    look_again,
    open_project,
    print_common,
    render_test_views,
    rounded,
    score_objects,
    score_palettes_of,
    score_renders,
    sheet_numbers,
    stage_facts,
    tinted,
    write_sheet,
)

from karf_engine.color import to_bytes
from karf_engine.edit.compositing import delta_composite
from karf_engine.files import write_json
from karf_engine.metrics.scores import score_edit
from karf_engine.plates import Plate


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--quick", action="store_true", help="leave the ceiling and plain cross-entropy out")
    options = parser.parse_args()
    start = time.monotonic()
    job = open_project(options.out / "project", options.threads)
    truth = Truth()
    test = render_test_views(job)

    summary = json.loads((options.out / "main_job.json").read_text())
    summary |= stage_facts(job.project) | score_scene(test, truth)
    true_masks = truth.masks("test")
    summary |= score_objects(test, true_masks)
    if not options.quick:
        scratch = options.out / "scratch"
        for name, labels, masks in (
            ("ceiling", "votes", truth.write_training_masks(scratch / "true_masks")),
            ("plain_cross_entropy", "masks", DEMO / "coarse_masks" / "one"),
        ):
            other = learn_again(job, scratch / name, [f"segmentation.labels={labels}"], ("segmentation",), masks)
            summary |= score_objects(look_again(test, other), true_masks, f"_{name}")
    summary |= score_edits(truth, test.plates, options.out)
    summary["seconds_judging"] = round(time.monotonic() - start, 1)
    write_json(options.out / "summary.json", rounded(summary))
    contact_sheet(options.out, test, truth)
    report(options.out, rounded(summary))


def score_scene(test: TestViews, truth: Truth) -> dict:
    """The render, the palettes' own picture of the objects, and the edit that changes nothing."""
    model, identity = test.model, 0
    for frame, plate in zip(test.frames, test.plates, strict=True):
        unchanged = delta_composite(frame.base, frame.palette_weights, model.learned_colors, model.learned_colors)
        identity = max(identity, int(np.abs(to_bytes(unchanged).astype(int) - to_bytes(plate.color)).max()))
    palettes = score_palettes_of(test, truth.masks("test"))
    return score_renders(test) | {"psnr_object": palettes.psnr_object, "identity_max_abs": identity}


def score_edits(truth: Truth, plates: list[Plate], out: Path) -> dict:
    """Our frames against the true recolors, beside no edit and hue shifts."""
    scores = {}
    for name, edit in truth.edits.items():
        recolored = [recolored_frame(out, name, plate) for plate in plates]
        masks = [{o: labels == truth.names[o] for o in edit["objects"]} for labels in truth.labels("test")]
        pairs = {o: truth.color_pair(name, o) for o in edit["objects"]}
        photos = [plate.color.astype(np.float64) for plate in plates]
        scores[name] = asdict(score_edit(photos, recolored, truth.recolored(name), masks, pairs))
    mean = {key: float(np.mean([score[key] for score in scores.values()])) for key in next(iter(scores.values()))}
    return {"ciede2000": scores | {"mean": mean}, "mse_outside": mean["mse_outside"]}


def recolored_frame(out: Path, edit: str, plate: Plate) -> np.ndarray:
    """The main job's frame of a test view."""
    return iio.imread(out / "frames" / edit / "recolor" / f"{plate.view.name}.png")[..., :3] / 255


def contact_sheet(out: Path, test: TestViews, truth: Truth) -> None:
    """Columns: photo, learned render, masks over the photo, then each edit and its truth."""
    rows = []
    for number in sheet_numbers(len(test.frames)):
        plate, frame = test.plates[number], test.frames[number]
        row = [plate.color, frame.color, tinted(plate.color, frame.masks)]
        for name in truth.edits:
            row += [recolored_frame(out, name, plate), truth.recolored(name)[number]]
        rows.append(row)
    write_sheet(out / "contact_sheet.png", rows)


def report(out: Path, summary: dict) -> None:
    """Print where everything is, and the figures."""
    mean = summary["ciede2000"]["mean"]
    print(f"\nmain job           {summary['seconds_main_job']} s, peak memory {summary['peak_memory'] / 2**30:.2f} GiB")
    print_common(summary)
    print(f"objects' palettes  {summary['psnr_object']} dB")
    print(f"CIEDE2000          ours {mean['ours']}, no edit {mean['no_edit']}, hue shift {mean['hue_shift']}, "
          f"hue shift in the true masks {mean['hue_shift_in_true_mask']}")  # fmt: skip
    print(f"outside the edit   MSE {summary['mse_outside']}")
    print(f"unchanged palette  differs by {summary['identity_max_abs']}/255")
    print(f"\nframes     {out / 'frames'}\nBlender    {out / 'demo.blend'}\nsheet      {out / 'contact_sheet.png'}")
    print(f"figures    {out / 'summary.json'}")


if __name__ == "__main__":
    main()
