"""How long a swatch edit takes in Blender, from setting the property to the pixels in the image. Prints JSON.

    python tools/speed/blender_swatch.py [--width 800] [--height 800] [--colors 6] [--objects 1] [--edited 1]
        [--compositing delta] [--alone] [--drag color] [--with NAME ...] [--repeat 40]

Runs under the `bpy` module, or inside Blender after `--python ... --`. Planes are made up: smooth, every pixel touched, or
with `--island` those of an object with soft edges whose box is 80 % of the picture's width and height. `--with` sets other
controls before, and `all` all of them.
Times are of this process alone, so that others at work on the machine add little; `upload_ms` is the plain
`foreach_set` of the same picture, which is Blender's own. Not in the figures: the upload to the graphics card when the
editor is drawn.
"""

import argparse
import importlib
import json
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np

ROOT = Path(__file__).resolve().parents[2]
MODULE = "bl_ext.karf_bench.karf"
HISTOGRAM_CELLS = 4000  # colors of an object, about as many as the demo's objects have
# what a share from 0 to 1 of a drag makes of each control
DRAGGED = {
    "color": lambda share: (share, 0.5, 1 - share),
    "saturation": lambda share: 2 * share,
    "brightness": lambda share: share - 0.5,
    "gloss": lambda share: share,
    "choke": lambda share: 6 * share - 3,
    "feather": lambda share: 1 + 11 * share,
}
OF_OBJECT = ("choke", "feather")
CONTROLS = ("saturation", "brightness", "gloss", "choke", "feather", "metal", "added", "protect")


def main() -> None:
    options = parse(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:])
    with tempfile.TemporaryDirectory() as folder:
        enable(Path(folder) / "repository")
        scene = show(Path(folder) / "project", options)
        times, uploads = edit(scene, options), upload(scene, options)
    figures = {
        **vars(options),
        "median_ms": round(statistics.median(times), 2),
        "first_ms": round(times[0], 2),
        "worst_ms": round(max(times[1:]), 2),
        "upload_ms": round(statistics.median(uploads), 2),
        "blender": bpy.app.version_string,
        "numpy": np.__version__,
    }
    print(json.dumps(figures), flush=True)


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--width", type=int, default=800, help="pixels")
    parser.add_argument("--height", type=int, default=800, help="pixels")
    parser.add_argument("--colors", type=int, default=6, help="colors of a palette, black included")
    parser.add_argument("--objects", type=int, default=1)
    parser.add_argument("--edited", type=int, default=1, help="swatches of the first object that differ all the time")
    parser.add_argument("--compositing", choices=("delta", "paper"), default="delta")
    parser.add_argument("--alone", action="store_true", help="without Material: no other swatch follows")
    parser.add_argument("--island", action="store_true", help="objects end within the picture")
    parser.add_argument("--drag", choices=tuple(DRAGGED), default="color", help="what is dragged")
    parser.add_argument(
        "--with", dest="used", choices=(*CONTROLS, "all"), nargs="*", default=[], help="what is set before"
    )
    parser.add_argument("--repeat", type=int, default=40)
    return parser.parse_args(arguments)


def enable(repository: Path) -> None:
    """Enable the checkout as an extension."""
    repository.mkdir()
    (repository / "karf").symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(name="bench", module="karf_bench", custom_directory=str(repository))
    bpy.ops.preferences.addon_enable(module=MODULE)


def show(project: Path, options: argparse.Namespace) -> bpy.types.Scene:
    """A scene that shows a made-up view."""
    height, width, colors = options.height, options.width, options.colors
    rows, columns = np.mgrid[0:height, 0:width].astype(np.float32) / max(height, width)
    waves = [
        1 + np.sin(6 * rows * (j + 1) + 9 * columns * (k + 1)) for k in range(options.objects) for j in range(colors)
    ]
    weights = np.stack(waves).reshape(options.objects, colors, height, width)
    weights /= weights.sum(axis=(0, 1))
    if options.island:
        across, down = np.linspace(-1, 1, width), np.linspace(-1, 1, height)[:, None]
        inside = np.clip((0.8 - np.hypot(across, down)) * width / 4 + 0.5, 0, 1)  # soft over some two pixels
        weights *= inside.astype(np.float32)
    base = np.stack([rows, columns, 1 - rows], -1)
    names = tuple(f"object_{k}" for k in range(options.objects))
    compositing = importlib.import_module(f"{MODULE}.karf_engine.palettes.compositing")
    compositing.write_planes(
        project / "planes" / "view.npz",
        compositing.Planes(names, weights, weights.sum(axis=1), np.rint(base * 255).astype(np.uint8)),
        importlib.import_module(f"{MODULE}.karf_engine.project.state").result_fingerprint({}, "recoloring"),
    )
    palette = importlib.import_module(f"{MODULE}.karf_engine.palettes.palette")
    ramp = np.linspace(0, 1, colors, dtype=np.float32)[:, None] * np.float32([0.9, 0.4, 0.2])  # one paint
    scene = bpy.context.scene
    scene.karf.project = str(project)
    scene.karf.views.add().name = "view"
    scene.karf.active_view = "view"
    scene.karf.compositing, scene.karf.material = options.compositing, not options.alone
    palettes = importlib.import_module(f"{MODULE}.karf_blender.swatches.palettes")
    palettes.load_palettes(scene, [palette.Palette(name, ramp) for name in names])
    color_histogram = importlib.import_module(f"{MODULE}.karf_engine.palettes.color_histogram")
    pixels = np.random.default_rng(0).integers(height * width, size=HISTOGRAM_CELLS)
    seen = [weights[k].reshape(colors, -1).T[pixels] for k in range(options.objects)]
    seen = [np.maximum(own, 1e-6) for own in seen]
    histograms = {
        name: color_histogram.ColorHistogram(own @ ramp, np.ones(len(own)), own / own.sum(1, keepdims=True))
        for name, own in zip(names, seen, strict=True)
    }
    importlib.import_module(f"{MODULE}.karf_engine.project").Project(project).create("made up")
    color_histogram.write_object_colors(project / "object_colors.npz", histograms)
    importlib.import_module(f"{MODULE}.karf_blender.swatches.displayed").of(scene).recolor()
    return scene


def edit(scene: bpy.types.Scene, options: argparse.Namespace) -> list[float]:
    """Milliseconds of each swatch edit; its update callback has composited and uploaded when the setting returns."""
    item = scene.karf.objects[0]
    swatches = item.swatches
    for index in range(2, options.edited + 1):
        swatches[index].color = (0.3, 0.6, 0.1)
    use(scene, CONTROLS if "all" in options.used else options.used)
    times = []
    for turn in range(options.repeat):
        value = DRAGGED[options.drag](turn / options.repeat)
        start = time.process_time()
        setattr(item if options.drag in OF_OBJECT else swatches[1], options.drag, value)
        times.append((time.process_time() - start) * 1000)
    return times


def use(scene: bpy.types.Scene, controls: Sequence[str]) -> None:
    """Set controls of the first object and its first swatch to what an artist may choose."""
    item, steps = scene.karf.objects[0], importlib.import_module(f"{MODULE}.karf_blender.steps")
    if "added" in controls or "protect" in controls:
        steps.add_color(scene, item.name, (0.5, 0.22, 0.11), (0.2, 0.5, 0.3))
    for swatch in item.swatches:
        if swatch.is_added and "protect" in controls:
            swatch.protect = 0.2
    item.is_metal = "metal" in controls
    for name in controls:
        if name in DRAGGED:
            setattr(item if name in OF_OBJECT else item.swatches[1], name, DRAGGED[name](0.7))


def upload(scene: bpy.types.Scene, options: argparse.Namespace) -> list[float]:
    """Milliseconds of a plain upload of a picture as large."""
    pixels, times = np.full(options.height * options.width * 4, 0.5, np.float32), []
    for _ in range(options.repeat):
        start = time.process_time()
        scene.karf.result.pixels.foreach_set(pixels)
        times.append((time.process_time() - start) * 1000)
    return times


if __name__ == "__main__":
    main()
    if not bpy.app.binary_path:  # the bpy module: some versions hang at the interpreter's exit
        os._exit(0)
