"""The README's animated picture: the demo's scene from a swinging camera, while its swatches change.

    .venv/engine/bin/python -m tools.demo.animation --out demo_out

reads what `tools/dev.py demo --out demo_out` has learned and edited, and writes docs/images/demo.webp.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import karf_engine as karf
from karf_engine.compute.runtime import start_runtime
from karf_engine.io.color import to_bytes
from karf_engine.palettes.palette import MAX_SRGB, read_edit

PICTURE = Path(__file__).resolve().parents[2] / "docs" / "images" / "demo.webp"
EDITS = ("pot_to_blue", "mug_and_apple")
HELD, BECOMING = 4, 8  # frames that show an edit, and those in which it becomes the next one
SWING = np.radians(28)  # to either side of the first camera, about the scene's vertical axis
MILLISECONDS = 90  # a frame is shown
WIDTH, HEIGHT = 400, 320


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--out", type=Path, required=True, help="where the demo was written")
    parser.add_argument("--view", default="test_r_009", help="the view whose camera swings")
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    start_runtime(threads=options.threads)
    model = karf.load(options.out / "project")
    edits = edits_of_frames(model, options.out / "edits")
    camera = model.capture.view(options.view).camera
    scale = HEIGHT / camera.height
    middle = replace(
        camera, width=WIDTH, height=HEIGHT, fx=camera.fx * scale, fy=camera.fy * scale, cx=WIDTH / 2, cy=HEIGHT / 2
    )
    pictures = []
    for number, edit in enumerate(edits):
        angle = SWING * np.sin(2 * np.pi * number / len(edits))
        picture = model.composite(model.render(turned(middle, angle)), edit)
        pictures.append(Image.fromarray(to_bytes(picture)))
        print(f"frame {number + 1} of {len(edits)}", flush=True)
    pictures[0].save(
        PICTURE, save_all=True, append_images=pictures[1:], duration=MILLISECONDS, loop=0, quality=72, method=6
    )
    print(PICTURE)


def edits_of_frames(model: karf.Model, edits: Path) -> list[karf.Edit]:
    """What each frame shows: the demo's edits one after the other, and then nothing edited again."""
    first, second = (read_edit(edits / f"{name}.json", model.palettes) for name in EDITS)
    unedited = replace(first, colors={palette.name: palette.colors for palette in model.palettes})
    both = blended(first, second, unedited, 1)
    story = [unedited, first, both, second]
    frames = []
    for edit, following in zip(story, [*story[1:], story[0]], strict=True):
        shares = np.linspace(0, 1, BECOMING, endpoint=False)
        frames += [edit] * HELD
        frames += [blended(edit, following, edit, (3 - 2 * share) * share**2) for share in shares]
    return frames


def blended(edit: karf.Edit, other: karf.Edit, start: karf.Edit, share: float) -> karf.Edit:
    """An edit with a share of what the other one changes from a start."""
    colors = {name: edit.colors[name] + share * (other.colors[name] - start.colors[name]) for name in edit.colors}
    return replace(edit, colors={name: np.clip(rows, 0, MAX_SRGB) for name, rows in colors.items()})


def turned(camera: karf.Camera, angle: float) -> karf.Camera:
    """The camera turned about the world's z axis."""
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return replace(camera, camera_to_world=turn @ camera.camera_to_world)


if __name__ == "__main__":
    main()
