"""What is expected of a capture before it is learned, beside what is then reached.

    .venv/engine/bin/python -m tools.scenes.inspections CAPTURES [SCENE ...] --out OUT [--photos N] [--holdout 8]

CAPTURES/<scene> are captures with test photos, or of which every so many-th is held out. The geometry of each is learned
into OUT by the preset `demo`, with N of its training photos in even steps (all where N is 0), and rendered in the test
views; the voxels' PSNR there is what is reached. With --judged, OUT is a folder of `judge_scenes` or `real_captures`, whose
figures are read. Prints a table, and the errors' root mean square.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import karf_engine as karf
from karf_engine.capture.advice import advise
from karf_engine.capture.capture import Capture
from karf_engine.capture.inspection import inspect_capture
from karf_engine.compute.progress import TerminalEmit
from karf_engine.io.files import read_json, write_json

from ..judging.scores import score_renders
from ..judging.views import render_test_views


def main() -> None:
    options = parse_arguments()
    scenes = options.scenes or sorted(path.name for path in options.captures.iterdir() if path.is_dir())
    print("| capture | photos | matches agreed | predicted | reached | 10 more photos | seconds |")
    print("|---|---|---|---|---|---|---|")
    errors = [compared(options, scene) for scene in scenes]
    print(f"\nroot mean square of the errors: {np.sqrt(np.mean(np.square(errors))):.1f} dB")


def compared(options: argparse.Namespace, scene: str) -> float:
    """Print a scene's row; returns predicted less reached, dB."""
    capture = karf.open_capture(options.captures / scene, holdout=options.holdout)
    if options.photos:
        capture = with_fewer(capture, options.photos)
    start = time.process_time()
    advice = advise(inspect_capture(capture))
    seconds = time.process_time() - start
    reached = read_reached(options.out / scene) if options.judged else learn(capture, options, scene)
    found = advice.inspection
    print(
        f"| {scene} | {len(found.views)} | {found.agreed:.2f} | {advice.psnr:.1f} dB{' (warned)' if advice.is_poor else ''} | "
        f"{reached:.1f} dB | +{advice.gain:.1f} dB | {seconds:.1f} |",
        flush=True,
    )
    return advice.psnr - reached


def with_fewer(capture: Capture, count: int) -> Capture:
    """The capture with this many of its training photos, in even steps by their order."""
    names = [view.name for view in capture.split("train")]
    places = np.unique(np.round((np.arange(count) + 0.5) * len(names) / count - 0.5).astype(int))
    kept = {names[place] for place in places}
    return replace(capture, views=tuple(view for view in capture.views if view.split != "train" or view.name in kept))


def learn(capture: Capture, options: argparse.Namespace, scene: str) -> float:
    """PSNR of the test views, dB; what was learned before with as many photos is read."""
    project = options.out / f"{scene}_{options.photos or 'all'}"
    file = project / "reached.json"
    if not file.exists():
        karf.learn_geometry(capture, project=project, preset="demo", threads=options.threads, emit=TerminalEmit())
        write_json(file, score_renders(render_test_views(karf.load(project))))
    return read_json(file, "scores")["psnr_full"]


def read_reached(folder: Path) -> float:
    """PSNR of a scene that was judged, dB."""
    return read_json(folder / "summary.json", "summary")["psnr_full"]


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("captures", type=Path, help="folder of the captures' folders")
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help="default: all")
    parser.add_argument("--out", type=Path, required=True, help="what is learned, or with --judged was judged")
    parser.add_argument("--judged", action="store_true", help="read what was reached from OUT/<scene>/summary.json")
    parser.add_argument("--photos", type=int, default=0, help="learn from so many of the training photos")
    parser.add_argument("--holdout", type=int, default=0, help="hold out every Nth photo where none is declared")
    parser.add_argument("--threads", type=int, default=1)
    return parser.parse_intermixed_args()


if __name__ == "__main__":
    main()
