"""Heads and losses over seeds and captures, with deviations and a paired test: docs/results/seeds.json.

    .venv/engine/bin/python -m tools.experiments.seeds NAME=PROJECT ... [--seeds 5] [--threads 1]

Each PROJECT is learned with the preset `demo`. F_w and the palette are learned again on its segmentation, in every way and
with every seed; all ways of a capture share the masks in which they are judged.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.stats import ttest_1samp

import karf_engine as karf

from ..judging.scores import score_palettes_of
from ..judging.views import TestViews, render_test_views
from . import page
from .ablations import ABLATIONS
from .bench import ITERATIONS, ablation, samples_of
from .stamp import stamp
from .table import Row, Table, show

FULL = "**w/ All** (ours): GRBF, hull palette"
WAYS = (
    FULL,
    "w/o Res",
    "w/ Gate",
    "MLP layers, equal parameters",
    "w/o L_Palette",
)


def main() -> None:
    options = parse_arguments()
    start = time.monotonic()
    table = seeds_table(options.projects, options.seeds, options.threads)
    show("seeds", table)
    captures = " ".join(f"{name}=PROJECT" for name in options.projects)
    command = f"python -m tools.experiments.seeds {captures} --seeds {options.seeds}"
    page.write_table("seeds", table.as_json(stamp(command, "demo", (), options.threads, time.monotonic() - start)))


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "projects", nargs="+", metavar="NAME=PROJECT", help="learned projects, and their captures' names"
    )
    parser.add_argument("--seeds", type=int, default=5, help="of each way (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1, help="processor threads (default: %(default)s)")
    options = parser.parse_args()
    options.projects = {name: Path(path) for name, _, path in (text.partition("=") for text in options.projects)}
    return options


def seeds_table(projects: dict[str, Path], seeds: int, threads: int) -> Table:
    """PSNR of the objects in every way, and how it differs from that of the full block."""
    found = {name: measure(project, seeds, threads) for name, project in projects.items()}
    rows = [[way, *(cell(scores[way]) for scores in found.values()), *difference(found, way)] for way in WAYS]
    return Table(
        "Over seeds and captures",
        f"PSNR of the objects as palettes and F_w mix them, inside our own masks of the held-out views: mean ± standard "
        f"deviation over {seeds} seeds of F_w's training, on one segmentation of each capture. All ways begin with the same "
        "seeds. Difference: to w/ All, mean ± standard deviation over captures. p: of a t-test that the captures' mean "
        "differences are around 0 (two-sided, as many pairs as captures, and not corrected for the number of ways). Better: "
        "captures on which a way's mean is ahead. 250 iterations; what 1,000 change stands under Ablations.",
        (
            ("F_w", ""),
            *((name, "") for name in projects),
            ("difference", ""),
            ("p", ".3f"),
            ("better on", ""),
        ),
        rows,
    )


def measure(project: Path, seeds: int, threads: int) -> dict[str, list[float]]:
    """PSNR inside the objects, dB, of every way and seed."""
    test = with_objects(render_test_views(karf.load(project)))
    samples, masks = samples_of(test), {name: test.masks(name) for name in test.model.objects}
    scores: dict[str, list[float]] = {way: [] for way in WAYS}
    with tempfile.TemporaryDirectory() as scratch:
        for way in WAYS:
            for seed in range(seeds):
                learned = ablation(
                    test, samples, Path(scratch) / "project", (ITERATIONS["demo"], *ABLATIONS[way]), seed, threads
                )
                scores[way].append(score_palettes_of(learned, masks).psnr_object)
            print(f"{project} {way}: {scores[way]}", flush=True)
    return scores


def with_objects(test: TestViews) -> TestViews:
    """The test views that show an object."""
    shown = [number for number, frame in enumerate(test.frames) if frame.masks.any()]
    return TestViews(test.model, [test.training_images[n] for n in shown], [test.frames[n] for n in shown])


def cell(scores: list[float]) -> str:
    return f"{np.mean(scores):.2f} ± {np.std(scores, ddof=1):.2f}"


def difference(found: dict[str, dict[str, list[float]]], way: str) -> Row:
    """Mean ± deviation over captures of a way's mean difference to the full block, its p, and on how many it is ahead."""
    if way == FULL:
        return [None, None, None]
    means = np.array([np.mean(scores[way]) - np.mean(scores[FULL]) for scores in found.values()])
    ahead = f"{(means > 0).sum()} of {len(means)}"
    return [f"{means.mean():+.2f} ± {means.std(ddof=1):.2f}", float(ttest_1samp(means, 0).pvalue), ahead]


if __name__ == "__main__":
    main()
