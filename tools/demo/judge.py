"""Judge a finished demo against the truth that its Cycles scene knows: OUT/summary.json and OUT/contact_sheet.png.

Run by `tools/dev.py demo` in the engine's environment after `tools/demo/run.py`. Only held-out test views count.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import karf_engine as karf
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.files import write_json

from ..evaluate.judged_edits import contact_sheet, score_edits, score_new_cameras, score_scene
from ..evaluate.scores import print_common, rounded, score_objects, stage_summary
from ..evaluate.views import learn_again, render_test_views, with_model
from ..metrics.truth import DEMO, Truth


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--quick", action="store_true", help="leave the ceiling and plain cross-entropy out")
    options = parser.parse_args()
    start = time.monotonic()
    start_runtime(threads=options.threads)
    model = karf.load(options.out / "project")
    truth = Truth()
    test = render_test_views(model)

    summary = json.loads((options.out / "main_job.json").read_text())
    summary |= stage_summary(model.project) | score_scene(test, truth)
    true_masks = truth.masks("test")
    summary |= score_objects(test, true_masks)
    if not options.quick:
        scratch = options.out / "scratch"
        for name, labels, masks in (
            ("ceiling", "votes", truth.write_training_masks(scratch / "true_masks")),
            ("plain_cross_entropy", "masks", DEMO / "coarse_masks" / "one"),
        ):
            overrides, stages = [f"segmentation.labels={labels}"], ("segmentation",)
            other = learn_again(model, scratch / name, overrides, stages, masks, options.threads)
            summary |= score_objects(with_model(test, other), true_masks, f"_{name}")
    summary |= score_edits(truth, test, options.out / "frames") | score_new_cameras(test, truth)
    summary["seconds_judging"] = round(time.monotonic() - start, 1)
    write_json(options.out / "summary.json", rounded(summary))
    contact_sheet(options.out / "frames", options.out / "contact_sheet.png", test, truth)
    report(options.out, rounded(summary))


def report(out: Path, summary: dict) -> None:
    """Print where everything is, and the figures."""
    mean = summary["ciede2000"]["mean"]
    print(f"\nmain job           {summary['seconds_main_job']} s, peak memory {summary['peak_memory'] / 2**30:.2f} GiB")
    print_common(summary)
    print(f"objects' palettes  {summary['psnr_object']} dB")
    print(f"CIEDE2000          ours {mean['ours']}, no edit {mean['no_edit']}, hue shift {mean['hue_shift']}, "
          f"hue shift in the true masks {mean['hue_shift_in_true_mask']}")  # fmt: skip
    print("new cameras        " + ", ".join(f"{name} {value}" for name, value in summary["new_cameras"].items()))
    print(f"outside the edit   MSE {summary['mse_outside']}")
    print(f"unchanged palette  differs by {summary['identity_max_abs']}/255")
    print(f"\nframes     {out / 'frames'}\nBlender    {out / 'demo.blend'}\nsheet      {out / 'contact_sheet.png'}")
    print(f"figures    {out / 'summary.json'}")


if __name__ == "__main__":
    main()
