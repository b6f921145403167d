"""Two scenes of packaging: a silver can with red letters beside a carton, and, drawn otherwise, a foil pouch and a jar.

The first is for work. The second, `packaging_b`, is for reports alone: no constant is chosen on it.
"""

from __future__ import annotations

import math
from functools import partial

from ..procedural import packaging, things
from ..procedural.cameras import turntable_views
from ..procedural.lettering import Area, Label, Text, bars
from ..procedural.recipe import Recipe, TrueEdit

SIZE = 320  # pixels of a photo: at 160 the small print would be one gray
FIELD_OF_VIEW = math.radians(38.0)
PLACE = """\
the table top is the disk z = 0 of
  radius 1.4 about the origin. Behind the table is a smooth gradient that depends only on the viewing direction. The
  test views follow one another on an arc of 8 degrees a step, as a hand walks past."""

RED, GREEN = (0.56, 0.012, 0.016), (0.015, 0.26, 0.05)
BLUE, ORANGE, VIOLET = (0.012, 0.10, 0.46), (0.66, 0.20, 0.012), (0.16, 0.03, 0.36)
OLIVE, PINK = (0.19, 0.21, 0.015), (0.62, 0.07, 0.20)


def can_label() -> Label:
    """Three fields round the can, each with large and small red letters and dark ones."""
    width = 2 * math.pi * packaging.CAN_RADIUS
    marks = []
    for number, (name, kind, weight) in enumerate(
        (("KARF", "RADIANT", 250), ("TEA", "EARL GREY", 100), ("No 7", "BLEND", 75))
    ):
        u = width * (number - 1) / 3
        marks += [
            Text(name, u, 0.17, 0.20, bold=0.04),
            Text(kind, u, -0.04, 0.075, bold=0.03),
            Area(u - 0.28, -0.125, 0.56, 0.018),
            Text("finest leaves from the slope", u, -0.185, 0.034),
            Text("of the hill, picked by hand", u, -0.245, 0.034),
            Text(f"net weight {weight} g", u, -0.32, 0.036, "dark"),
        ]
    return Label(width, packaging.CAN_HEIGHT, tuple(marks))


def carton_label() -> Label:
    """Front with a band, white letters in it, a foil stripe and dark text; the sides with the band, foil and bars."""
    front, side, height = packaging.CARTON[0], packaging.CARTON[1], packaging.CARTON[2]
    width = front + side
    u, v = -0.5 * side, 0.5 * front
    marks = (
        Area(-0.5 * width, 0.05, width, 0.24),
        Area(-0.5 * width, 0.0, width, 0.05, "foil"),
        Text("Sencha", u, 0.17, 0.12, "paper", bold=0.02),
        Text("GREEN TEA", u, 0.345, 0.05, "dark", bold=0.02),
        Text("steamed, rolled and dried", u, -0.07, 0.034, "dark"),
        Text("20 bags", u, -0.17, 0.075, bold=0.02),
        Text("keep cool and dry, away from", u, -0.27, 0.030, "dark"),
        Text("light and from strong scents", u, -0.325, 0.030, "dark"),
        Text("20 x 2 g", v, 0.17, 0.06, "paper", bold=0.03),
        *bars(v - 0.1, -0.33, 0.2, 0.2),
    )
    return Label(width, height, marks)


def build_can_and_carton() -> None:
    """A silver can with red letters, a carton with a band, and neighbors that the can mirrors."""
    things.add_table(0.83)
    packaging.add_can(-0.40, -0.10, can_label(), RED, object_id=1, azimuth=-math.pi / 2)
    packaging.add_carton(0.46, 0.16, carton_label(), BLUE, object_id=2, azimuth=-0.22)
    things.add_lemons(((0.30, -0.62, 0.5),))
    things.add_apple(-0.28, 0.74)
    things.add_studio()


def pouch_label() -> Label:
    """Leaning blue letters across a pouch, a blue foot line, dark and blue small print."""
    width, height = 2 * packaging.POUCH_WIDTH, packaging.POUCH_HEIGHT
    marks = (
        Text("Mocca", 0.0, 0.16, 0.17, lean=0.35, bold=0.0),
        Text("dark roast", 0.03, -0.02, 0.07, lean=0.3, bold=0.01),
        Area(-0.5 * width, -0.115, width, 0.035),
        Text("500 g", -0.20, -0.22, 0.085, bold=0.015),
        Text("arabica", 0.14, -0.19, 0.04, "dark"),
        Text("whole beans", 0.14, -0.26, 0.04),
        Text("ground for filters and pots", 0.0, -0.345, 0.032),
    )
    return Label(width, height, marks)


def jar_label() -> Label:
    """A jar whose olive letters and lines run round it, with dark text."""
    width = 2 * math.pi * packaging.JAR_RADIUS
    marks = [Area(-0.5 * width, 0.12, width, 0.03), Area(-0.5 * width, -0.20, width, 0.06)]
    for number, name in enumerate(("OLIO", "SALE", "PEPE")):
        u = width * (number - 1) / 3
        marks += [Text(name, u, 0.01, 0.12, bold=0.05), Text("of the first harvest", u, -0.11, 0.035, "dark")]
    return Label(width, packaging.JAR_HEIGHT, tuple(marks))


def build_pouch_and_jar() -> None:
    """A foil pouch with blue letters and a jar, by a window on the left."""
    things.add_table(0.83)
    packaging.add_pouch(0.26, 0.12, pouch_label(), BLUE, object_id=1, azimuth=0.35)
    packaging.add_jar(-0.46, -0.16, jar_label(), OLIVE, object_id=2, azimuth=-1.2)
    things.add_cherries(((0.28, -0.62, 0.4), (0.44, -0.52, 1.4)))
    things.add_pumpkin(-0.45, 0.66)
    things.add_light("window", (-3.4, -1.8, 2.2), 2.2, 150.0, (0.92, 0.96, 1.0))
    things.add_light("lamp", (1.6, 2.4, 3.4), 1.0, 70.0, (1.0, 0.86, 0.68))
    things.add_world()


def _views(azimuth: float):
    """All round for training; for tests a walk past the fronts at ``azimuth``."""
    return partial(turntable_views, radius=2.75, target=(0.0, 0.0, 0.42), azimuth=azimuth)


PACKAGING = {
    "packaging": Recipe(
        title="Benchmark capture packaging: a silver can with red letters, and a carton with a band",
        place=PLACE,
        about_edits="""\
  can_to_green      the can's red letters become green; silver and dark letters stay
  carton_to_orange  the carton's blue band and letters become orange; paper, foil and dark letters stay
  both              the can's letters become violet, the carton's band green
  Unmarked: a lemon, an apple.""",
        build=build_can_and_carton,
        views=_views(-math.pi / 2),
        field_of_view=FIELD_OF_VIEW,
        names={"can": 1, "carton": 2},
        edits={
            "can_to_green": TrueEdit(("can",), {"can": {"main": GREEN}}),
            "carton_to_orange": TrueEdit(("carton",), {"carton": {"main": ORANGE}}),
            "both": TrueEdit(("can", "carton"), {"can": {"main": VIOLET}, "carton": {"main": GREEN}}),
        },
        flaws={("can", 1): "gap"},
        size=SIZE,
        printed=True,
    ),
    "packaging_b": Recipe(
        title="Benchmark capture packaging_b: a foil pouch with blue letters, and a jar with olive ones",
        place=PLACE,
        about_edits="""\
  pouch_to_orange  the pouch's blue letters become orange; foil and dark letters stay
  jar_to_pink      the jar's olive letters and lines become pink; card and dark letters stay
  both             the pouch's letters become red, the jar's blue
  Unmarked: cherries, a pumpkin.""",
        build=build_pouch_and_jar,
        views=_views(-1.3),
        field_of_view=FIELD_OF_VIEW,
        names={"pouch": 1, "jar": 2},
        edits={
            "pouch_to_orange": TrueEdit(("pouch",), {"pouch": {"main": ORANGE}}),
            "jar_to_pink": TrueEdit(("jar",), {"jar": {"main": PINK}}),
            "both": TrueEdit(("pouch", "jar"), {"pouch": {"main": RED}, "jar": {"main": BLUE}}),
        },
        flaws={("pouch", 1): "gap"},
        size=SIZE,
        printed=True,
    ),
}
