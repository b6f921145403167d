"""What the story needs before Blender opens: the desk that it works on, and what the script inside is to know."""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import imageio.v3 as imageio
import numpy as np

from karf_engine.io.images import write_png
from karf_engine.project import Project

from . import capture
from .blender import dump
from .drawn_chart import CORNERS, photo_of_chart

ROOT = Path(__file__).resolve().parents[2]
DEMO = ROOT / "demo"
POTS = "pots"  # the demo's capture on the desk
CHART = "chart.png"  # a photo of a color chart on it
MASKED_VIEW = "r_041"
STROKE_ROWS = 18  # pixels of the photo between two strokes
TINY = (
    "geometry.long_side=96",
    'geometry.levels=[{"voxels": 32, "iterations": 80, "step": 1.0}, {"voxels": 56, "iterations": 120, "step": 0.75}]',
    "geometry.samples=16000",
    "geometry.max_rays=2048",
    "segmentation.iterations=120",
    "segmentation.width=16",
    "recoloring.iterations=40",
    "recoloring.width=16",
)
BRUSH = 6  # its radius, about, pixels of the photo


def engine_python() -> Path:
    """This Python, which is the engine's."""
    return Path(sys.prefix) / "bin" / "python"


def engine_folders() -> list[Path]:
    """What the engine's Python consists of, wherever links lead."""
    return [Path(sys.prefix), Path(sys.prefix).resolve(), Path(sys.base_prefix).resolve()]


def prepare(out: Path, options: argparse.Namespace) -> None:
    """Lay out OUT, new where the whole story is told: the extension's package, and the story's desk."""
    (out / "record.jsonl").unlink(missing_ok=True)
    shutil.rmtree(out / "shots", ignore_errors=True)
    (out / "shots").mkdir(parents=True)
    if options.only:
        return
    for name in ("desk", "user", "screen", "blender.log", "facts.json"):
        path = out / name
        shutil.rmtree(path, ignore_errors=True) if path.is_dir() else path.unlink(missing_ok=True)
    for folder in ("desk/here/sub", "user", "screen"):
        (out / folder).mkdir(parents=True)
    shutil.copy(max((ROOT / "dist").glob("karf-*.zip"), key=lambda file: file.stat().st_mtime), out / "karf.zip")
    if options.story == "first-color":
        capture.lay_out(options.capture, out / "desk" / options.capture.name)
        return
    capture.lay_out(DEMO, out / "desk" / POTS)
    write_png(out / "desk" / CHART, photo_of_chart())
    make_decoy(out)


def make_decoy(out: Path) -> None:
    """A project of the same objects with other colors."""
    masks = out / "decoy_masks"
    for name, other in (("pot", "mug"), ("mug", "pot")):
        shutil.copytree(DEMO / "coarse_masks" / "three" / other, masks / name, dirs_exist_ok=True)
    command = [
        sys.executable,
        "-m",
        "karf_engine",
        "all",
        str(out / "desk" / POTS),
        "--masks",
        str(masks),
        "--threads",
        "1",
    ]
    command += ["--project", str(out / "decoy"), *(part for text in TINY for part in ("--set", text))]
    if not Project(out / "decoy").palette_file.exists():
        subprocess.run(command, cwd=ROOT, check=True, capture_output=True)


def strokes(name: str) -> list[list[tuple[float, float]]]:
    """Brush strokes over an object: back and forth through its rough mask, in shares of the picture from the lower left."""
    mask = imageio.imread(DEMO / "coarse_masks" / "one" / name / f"{MASKED_VIEW}.png")
    mask = mask.reshape(*mask.shape[:2], -1)[..., 0] > 127
    height, width = mask.shape
    rows = np.flatnonzero(mask.any(1))
    lines = []
    for row in rows[STROKE_ROWS // 2 : -STROKE_ROWS // 2 : STROKE_ROWS]:
        columns = np.flatnonzero(mask[row])
        first, last = columns[0] + BRUSH, columns[-1] - BRUSH
        lines.append([(float(x) / width, 1 - float(row) / height) for x in np.linspace(first, last, 5)])
    return lines


def in_shares(corners: np.ndarray) -> list[list[float]]:
    """Corners in the chart's photo, in shares of it from the lower left; corners: [4, 2] pixels from its upper left."""
    height, width = photo_of_chart().shape[:2]
    return [[float(u) / width, 1 - float(v) / height] for u, v in corners]


def afternoon_job() -> dict:
    """What only the afternoon's steps are to know."""
    return {
        "tiny": TINY,
        "views": sum(len(list((DEMO / name).glob("*.png"))) for name in ("train", "test")),
        "masked_view": MASKED_VIEW,
        "strokes": {name: strokes(name) for name in ("apple", "mug", "pot")},
        "chart": CHART,
        "chart_corners": in_shares(CORNERS),
    }


def first_color_job(out: Path, options: argparse.Namespace) -> dict:
    """What only the steps of the first color are to know."""
    seen = capture.look(out / "desk" / options.capture.name, truth_of(out, options))
    return asdict(seen) | {"capture": options.capture.name, "preset": options.preset}


def truth_of(out: Path, options: argparse.Namespace) -> Path:
    """The folder of the object's known masks."""
    return options.truth or capture.write_demo_truth(out / "truth")


def write_job(out: Path, engine: Path, after: str, options: argparse.Namespace) -> Path:
    """What the script inside Blender is to know."""
    file, files = out / "job.json", {name: str(out / name) for name in ("desk", "decoy", "shots")}
    files |= {"package": str(out / "karf.zip"), "record": str(out / "record.jsonl"), "facts": str(out / "facts.json")}
    job = files | {
        "story": options.story,
        "engine_python": str(engine),
        "threads": options.threads,
        "has_screen": dump(out) is not None,
        "only": [name.strip() for name in options.only.split(",") if name.strip()],
        "after": after,
    }
    job |= first_color_job(out, options) if options.story == "first-color" else afternoon_job()
    file.write_text(json.dumps(job))
    return file
