"""The scene in the 3D View beside the engine's frames: PSNR inside the objects. Runs under the `bpy` module; prints JSON.

    karf points PROJECT --out POINTS.npz
    karf render PROJECT --views test --base render --edit EDIT.json --out FRAMES
    python tools/judging/scene_in_3d.py CAPTURE PROJECT POINTS.npz EDIT.json FRAMES --out DIR

Cycles renders the object from the cameras of FRAMES/recolor with the same edit, at the frames' size, to DIR.
"""

import argparse
import importlib
import json
import os
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "speed"))
from blender_swatch import MODULE, enable

SAMPLES = 4
INSIDE = 2  # pixels from an object's border, where both are mixtures


def main(options: argparse.Namespace) -> None:
    with tempfile.TemporaryDirectory() as folder:
        enable(Path(folder) / "repository")
        steps, images = (
            importlib.import_module(f"{MODULE}.karf_blender.{name}") for name in ("steps", "pictures.images")
        )
        bpy.ops.wm.read_homefile(use_empty=True)
        scene = bpy.context.scene
        steps.import_capture(scene, options.capture, options.project, rig=steps.RigOptions(photos=False))
        scene.render.engine, scene.cycles.samples = "CYCLES", SAMPLES
        scene.view_settings.view_transform = "Standard"
        scene.render.image_settings.file_format = "PNG"
        steps.place_points(scene, options.points)
        steps.apply_edit(scene, options.edit)
        rows = {}
        for file in sorted((options.frames / "recolor").glob("*.png")):
            wanted = read(images, file)
            steps.look_through(scene, file.stem)
            scene.render.resolution_y, scene.render.resolution_x = wanted.shape[:2]
            scene.render.filepath = str(options.out / file.name)
            bpy.ops.render.render(write_still=True)
            found = read(images, options.out / file.name)
            masks = [read(images, each)[..., 0] > 0.5 for each in (options.frames / "masks").glob(f"*/{file.name}")]
            rows[file.stem] = [round(psnr(wanted, found, mask), 2) for mask in both(np.any(masks, axis=0))]
    inside, eroded = np.mean(list(rows.values()), axis=0).round(2).tolist()
    print(json.dumps({"views": rows, "psnr_inside": inside, "psnr_border_left_out": eroded}), flush=True)


def read(images, path: Path) -> np.ndarray:
    """A picture's colors [H, W, 3]."""
    image = bpy.data.images.load(str(path))
    try:
        return images.pixels(image)[..., :3].copy()
    finally:
        bpy.data.images.remove(image)


def both(mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The mask, and what lies more than INSIDE pixels from its border."""
    eroded = mask
    for _ in range(INSIDE):
        moved = [np.roll(eroded, shift, axis) for axis in (0, 1) for shift in (-1, 1)]
        eroded = np.all([eroded, *moved], axis=0)
    return mask, eroded


def psnr(first: np.ndarray, second: np.ndarray, mask: np.ndarray) -> float:
    """In dB, of colors in [0, 1] inside a mask."""
    return float(-10 * np.log10(np.mean((first[mask] - second[mask]) ** 2)))


def parse(arguments: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    for name in ("capture", "project", "points", "edit"):
        parser.add_argument(name)
    parser.add_argument("frames", type=Path, help="folder that the engine has rendered to")
    parser.add_argument("--out", type=Path, required=True, help="folder for the pictures")
    options = parser.parse_args(arguments)
    options.out = options.out.absolute()
    return options


if __name__ == "__main__":
    main(parse(sys.argv[1:]))
    os._exit(0)  # some versions of the module hang at the interpreter's exit
