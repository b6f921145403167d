"""Judge a finished demo against the truth that its Cycles scene knows: OUT/summary.json and OUT/contact_sheet.png.

Run by `tools/dev.py demo` in the engine's environment after `tools/demo.py`. Only held-out test views count.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import time
from dataclasses import asdict
from pathlib import Path

import imageio.v3 as iio
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from karf_engine import settings as settings_module  # noqa: E402
from karf_engine.edit.color import to_bytes  # noqa: E402
from karf_engine.edit.compositing import delta_composite  # noqa: E402
from karf_engine.edit.metrics import psnr  # noqa: E402
from karf_engine.evaluation import palette_picture, score_edit, score_masks, score_pictures  # noqa: E402
from karf_engine.images import write_png  # noqa: E402
from karf_engine.progress import TerminalEmit  # noqa: E402
from karf_engine.project import Project, write_json  # noqa: E402
from karf_engine.stages import segmentation  # noqa: E402
from karf_engine.stages.job import open_job  # noqa: E402
from karf_engine.stages.render import Frame, Renderer  # noqa: E402
from karf_engine.wire import Request  # noqa: E402

sys.path.insert(0, str(ROOT / "tools"))
from demo_truth import DEMO, Truth  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--quick", action="store_true", help="leave the ceiling and plain cross-entropy out")
    options = parser.parse_args()
    start = time.monotonic()
    job = open_job(Request("render", options.out / "project", {"threads": options.threads}), TerminalEmit(), lambda: False)
    truth = Truth()
    renderer = Renderer(job)
    views = job.capture().split("test")
    progress = job.progress("judge", len(views))
    plates = job.plates(views)
    frames = []
    for view, plate in zip(views, plates, strict=True):
        frames.append(renderer.frame(view, plate, "field"))
        progress.step()

    summary = json.loads((options.out / "main_job.json").read_text())
    summary |= stage_facts(job.project)
    summary |= score_scene(renderer, frames, plates, truth)
    summary["iou"], summary["iou_border_excluded"] = score_objects(renderer.objects, [f.masks for f in frames], truth)
    if not options.quick:
        for name, labels, masks in (
            ("ceiling", "votes", truth.write_training_masks(options.out / "scratch" / "true_masks")),
            ("plain_cross_entropy", "masks", DEMO / "coarse_masks" / "one"),
        ):
            summary[f"iou_{name}"], summary[f"iou_border_excluded_{name}"] = compare_labels(job, name, labels, masks, truth, options)
    summary |= score_edits(truth, plates, options.out)
    summary["seconds_judging"] = round(time.monotonic() - start, 1)
    write_json(options.out / "summary.json", rounded(summary))
    contact_sheet(options.out, frames, plates, truth)
    report(options.out, rounded(summary))


def stage_facts(project: Project) -> dict:
    """What the stages noted of themselves: seconds and peak memory, bytes."""
    stages = project.state()["stages"]
    return {
        "stage_seconds": {name: facts["seconds"] for name, facts in stages.items()},
        "peak_memory": max(facts["peak_memory"] for facts in stages.values()),
    }


def score_scene(renderer: Renderer, frames: list[Frame], plates, truth: Truth) -> dict:
    """The render, the palettes' own picture of the objects, and the edit that changes nothing."""
    pictures = score_pictures([f.picture.color.numpy() for f in frames], [p.color for p in plates])
    object_psnr, identity = [], 0
    for frame, plate, labels in zip(frames, plates, truth.labels("test"), strict=True):
        mixed = palette_picture(frame.palette_weights, frame.probabilities, renderer.learned)
        shown = np.zeros_like(plate.color)
        for k, name in enumerate(renderer.objects):
            own = labels == truth.names[name]
            shown[own] = mixed[k][own]
        object_psnr.append(psnr(shown, plate.color, labels > 0))
        unchanged = delta_composite(frame.base, frame.palette_weights, renderer.learned, renderer.learned)
        identity = max(identity, int(np.abs(to_bytes(unchanged).astype(int) - to_bytes(plate.color)).max()))
    return {
        "psnr_full": pictures["psnr"],
        "psnr_full_worst": pictures["worst"],
        "ssim_full": pictures["ssim"],
        "psnr_object": float(np.mean(object_psnr)),
        "identity_max_abs": identity,
    }


def score_objects(objects: list[str], masks: list[np.ndarray], truth: Truth) -> tuple[dict, dict]:
    """IoU and border-excluded IoU of each object, and their means."""
    scores = {
        name: score_masks([m[k] for m in masks], [labels == truth.names[name] for labels in truth.labels("test")])
        for k, name in enumerate(objects)
    }
    whole = {name: score.iou for name, score in scores.items()}
    inner = {name: score.iou_border_excluded for name, score in scores.items()}
    return whole | {"mean": float(np.mean(list(whole.values())))}, inner | {"mean": float(np.mean(list(inner.values())))}


def compare_labels(job, name: str, labels: str, masks: Path, truth: Truth, options) -> tuple[dict, dict]:
    """The same field trained another way, in a scratch project that shares the geometry."""
    scratch = Project(options.out / "scratch" / name)
    shutil.rmtree(scratch.folder, ignore_errors=True)
    scratch.folder.mkdir(parents=True)
    shutil.copy(job.project.geometry_file, scratch.geometry_file)
    shutil.copy(job.project.capture_file, scratch.capture_file)
    state = job.project.state()
    state["stages"] = {"geometry": state["stages"]["geometry"]}
    changed = settings_module.with_overrides(job.settings, [f"segmentation.labels={labels}"])
    write_json(scratch.state_file, state | {"settings": settings_module.to_dict(changed)})
    request = Request("segmentation", scratch.folder, {"masks": str(masks), "threads": options.threads})
    segmentation.run(request, TerminalEmit(), lambda: False)
    other = open_job(Request("render", scratch.folder, {"threads": options.threads}), TerminalEmit(), lambda: False)
    renderer = Renderer(other)
    views = other.capture().split("test")
    return score_objects(renderer.objects, [renderer.frame(view, None, "field").masks for view in views], truth)


def score_edits(truth: Truth, plates, out: Path) -> dict:
    """Our frames against the true recolors, beside no edit and hue shifts."""
    scores = {}
    for name, edit in truth.edits.items():
        recolored = [iio.imread(out / "frames" / name / "recolor" / f"{p.view.stem}.png")[..., :3] / 255 for p in plates]
        masks = [{o: labels == truth.names[o] for o in edit["objects"]} for labels in truth.labels("test")]
        pairs = {o: truth.color_pair(name, o) for o in edit["objects"]}
        photos = [plate.color.astype(np.float64) for plate in plates]
        scores[name] = asdict(score_edit(photos, recolored, truth.recolored(name), masks, pairs))
    mean = {key: float(np.mean([score[key] for score in scores.values()])) for key in next(iter(scores.values()))}
    return {"ciede2000": scores | {"mean": mean}, "mse_outside": mean["mse_outside"]}


def contact_sheet(out: Path, frames: list[Frame], plates, truth: Truth) -> None:
    """Rows: four test views. Columns: photo, learned render, masks over the photo, then each edit and its truth."""
    rows = []
    for number in np.linspace(0, len(frames) - 1, 4).astype(int):
        photo, frame, stem = plates[number].color, frames[number], plates[number].view.stem
        tint = photo * 0.35
        for mask, color in zip(frame.masks, np.eye(3)[[0, 2, 1]], strict=False):
            tint[mask] += 0.65 * color
        row = [photo, frame.picture.color.numpy(), tint]
        for name in truth.edits:
            row.append(iio.imread(out / "frames" / name / "recolor" / f"{stem}.png")[..., :3] / 255)
            row.append(truth.recolored(name)[number])
        rows.append(np.concatenate(row, 1))
    write_png(out / "contact_sheet.png", np.concatenate(rows, 0))


def rounded(value):
    """Five significant digits: more would pretend to precision."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    return float(f"{value:.5g}") if isinstance(value, float) else value


def report(out: Path, summary: dict) -> None:
    """Print where everything is, and the figures."""
    mean = summary["ciede2000"]["mean"]
    print(f"\nmain job           {summary['seconds_main_job']} s, peak memory {summary['peak_memory'] / 2**30:.2f} GiB")
    print(f"render             {summary['psnr_full']} dB (worst view {summary['psnr_full_worst']}), objects from palettes {summary['psnr_object']} dB")
    for key in [key for key in summary if key.startswith("iou")]:
        print(f"{key:36} " + "  ".join(f"{name} {value:.3f}" for name, value in summary[key].items()))
    print(f"CIEDE2000          ours {mean['ours']}, no edit {mean['no_edit']}, hue shift {mean['hue_shift']}, "
          f"hue shift in the true masks {mean['hue_shift_in_true_mask']}")  # fmt: skip
    print(f"outside the edit   MSE {summary['mse_outside']}; unchanged palette differs by {summary['identity_max_abs']}/255")
    print(f"\nframes     {out / 'frames'}\nBlender    {out / 'demo.blend'}\nsheet      {out / 'contact_sheet.png'}")
    print(f"figures    {out / 'summary.json'}")


if __name__ == "__main__":
    main()
