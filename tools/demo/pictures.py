"""The README's picture in motion: large photos of the demo's scene along an arc, recolored while its swatches change.

    .venv/blender/bin/python -m tools.demo.make_capture --out demo --film FILM --size 640 --test 20 --samples 32
    .venv/engine/bin/python -m tools.demo.pictures FILM --project PROJECT

The first command renders the photos, the second learns the scene from the demo's own photos into PROJECT and
writes docs/images/demo.webp.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import karf_engine as karf
from karf_engine.io.color import to_bytes
from karf_engine.palettes.palette import MAX_SRGB

from ..evaluate.judging import edit_to_judge
from ..evaluate.sources import ROOT
from ..metrics.truth import Truth

PICTURE = ROOT / "docs" / "images" / "demo.webp"
EDITS = ("pot_to_blue", "mug_and_apple")
MILLISECONDS, WIDTH, QUALITY = 90, 640, 92  # of a frame, and of its file


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("film", type=Path, help="capture with large test photos")
    parser.add_argument("--project", type=Path, required=True, help="where it is learned")
    parser.add_argument("--threads", type=int)
    options = parser.parse_args()
    model = karf.learn(
        options.film,
        options.film / "coarse_masks" / "one",
        project=options.project,
        overrides=["splats.iterations=0"],
        threads=options.threads,
    )
    views = sorted(model.capture.split("test"), key=lambda view: view.name)
    swing = [*views, *views[-2:0:-1]]  # there and back
    pictures = []
    for number, (view, edit) in enumerate(zip(swing, edits_of_frames(model, len(swing)), strict=True)):
        picture = Image.fromarray(to_bytes(model.recolor(view, edit)))
        pictures.append(picture.resize((WIDTH, WIDTH * picture.height // picture.width), Image.Resampling.LANCZOS))
        print(f"frame {number + 1} of {len(swing)}", flush=True)
    pictures[0].save(
        PICTURE, save_all=True, append_images=pictures[1:], duration=MILLISECONDS, loop=0, quality=QUALITY, method=6
    )
    print(PICTURE)


def edits_of_frames(model: karf.Model, count: int) -> list[karf.Edit]:
    """Return what each frame shows: nothing edited, the demo's edits one after the other, and nothing edited again."""
    first, second = (edit_to_judge(model, Truth(), name) for name in EDITS)
    unedited = replace(first, colors={palette.name: palette.colors for palette in model.palettes})
    story = [unedited, first, blended(first, second, unedited, 1), second, unedited]
    edits = []
    for place in np.linspace(0, len(story) - 1, count, endpoint=False):
        number, share = int(place), place % 1
        moved = np.clip(2 * share - 0.5, 0, 1)  # the first and the last quarter of each change stand still
        edits.append(blended(story[number], story[number + 1], story[number], (3 - 2 * moved) * moved**2))
    return edits


def blended(edit: karf.Edit, other: karf.Edit, start: karf.Edit, share: float) -> karf.Edit:
    """Return an edit with a share of what the other one changes from a start."""
    colors = {name: edit.colors[name] + share * (other.colors[name] - start.colors[name]) for name in edit.colors}
    return replace(edit, colors={name: np.clip(rows, 0, MAX_SRGB) for name, rows in colors.items()})


if __name__ == "__main__":
    main()
