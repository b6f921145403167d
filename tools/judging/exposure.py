"""Recolors of photos that are exposed differently, beside each other and beside the truth.

    .venv/engine/bin/python -m tools.judging.exposure CAPTURE [CAPTURE ...] --out OUT [--seed 0] [--preset demo]

The photos of a capture laid out like the demo, and their true recolors, are darkened by up to one stop and tinted by up to
15 percent in red and blue, in linear light, as the seed draws. The geometry is learned once; then masks and palettes with
the gains of photos as they were found (`learned`), as they are (`known`), and all 1 (`off`). `alike` is the capture as it was.
One color pair an object is told, read in the reference photo. Of the photos whose true recolor is known:

    between    CIEDE2000 between two photos' mean recolors of the surface that both show, each without its own exposure;
               mean over pairs that share 50 pixels of an object, and over objects
    its truth  the same of the true recolors, which gloss and light leave
    to truth   mean CIEDE2000 to the true recolor, exposed as the photo is, in the true masks
    PSNR, cc   held-out photos as the learned scene shows them, plainly and color-corrected (dB)

Writes OUT/exposure.json.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.capture import UNIT_GAINS, with_gains
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.io.files import write_json
from karf_engine.metrics.images import mean_ciede2000
from karf_engine.recolor.model import Model
from tools.metrics.consistency import DepthView, match_by_depth, sample_bilinear

from .exposed_captures import ExposedCapture, exposed
from .recolors import edit_to_judge
from .scores import rounded, score_renders
from .truth import Truth
from .views import learn_again, render_test_views

SHARED = 50  # pixels that a pair of photos must share
STAGES = "segmentation", "palette", "recoloring"


@dataclass(frozen=True)
class Figures:
    """Of one capture learned in one way; see above."""

    between: float
    its_truth: float
    to_truth: float
    psnr: float
    cc_psnr: float


def judge(model: Model, changed: ExposedCapture, truth: Truth, original: Truth) -> Figures:
    """Judge the edit of most objects in the photos whose true recolor is known.

    Args:
        model: What is learned of the changed capture.
        changed: Where its photos' gains are from.
        truth: Of the changed capture.
        original: Of the capture as it was.
    """
    name = max(truth.edits, key=lambda each: len(truth.edits[each]["objects"]))
    edit = edit_to_judge(model, truth, name)
    views = [model.capture.view(stem) for stem in changed.recolored]
    gains = [changed.gains[f"train/{stem}"] for stem in changed.recolored]
    recolors = [model.recolor(view, edit) for view in views]
    to_truth = map(mean_ciede2000, recolors, truth.recolored(name), truth.inside(name))
    alike = [exposed(recolor, 1 / own) for recolor, own in zip(recolors, gains, strict=True)]
    cameras, between, its_truth = [view.camera for view in views], [], []
    for each in truth.edits[name]["objects"]:
        masks = original.masks("test")[each]
        shown = [DepthView(*parts) for parts in zip(cameras, original.depths(), masks, strict=True)]
        between.append(between_views(shown, alike))
        its_truth.append(between_views(shown, original.recolored(name)))
    render = score_renders(render_test_views(model))
    means = (float(np.mean(each)) for each in (between, its_truth, list(to_truth)))
    return Figures(*means, render["psnr_full"], render["cc_psnr_full"])


def between_views(shown: Sequence[DepthView], pictures: Sequence[np.ndarray]) -> float:
    """CIEDE2000 between the mean colors of what two views share, mean over the pairs that share enough."""
    found = []
    for first, second in combinations(range(len(shown)), 2):
        shared = match_by_depth(shown[first], shown[second])
        if len(shared.pixels) >= SHARED:
            own = pictures[first].reshape(-1, 3)[shared.pixels].mean(0)
            other = sample_bilinear(pictures[second], shared.positions).mean(0)
            found.append(ciede2000(srgb_to_lab(own), srgb_to_lab(other)))
    return float(np.mean(found))


def judge_capture(source: Path, out: Path, options: argparse.Namespace) -> dict[str, Figures]:
    """Make the changed capture, learn it in all ways, and judge each."""
    run, found = {"preset": options.preset, "threads": options.threads}, {}
    for title, seed in {"alike": None, "changed": options.seed}.items():
        changed = ExposedCapture(source, out / title / "capture", seed)
        project, masks = out / title / "project", changed.folder / "coarse_masks" / "one"
        karf.learn_geometry(changed.folder, project=project, **run)
        model = karf.load(project)
        ways = {"alike": {}}
        if seed is not None:
            off = {view.name: UNIT_GAINS for view in model.capture.views}
            ways = {"off": off, "learned": {}, "known": changed.known_gains(source)}
        for way, gains in ways.items():
            capture = with_gains(model.capture, gains)
            learned = learn_again(model, out / f"with_{way}", [], STAGES, masks, options.threads, capture)
            found[way] = judge(learned, changed, Truth(changed.folder), Truth(source))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path, nargs="+", metavar="CAPTURE")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=0, help="of the gains (default: 0)")
    parser.add_argument("--preset", default="demo")
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    figures = {}
    print("| capture | gains | between | its truth | to truth | PSNR | cc |\n|---|---|---|---|---|---|---|")
    for capture in options.captures:
        figures[capture.name] = judge_capture(capture, options.out / capture.name, options)
        for way, own in figures[capture.name].items():
            values = " | ".join(f"{value:.2f}" for value in asdict(own).values())
            print(f"| {capture.name} | {way} | {values} |", flush=True)
    write_json(
        options.out / "exposure.json",
        {name: {way: rounded(asdict(own)) for way, own in ways.items()} for name, ways in figures.items()},
    )


if __name__ == "__main__":
    main()
