"""Gaussian splats on a processor beside our voxels: OpenSplat, built from a source folder of yours, on the same photos.

    .venv/engine/bin/python -m tools.speed.peer CAPTURE OPENSPLAT_SOURCE --out DIR [--size 400] [--steps 2000]

Both learn from the same training photos at the same size, with as many threads, and are judged on the same held-out
photos, whole pictures, by PSNR in dB. CPU seconds are those of the process and its children, with reading the photos.
OpenSplat withholds one photo at a time; so it learns from a folder that lacks them all, and shows each of them by its
own `--val-image`, resumed from the saved splats with no iteration left. It needs a version that prints its validation
PSNR, CMake, a compiler and OpenCV's headers; torch's are those of this environment. Linux only.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch

import karf_engine as karf
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import Capture, SparsePoints
from karf_engine.capture.poses.triangulation import triangulate
from karf_engine.capture.training_images import TrainingImage, load_views
from karf_engine.compute.progress import Progress
from karf_engine.fields.files import load_scene
from karf_engine.io.files import read_json, write_json
from karf_engine.io.images import write_png
from karf_engine.metrics.images import psnr
from karf_engine.project import Project

from ..judging import HOLDOUT

STEP = re.compile(r"Step (\d+):")
PSNR = re.compile(r"validation PSNR: ([-\d.]+|inf)")
PLY = """ply
format ascii 1.0
element vertex {count}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
end_header
"""


@dataclass(frozen=True)
class Point:
    """How far one program has come. seconds: of processors. values: PSNR in dB of each held-out photo."""

    name: str
    seconds: float
    values: list[float]

    def __str__(self) -> str:
        mean = sum(self.values) / len(self.values)
        return f"{self.name:24} {self.seconds:8.0f} s  mean {mean:6.2f} dB  worst {min(self.values):6.2f} dB"


def main() -> None:
    options = parse_arguments()
    capture = karf.open_capture(options.capture, holdout=HOLDOUT)
    held_out = load_views(capture.split("test"), options.size)
    if not held_out or any(training_image.alpha is not None for training_image in held_out):
        sys.exit(f"error: {capture.source} must have test photos, and none with a matte.")
    training_images = load_views(capture.split("train"), options.size)
    points = sparse_points(capture, training_images, options.threads)
    write_folder(options.out / "learn", training_images, points)
    write_folder(options.out / "judge", held_out + training_images, points)
    program = build(options.source, options.out / "build")
    extra = options.option or []
    rows = [learn_ours(options, held_out)]
    print(rows[0], flush=True)
    for step, seconds in learn_theirs(program, options.out, options.steps, options.every, options.threads, extra):
        values = [judge(program, options.out, step, number, extra) for number in range(len(held_out))]
        rows.append(Point(f"OpenSplat, step {step}", seconds, values))
        print(rows[-1], flush=True)
    write_json(options.out / "peer.json", [vars(row) for row in rows])


def sparse_points(capture: Capture, training_images: list[TrainingImage], threads: int) -> SparsePoints:
    """The capture's sparse points, or what is found in the training photos: splats begin at points."""
    if capture.points is not None and len(capture.points):
        return capture.points
    return triangulate(
        training_images, threads, Progress(lambda *_, **__: None, lambda: False, "points", len(training_images))
    )


def write_folder(folder: Path, training_images: Sequence[TrainingImage], points: SparsePoints) -> None:
    """Write photos as they are learned from, their cameras and the points, as nerfstudio's format has them."""
    views = []
    for number, training_image in enumerate(training_images):
        name = f"{number:05d}.png"
        write_png(folder / "images" / name, training_image.color)
        if training_image.valid is not None:
            write_png(folder / "masks" / name, training_image.valid)
        views.append(replace(training_image.view, name=f"images/{name}", camera=training_image.camera))
    write_cameras(folder / "transforms.json", views)
    cameras = read_json(folder / "transforms.json", "cameras")
    write_json(folder / "transforms.json", cameras | {"ply_file_path": "points.ply"})
    rows = np.concatenate([points.positions, points.colors], axis=1)
    text = PLY.format(count=len(points)) + "".join(
        "{:.6g} {:.6g} {:.6g} {:.0f} {:.0f} {:.0f}\n".format(*row) for row in rows
    )
    (folder / "points.ply").write_text(text, encoding="ascii")


def build(source: Path, folder: Path) -> list[str]:
    """Build OpenSplat for processors; the program as the beginning of a command."""
    found = [f"-DCMAKE_PREFIX_PATH={torch.utils.cmake_prefix_path}", "-DGPU_RUNTIME=CPU", "-DCMAKE_BUILD_TYPE=Release"]
    subprocess.run(["cmake", "-S", str(source), "-B", str(folder), *found], check=True)
    subprocess.run(["cmake", "--build", str(folder), "--target", "opensplat", "--parallel"], check=True)
    return [str(folder / "opensplat")]


def learn_ours(options: argparse.Namespace, held_out: list[TrainingImage]) -> Point:
    """Learn our geometry by the command line, and judge the scene."""
    project = options.out / "ours"
    command = [sys.executable, "-m", "karf_engine", "geometry", str(options.capture), "--project", str(project)]
    settings = [f"geometry.long_side={options.size}", *(options.set or [])]
    command += [
        "--preset",
        options.preset,
        "--holdout",
        str(HOLDOUT),
        *(part for text in settings for part in ("--set", text)),
    ]
    seconds = 0.0
    with started([*command, "--threads", str(options.threads), "--device", "cpu"], options.threads) as process:
        for line in process.stdout:
            print(line, end="")
            seconds = cpu_seconds(process.pid)
    if process.returncode:
        sys.exit("error: our geometry was not learned; see above.")
    scene = load_scene(Project(project).geometry_file)
    values = [
        psnr(scene.render(training_image.camera, 1).color.numpy(), training_image.color, training_image.valid)
        for training_image in held_out
    ]
    return Point(f"KaRF, preset {options.preset}", seconds, values)


def learn_theirs(
    program: list[str], out: Path, steps: int, every: int, threads: int, extra: Sequence[str]
) -> list[tuple[int, float]]:
    """Learn splats; each saved step and the CPU seconds until then. The coordinates of the file are ours."""
    command = [*program, str(out / "learn"), "--cpu", "--keep-crs", "-n", str(steps), "-s", str(every)]
    saved = []
    with started([*command, "-o", str(out / "splat.ply"), *extra], threads) as process:
        for line in process.stdout:
            found = STEP.search(line)
            if found is None:
                print(line, end="")
            elif int(found[1]) % every == 0:
                saved.append((int(found[1]), cpu_seconds(process.pid)))
    if process.returncode or not saved:
        sys.exit("error: OpenSplat has not learned; see above.")
    return saved


def judge(program: list[str], out: Path, step: int, number: int, extra: Sequence[str]) -> float:
    """PSNR in dB of one held-out photo, by OpenSplat itself: resumed where it stands, with no iteration left."""
    command = [*program, str(out / "judge"), "--cpu", "--keep-crs", "-n", str(step), *extra, "--num-downscales", "0"]
    command += ["--resume", str(out / f"splat_{step}.ply"), "-o", str(out / "judged.ply")]
    command += ["--val", "--val-image", f"{number:05d}.png"]
    done = subprocess.run(command, capture_output=True, text=True)
    found = PSNR.search(done.stdout)
    if found is None:
        sys.exit(
            f"error: OpenSplat prints no validation PSNR; a newer version does.\n{done.stdout[-500:]}{done.stderr}"
        )
    return float(found[1])


def started(command: Sequence[str], threads: int) -> subprocess.Popen:
    """A child process whose output is read line by line."""
    variables = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "MKL_NUM_THREADS"), str(threads))
    return subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def cpu_seconds(pid: int) -> float:
    """What a process and its finished children have taken of processors so far (proc_pid_stat(5), fields 14 to 17)."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def parse_arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", type=Path)
    parser.add_argument("source", type=Path, help="OpenSplat's source folder")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--size", type=int, default=400, help="pixels of the photos' long side (default: %(default)s)")
    parser.add_argument("--preset", default="fast", help="ours (default: %(default)s)")
    parser.add_argument("--set", action="append", metavar="NAME=VALUE", help="one of our settings")
    parser.add_argument("--steps", type=int, default=2000, help="of OpenSplat (default: %(default)s)")
    parser.add_argument("--every", type=int, default=500, help="steps between two looks (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument(
        "--option", action="append", help="one more option of OpenSplat, as --option=--refine-every=100"
    )
    options = parser.parse_args()
    if options.steps % options.every:
        parser.error("--steps must be a multiple of --every")
    return options


if __name__ == "__main__":
    main()
