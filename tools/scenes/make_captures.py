"""Make the benchmark captures: seven procedural scenes, each with true masks, depth and three true recolors.

    .venv/blender/bin/python -m tools.scenes.make_captures --out DIR [SCENE ...] [--size N] [--views 40+8]
    .venv/blender/bin/python -m tools.scenes.make_captures --out DIR --seeds 0-7 [--size 160]
    .venv/blender/bin/python -m tools.scenes.make_captures --out DIR --thin-seeds 0-3 [--size 320] [--full DIR2]
    .venv/blender/bin/python -m tools.scenes.make_captures --out DIR [SCENE ...] --full DIR2 [--full-size 1024]

    single   one jug on a table
    hue      a red pot among red neighbors that touch and hide it and each other; pot and apple have masks
    glossy   a mirroring vase with checks
    front    cameras in a small patch that look one way, past a pot and a pumpkin at a wall with pictures and books
    thin     a plant of pointed leaves and hair-like stems, a basket of wires with a thin handle, and near the plant a
             gourd of its own color
    packaging, packaging_b
             things with print on them, and also which pixels are letters (tools/scenes/packaging.py); 320 pixels

Each is laid out as the demo capture. A scene that DIR has already, of the same arguments, is not made again. The second
form makes scenes that nobody chose: a seed draws all that is in them (tools/procedural/seeded). The third draws scenes
of things with thin parts, and tells which pixels these are. --full also copies captures to DIR2, with a few test views
at a larger size and the coverage of each object there. Needs the bpy wheel, numpy and imageio. Everything is procedural
and seeded: the same arguments give the same files.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from dataclasses import asdict
from functools import partial
from pathlib import Path

from ..procedural import full_size, thin_things, things
from ..procedural.cameras import dome_views, patch_views
from ..procedural.files import unless_there
from ..procedural.recipe import Extent, Recipe, TrueEdit, make_capture
from .drawn_captures import make_seed_once, make_thin_once
from .packaging import PACKAGING

RECIPE_VERSION = 1  # goes up with every change to the scenes, so that captures of older ones are made again
VIEWS = 40, 8  # training and test views
FIELD_OF_VIEW = math.radians(38.0)
ON_TABLE = """\
the table top is the disk z = 0 of
  radius {} about the origin. Behind the table is a smooth gradient that depends only on the viewing direction."""
IN_ROOM = """\
the table top is z = 0 and the
  wall behind it y = 3.35; the cameras lie in a patch at y = -3.6 and look along +y."""

RED, BLUE, NAVY, CREAM = (0.55, 0.03, 0.025), (0.018, 0.12, 0.50), (0.02, 0.05, 0.24), (0.74, 0.68, 0.54)
GREEN, YELLOW, VIOLET, TEAL = (0.04, 0.30, 0.06), (0.66, 0.38, 0.03), (0.16, 0.04, 0.36), (0.02, 0.26, 0.25)
LEAF = (0.05, 0.20, 0.035)
RED_APPLE = ((0.42, 0.025, 0.02), (0.50, 0.07, 0.03))


def build_single() -> None:
    """A jug alone on a small table, for the cameras are near."""
    things.add_table(0.7)
    things.add_jug(0.0, 0.0, TEAL, object_id=1)
    things.add_studio()


def build_hue() -> None:
    """A red pot and a red apple, close to a pumpkin, a tin and cherries of nearly their hue."""
    things.add_table()
    things.add_pot(-0.05, 0.10, RED, object_id=1)
    things.add_pumpkin(0.42, 0.76, (0.60, 0.09, 0.02))
    things.add_apple(0.14, -0.62, RED_APPLE, object_id=2)
    things.add_tin(-0.46, -0.50, (0.36, 0.05, 0.03))
    things.add_cherries(((0.50, -0.62, 0.4), (0.40, -0.86, 1.4), (-0.14, -0.90, 2.6)))
    things.add_studio()


def build_glossy() -> None:
    """A mirroring vase with checks, and neighbors for it to mirror."""
    things.add_table()
    things.add_vase(0.0, 0.0, (NAVY, CREAM), object_id=1)
    things.add_apple(0.70, -0.55)
    things.add_lemons(((-0.60, -0.60, 0.5),))
    things.add_tin(-0.55, 0.65)
    things.add_studio()


def build_front() -> None:
    """A pot and a pumpkin on a table, and a room behind."""
    things.add_room()
    things.add_pot(-0.50, 0.10, BLUE, object_id=1)
    things.add_pumpkin(0.42, 0.0, object_id=2)
    things.add_apple(-0.02, -0.52)
    things.add_tin(1.0, 0.35)
    things.add_studio()


def build_thin() -> None:
    """A plant and a basket of wires; a gourd of the plant's color behind them."""
    things.add_table()
    thin_things.add_plant(-0.18, -0.02, LEAF, object_id=1)
    thin_things.add_basket(0.52, -0.50, BLUE, object_id=2)
    things.add_pumpkin(-1.02, -0.06, LEAF)
    things.add_apple(0.50, 0.62, RED_APPLE)
    things.add_tin(-0.52, 0.84)
    things.add_studio()


def on_table(radius: float, height: float):
    """The views of a dome about a point over the middle of the table."""
    return partial(dome_views, radius=radius, target=(0.0, 0.0, height))


def apple(main, second) -> dict:
    """The paints of an apple."""
    return {"apple": {"main": main, "second": second}}


RECIPES = {
    "single": Recipe(
        title="Benchmark capture single: a jug alone on a table",
        place=ON_TABLE.format(1.18),
        about_edits="  The teal jug becomes red, yellow (brighter), violet (darker).",
        build=build_single,
        views=on_table(2.9, 0.42),
        field_of_view=FIELD_OF_VIEW,
        names={"jug": 1},
        edits={
            "jug_to_red": TrueEdit(("jug",), {"jug": {"main": RED}}),
            "jug_to_yellow": TrueEdit(("jug",), {"jug": {"main": YELLOW}}),
            "jug_to_violet": TrueEdit(("jug",), {"jug": {"main": VIOLET}}),
        },
        flaws={("jug", 2): "gap"},
    ),
    "hue": Recipe(
        title="Benchmark capture hue: a red pot and a red apple among red neighbors",
        place=ON_TABLE.format(1.69),
        about_edits="""\
  pot_to_blue   the pot becomes blue
  apple_to_green  the apple becomes green
  both          the pot becomes teal, the apple yellow
  Unmarked, and close to them in hue: a pumpkin, a tin, cherries.""",
        build=build_hue,
        views=on_table(3.6, 0.32),
        field_of_view=FIELD_OF_VIEW,
        names={"pot": 1, "apple": 2},
        edits={
            "pot_to_blue": TrueEdit(("pot",), {"pot": {"main": BLUE}}),
            "apple_to_green": TrueEdit(("apple",), apple((0.14, 0.34, 0.03), (0.30, 0.42, 0.05))),
            "both": TrueEdit(("pot", "apple"), {"pot": {"main": TEAL}} | apple(YELLOW, (0.72, 0.47, 0.07))),
        },
        flaws={("pot", 1): "spill", ("apple", 2): "gap"},
    ),
    "glossy": Recipe(
        title="Benchmark capture glossy: a mirroring vase with checks",
        place=ON_TABLE.format(1.69),
        about_edits="""\
  navy_to_red    the dark checks become red
  navy_to_green  the dark checks become green
  cream_to_pink  the light checks become pink
  Unmarked: an apple, a lemon, a tin.""",
        build=build_glossy,
        views=on_table(3.4, 0.45),
        field_of_view=FIELD_OF_VIEW,
        names={"vase": 1},
        edits={
            "navy_to_red": TrueEdit(("vase",), {"checks": {"main": (0.36, 0.02, 0.03)}}),
            "navy_to_green": TrueEdit(("vase",), {"checks": {"main": (0.02, 0.16, 0.05)}}),
            "cream_to_pink": TrueEdit(("vase",), {"checks": {"second": (0.72, 0.30, 0.36)}}),
        },
        flaws={("vase", 2): "gap"},
    ),
    "front": Recipe(
        title="Benchmark capture front: a pot and a pumpkin before a wall, from one side",
        place=IN_ROOM,
        about_edits="""\
  pot_to_red        the blue pot becomes red
  pumpkin_to_green  the orange pumpkin becomes green
  both              the pot becomes yellow, the pumpkin violet
  Unmarked: an apple, a tin, pictures, books.""",
        build=build_front,
        views=partial(patch_views, center=(0.0, -3.6, 1.0), size=(1.6, 0.9), target=(0.0, 0.3, 0.5)),
        field_of_view=FIELD_OF_VIEW,
        names={"pot": 1, "pumpkin": 2},
        edits={
            "pot_to_red": TrueEdit(("pot",), {"pot": {"main": RED}}),
            "pumpkin_to_green": TrueEdit(("pumpkin",), {"pumpkin": {"main": GREEN}}),
            "both": TrueEdit(("pot", "pumpkin"), {"pot": {"main": YELLOW}, "pumpkin": {"main": VIOLET}}),
        },
        flaws={("pot", 1): "gap"},
    ),
    "thin": Recipe(
        title="Benchmark capture thin: a plant of pointed leaves and a basket of wires",
        place=ON_TABLE.format(1.69),
        about_edits="""\
  plant_to_red      the leaves and stems become dark red; their clay pot stays
  basket_to_orange  the blue basket becomes orange
  both              the plant becomes violet, the basket yellow
  Unmarked: a gourd of the leaves' own color, an apple, a tin.""",
        build=build_thin,
        views=on_table(3.6, 0.42),
        field_of_view=FIELD_OF_VIEW,
        names={"plant": 1, "basket": 2},
        edits={
            "plant_to_red": TrueEdit(("plant",), {"leaf": {"main": (0.32, 0.02, 0.03)}}),
            "basket_to_orange": TrueEdit(("basket",), {"basket": {"main": (0.60, 0.16, 0.02)}}),
            "both": TrueEdit(("plant", "basket"), {"leaf": {"main": VIOLET}, "basket": {"main": YELLOW}}),
        },
    ),
} | PACKAGING


def main(argv: list[str] | None = None) -> int:
    """Make the named scenes, or all."""
    options = parse_arguments(argv)
    for seed in options.seeds:
        make_seed_once(seed, options)
    for seed in options.thin_seeds:
        make_thin_once(seed, options)
    for scene in options.scenes or (RECIPES if not options.seeds and not options.thin_seeds else ()):
        extent = Extent(options.size or RECIPES[scene].size, *(options.views or VIEWS), options.samples)
        capture = options.out / scene
        make_once(scene, extent, capture, options.threads)
        if options.full:
            full = full_size.full_size_of(options)
            enlarge = full_size.enlarge_test_views
            enlarge(RECIPES[scene], extent, full, capture, options.full / scene, options.threads)
    return 0


def parse_arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE", help=", ".join(RECIPES))
    parser.add_argument("--out", type=Path, required=True, help="folder of the captures, DIR/<scene>")
    parser.add_argument("--seeds", type=numbers, default=(), metavar="A-B", help="drawn scenes instead: 7, or 0-7")
    thin = {"type": numbers, "default": (), "metavar": "A-B"}
    parser.add_argument("--thin-seeds", **thin, help="drawn scenes of things with thin parts instead")
    parser.add_argument("--size", type=int, help="width and height in pixels (default: the scene's own, 160 or 320)")
    parser.add_argument("--views", type=views, metavar="TRAIN+TEST", help="numbers (default: 40+8; 24+4 of thin parts)")
    parser.add_argument("--samples", type=int, default=24, help="samples per pixel at most (default: %(default)s)")
    parser.add_argument("--threads", type=int, default=2, help="processor threads (default: %(default)s)")
    full_size.add_options(parser)
    options = parser.parse_args(argv)
    unknown = [scene for scene in options.scenes if scene not in RECIPES]
    if unknown:
        parser.error(f"unknown: {', '.join(unknown)}; choose from {', '.join(RECIPES)}")
    return options


def views(text: str) -> tuple[int, int]:
    """Numbers of training and test views of a text like 40+8. Raises ValueError for any other."""
    train, test = text.split("+")
    return int(train), int(test)


def numbers(text: str) -> range:
    """Numbers of a text like 7 or 0-7. Raises ValueError for any other."""
    first, _, last = text.partition("-")
    return range(int(first), int(last or first) + 1)


def make_once(scene: str, extent: Extent, folder: Path, threads: int) -> None:
    """Make a capture, unless ``folder`` has it."""
    arguments = {"scene": scene, "recipe_version": RECIPE_VERSION} | asdict(extent)
    command = f"python -m tools.scenes.make_captures --out DIR {scene} --size {extent.size}"
    command += f" --views {extent.train}+{extent.test} --samples {extent.samples}"
    unless_there(folder, arguments, lambda out: make_capture(RECIPES[scene], extent, out, command, threads))


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # The bpy module may hang or crash while the interpreter shuts down.
    os._exit(code)
