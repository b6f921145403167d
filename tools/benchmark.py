"""Measured times beside their targets: python3 tools/dev.py bench [NAME ...].

    kan          the Gaussian layer against the matrix products alone, the form that stores every basis, and B-splines
    cache        an iteration of F_w on the surface cache against one on 192 samples a ray, at width 256
    compositing  a swatch change on cached planes, the arithmetic alone
    swatch       the same in Blender, from setting the swatch to the pixels in the image
    controls     likewise every control of an object and its swatch by itself, and some with all others in use
    geometry     a scene learned by torch and by the compiled kernels: held-out PSNR over seconds, and milliseconds an
                 iteration; of --capture DIR ..., else of the demo, with --preset
    stages       seconds and peak memory of each stage: of --project DIR, else of the demo, learned for this
    photos       seconds and peak memory of recoloring a photo of 1, 12 and 24 megapixels, of the same project
    preview      milliseconds from query to answer of a camera's preview in a worker, by size; of the same project
    splats       milliseconds of a picture of splats, by size, beside the field's, and both in held-out photos; of the same
                 project
    detail       pixels that a voxel spans, the PSNR that photos keep without so much detail, and what the scene reaches

Without names: all but the last six. Times are those of this machine at this moment; the ratios say more than
the seconds, and a load average near the number of cores makes both worthless. Paths are relative to the checkout.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import product
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # this file is also run by its path

from tools.dev import ROOT, python_of
from tools.speed.machine import machine
from tools.speed.rows import Row, print_rows

NAMES = (
    "kan",
    "cache",
    "compositing",
    "swatch",
    "controls",
    "geometry",
    "stages",
    "photos",
    "preview",
    "splats",
    "detail",
)
LONG = ("geometry", "stages", "photos", "preview", "splats", "detail")
SWATCH_TARGETS_MS = {(800, 800): 16.0, (1920, 1080): 33.0}  # by size: one picture of sixty a second, or of thirty
SWATCH_WAYS = ((), ("--drag", "gloss"))  # its color is dragged, or its gloss
SWATCH_CASES = ((1, 1), (1, 5), (3, 1))  # objects, swatches of the first that differ; 5 are all but black
ALL = ("--with", "all")
CONTROL_WAYS = (  # what is dragged, and what is set before
    *(("--drag", name) for name in ("color", "saturation", "brightness", "gloss", "choke", "feather")),
    *(("--drag", "color", "--with", name) for name in ("choke", "metal", "added", "protect")),
    ("--drag", "choke", "--with", "feather"),
    *(("--drag", name, *ALL) for name in ("color", "gloss", "choke", "feather")),
)
STAGES = ("geometry", "segmentation", "palette", "recoloring", "splats")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(NAMES))
    parser.add_argument(
        "--threads", type=int, default=1, help="of kan, cache and of learning the demo (default: %(default)s)"
    )
    parser.add_argument("--repeats", type=int, default=5, help="rounds of kan and cache (default: %(default)s)")
    parser.add_argument(
        "--project", type=Path, metavar="DIR", help="a learned project, for stages, photos, preview, splats and detail"
    )
    parser.add_argument("--capture", type=Path, nargs="+", metavar="DIR", help="captures, for geometry")
    parser.add_argument("--preset", default="demo", help="settings, for geometry (default: %(default)s)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows there too")
    options = parser.parse_args()
    unknown = [name for name in options.names if name not in NAMES]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(NAMES)}")
    benches = {
        "kan": bench_kan,
        "cache": bench_cache,
        "compositing": bench_compositing,
        "swatch": bench_swatch,
        "controls": bench_controls,
        "geometry": bench_geometry,
        "stages": bench_stages,
        "photos": bench_photos,
        "preview": bench_preview,
        "splats": bench_splats,
        "detail": bench_detail,
    }
    measured_on = machine(options.threads)
    print("  ".join(f"{name} {value}" for name, value in measured_on.items()), flush=True)
    rows: list[Row] = []
    for name in options.names or [name for name in NAMES if name not in LONG]:
        print(f"\n--- {name}", flush=True)
        rows += [{"bench": name, **row} for row in benches[name](options)]
    if options.json:
        options.json.write_text(json.dumps({"machine": measured_on, "rows": rows}, indent=1) + "\n", encoding="utf-8")


# ---------------------------------------------------------------------------------------------------------------- benches
def bench_kan(options: argparse.Namespace) -> list[Row]:
    """Milliseconds, ratios to the floor and peak memory of each layer; the targets stand below the table."""
    from tools.speed import kan

    rows = kan.run(options.threads, options.repeats)
    print_rows(rows)
    kan.print_ratios(rows)
    return rows


def bench_cache(options: argparse.Namespace) -> list[Row]:
    """Milliseconds of an iteration, and how many times faster it is than the dense one."""
    from tools.speed import surface_cache

    rows = surface_cache.run(options.threads, options.repeats)
    print_rows(rows)
    print(f"target: >= {surface_cache.TARGET:g} times faster with 3 samples a ray")
    return rows


def bench_compositing(options: argparse.Namespace) -> list[Row]:
    """Median milliseconds of `delta_composite`; it has no target of its own, but must fit into that of `swatch`."""
    from tools.speed import compositing

    rows = compositing.run()
    print_rows(rows)
    return rows


def bench_swatch(options: argparse.Namespace) -> list[Row]:
    """Median milliseconds of a swatch edit in a real Blender, in its own environment."""
    rows = []
    cases = product(SWATCH_TARGETS_MS.items(), SWATCH_CASES, ("delta", "paper"), SWATCH_WAYS)
    for (size, target), case, compositing, way in cases:
        chosen = dict(zip(("width", "height", "objects", "edited"), (*size, *case), strict=True))
        given = [text for name, value in chosen.items() for text in (f"--{name}", str(value))]
        figures = swatch_figures(["--compositing", compositing, *way, *given])
        rows.append(figures | {"target_ms": target, "met": figures["median_ms"] <= target})
    print_rows(rows)
    return rows


def bench_controls(options: argparse.Namespace) -> list[Row]:
    """Median milliseconds of each control, without those that Blender takes for the picture's upload: the extension's own."""
    rows = []
    for (size, target), way in product(SWATCH_TARGETS_MS.items(), CONTROL_WAYS):
        given = ["--island", "--repeat", "16", "--width", str(size[0]), "--height", str(size[1])]
        figures = swatch_figures([*given, *way])
        own = round(figures["median_ms"] - figures["upload_ms"], 1)
        told = {name: figures[name] for name in ("width", "drag", "median_ms", "first_ms", "upload_ms")}
        told["with"] = " ".join(figures["used"]) or "-"
        rows.append(told | {"own_ms": own, "target_ms": target, "ratio": round(own / target, 2), "met": own <= target})
    print_rows(rows)
    return rows


def swatch_figures(given: list[str]) -> Row:
    """What `speed/blender_swatch.py` measures with these arguments."""
    command = [python_of("blender"), ROOT / "tools" / "speed" / "blender_swatch.py", *given]
    done = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True)
    return json.loads(done.stdout.splitlines()[-1])  # Blender prints lines of its own before


def bench_geometry(options: argparse.Namespace) -> list[Row]:
    """Both ways to learn a field; the kernels' gain is the last column of the second table."""
    from karf_engine.project.settings import preset
    from tools.speed import geometry

    rows = []
    for capture in options.capture or [ROOT / "demo"]:
        for table in geometry.run(capture, preset(options.preset), options.threads, list(geometry.WAYS)):
            print_rows(table)
            rows += table
    return rows


def bench_stages(options: argparse.Namespace) -> list[Row]:
    """Seconds and peak memory of each finished stage of a project."""
    with learned_project(options) as project:
        rows = stage_rows(project)
    print_rows(rows)
    return rows


def bench_photos(options: argparse.Namespace) -> list[Row]:
    """Seconds and peak memory of a photo at its own size; the target stands below the table."""
    from tools.speed import photo_size

    with learned_project(options) as project:
        rows = photo_size.run(project)
    print_rows(rows)
    print(f"target: <= {photo_size.TARGET_GIB:g} GiB at 24 megapixels with three objects, and all outside equal")
    return rows


def bench_preview(options: argparse.Namespace) -> list[Row]:
    """Milliseconds of loading, of the first preview and of those of each size; the target stands below the table."""
    from tools.speed import preview

    with learned_project(options) as project:
        rows = preview.run(project)
    print_rows(rows)
    print(f"target: <= {preview.TARGET_MS:g} ms of the processor for the first size")
    return rows


def bench_splats(options: argparse.Namespace) -> list[Row]:
    """Milliseconds of pictures of splats and of the field, and how well both show held-out photos; no target."""
    from tools.speed import splats

    with learned_project(options) as project:
        times, held_out = splats.run(project, options.threads)
    print_rows(times)
    print_rows(held_out)
    return times + held_out


def bench_detail(options: argparse.Namespace) -> list[Row]:
    """PSNR in dB, of the test views: at the scene's center, everywhere, on each object, and what photos keep anyway."""
    from tools.speed import detail

    with learned_project(options) as project:
        rows = detail.run(project)
    print_rows(rows)
    return rows


@contextmanager
def learned_project(options: argparse.Namespace) -> Iterator[Path]:
    """The project that was named, or the demo, learned for this."""
    if options.project:
        yield options.project
        return
    with tempfile.TemporaryDirectory(prefix="karf-bench-") as folder:
        learn_demo(Path(folder), options.threads)
        yield Path(folder)


def learn_demo(project: Path, threads: int) -> None:
    """Learn the demo capture, one process a stage: a process knows only its own highest memory."""
    masks = str(ROOT / "demo" / "coarse_masks" / "one")
    arguments = {"geometry": [str(ROOT / "demo"), "--project", str(project)], "segmentation": ["--masks", masks]}
    for stage in STAGES:
        chosen = arguments.get(stage, []) if stage == "geometry" else [str(project), *arguments.get(stage, [])]
        command = [sys.executable, "-m", "karf_engine", stage, *chosen, "--threads", str(threads)]
        subprocess.run(command, cwd=ROOT, check=True)


def stage_rows(project: Path) -> list[Row]:
    """What each stage of a project measured of itself."""
    state = json.loads((project / "project.json").read_text(encoding="utf-8"))
    finished = [(stage, state["stages"][stage]) for stage in STAGES if stage in state["stages"]]
    return [
        {"stage": stage, "seconds": entry["seconds"], "peak_gib": round(entry["peak_memory"] / 2**30, 2)}
        for stage, entry in finished
    ]


if __name__ == "__main__":
    main()
