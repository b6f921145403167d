"""Make the demo capture: a still life rendered with Cycles, its true labels and depth, its true recolors and rough masks.

    .venv/blender/bin/python -m tools.demo.make_capture --out DIR [--only photos truth recolors masks]
    .venv/blender/bin/python -m tools.demo.make_capture --out demo --film DIR [--size 640] [--test 20] [--samples 32]

The second form copies the training photos that --out has to DIR, with large test photos along an arc.

Needs the bpy wheel, numpy and imageio. Everything is seeded: the same arguments give the same files.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from functools import partial
from pathlib import Path

from ..scenes import things
from ..scenes.cameras import dome_views
from ..scenes.film import make_film
from ..scenes.recipe import STEPS, Extent, Recipe, TrueEdit, make_capture

MAGENTA = (0.62, 0.035, 0.17)
FILM_ARC = math.radians(25.0)  # to either side
NAMES = {"pot": 1, "mug": 2, "apple": 3}

PLACE = """\
the table top is the disk z = 0 of
  radius 1.69 about the origin; all objects stand within 1.3 of it and reach up to z = 1.0; the cameras lie on a
  dome of radius 4.0 to 4.35 about (0, 0.02, 0.27). Behind the table is a smooth gradient that depends only on the
  viewing direction."""

ABOUT_EDITS = """\
  pot_to_blue    the red pot (body, lid, handle, spout) becomes a medium blue
  mug_and_apple  the blue bands and handle of the mug become magenta, the cream stays cream;
                 the green apple becomes golden yellow
  Unmarked: a pumpkin that touches the pot and is close to it in hue, an olive tin and a green book close to the
  apple, dark red cherries, lemons, a violet book."""


def build_still_life() -> None:
    """Build the still life in an empty file."""
    things.add_table()
    things.add_pot(-0.05, 0.15, object_id=NAMES["pot"])
    things.add_pumpkin(0.42, 0.80)
    things.add_mug(0.70, -0.36, object_id=NAMES["mug"])
    things.add_apple(0.04, -0.70, object_id=NAMES["apple"])
    things.add_lemons(((-0.54, -0.80, 0.5), (-0.41, -0.47, -0.6)))
    things.add_books(-0.90, 0.12)
    things.add_tin(0.98, 0.26)
    things.add_cherries(((0.40, -0.98, 0.4), (0.57, -0.90, 1.4), (0.24, -1.12, 2.6)))
    things.add_studio()


STILL_LIFE = Recipe(
    title="Demo capture: a still life of a red teapot, a striped mug, a green apple and unmarked neighbors",
    place=PLACE,
    about_edits=ABOUT_EDITS,
    build=build_still_life,
    views=partial(dome_views, radius=4.2, target=(0.0, 0.02, 0.27)),
    field_of_view=math.radians(38.0),
    names=NAMES,
    edits={
        "pot_to_blue": TrueEdit(("pot",), {"pot": {"main": (0.018, 0.12, 0.50)}}),
        "mug_and_apple": TrueEdit(
            ("mug", "apple"),
            {
                "stripes": {"main": MAGENTA},
                "glaze": {"main": MAGENTA},
                "apple": {"main": (0.66, 0.36, 0.025), "second": (0.72, 0.47, 0.07)},
            },
        ),
    },
    flaws={("pot", 2): "gap", ("mug", 1): "spill"},
)


def main(argv: list[str] | None = None) -> int:
    """Make the whole capture, or the steps named by ``--only``; later steps read the labels of the ``truth`` step."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder to write, for example demo")
    parser.add_argument("--size", type=int, default=512, help="width and height in pixels")
    parser.add_argument("--train", type=int, default=60, help="number of training views")
    parser.add_argument("--test", type=int, default=12, help="number of test views")
    parser.add_argument("--samples", type=int, default=16, help="samples per pixel at most")
    parser.add_argument("--threads", type=int, default=2, help="processor threads")
    parser.add_argument("--only", nargs="+", choices=STEPS, default=STEPS, help="steps to run")
    parser.add_argument("--film", type=Path, metavar="DIR", help="render large photos along an arc there")
    options = parser.parse_args(argv)
    extent = Extent(options.size, options.train, options.test, options.samples, ".jpg")
    if options.film:
        make_film(STILL_LIFE, extent, options.out, options.film, FILM_ARC, options.threads)
        return 0
    command = "python -m tools.demo.make_capture --out demo"
    make_capture(STILL_LIFE, extent, options.out, command, options.threads, options.only)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # The bpy module may hang or crash while the interpreter shuts down.
    os._exit(code)
