"""Things with print on them: a can, a carton, a pouch and a jar, whose labels unroll onto their surfaces."""

from __future__ import annotations

import math

import numpy as np

from .lettering import Label, label_image
from .materials import FOIL, Stock, math_node, position_socket, printed
from .shapes import box, grid_object, lathe, place

SILVER = Stock((0.80, 0.80, 0.81), 1.0, 0.24, brushed=0.5)
CARD = Stock((0.74, 0.73, 0.70), 0.0, 0.55)
CAN_RADIUS, CAN_HEIGHT = 0.34, 1.0
JAR_RADIUS, JAR_HEIGHT = 0.30, 0.55
CARTON = (0.62, 0.32, 0.86)
POUCH_WIDTH, POUCH_HEIGHT = 0.40, 1.05  # half of it; all of it


def add_can(x: float, y: float, label: Label, ink, object_id: int = 0, azimuth: float = 0.0) -> None:
    """Add a can of brushed metal of radius 0.34; its label runs round it, the middle at ``azimuth``; material ``can``."""
    profile = upright(CAN_RADIUS, CAN_HEIGHT, 0.29, 0.30)
    place([_turned("can", profile, CAN_RADIUS, SILVER, label, ink, object_id)], x, y, azimuth=azimuth)


def add_jar(x: float, y: float, label: Label, ink, object_id: int = 0, azimuth: float = 0.0) -> None:
    """Add a low jar of white card of radius 0.30, as `add_can`; material ``jar``."""
    profile = upright(JAR_RADIUS, JAR_HEIGHT, 0.29, 0.29)
    place([_turned("jar", profile, JAR_RADIUS, CARD, label, ink, object_id)], x, y, azimuth=azimuth)


def _turned(name: str, profile, radius: float, stock: Stock, label: Label, ink, object_id: int):
    """Add a turned thing of this profile, and of this radius where its label is bent round it."""
    made = printed(name, label_image(name, label), round_it(label, radius), stock, ink)
    return grid_object(name, lathe(profile, columns=160), made, object_id)


def add_carton(x: float, y: float, label: Label, ink, object_id: int = 0, azimuth: float = 0.0) -> None:
    """Add a carton of white paper; front and back show the label's left part, the sides its right; material ``carton``."""
    made = printed("carton", label_image("carton", label), round_box(label, CARTON[0], CARTON[1]), CARD, ink)
    carton = box("carton", CARTON, (0.0, 0.0, 0.5 * CARTON[2]), made)
    carton.pass_index = object_id
    place([carton], x, y, azimuth=azimuth)


def add_pouch(x: float, y: float, label: Label, ink, object_id: int = 0, azimuth: float = 0.0) -> None:
    """Add a standing pouch of wrinkled foil, flat above; its label is on both of its faces; material ``pouch``."""
    made = printed("pouch", label_image("pouch", label), on_faces(label), FOIL, ink)
    place([grid_object("pouch", pouch(), made, object_id)], x, y, azimuth=azimuth)


def pouch() -> np.ndarray:
    """Return the vertex grid of a pouch: an oval foot that closes to a flat seam, with shallow wrinkles."""
    rows, columns = 72, 144
    height = np.linspace(0.0, 1.0, rows)[:, None]
    angle = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)
    width = POUCH_WIDTH * (1.0 - 0.10 * np.sin(math.pi * height))
    depth = 0.20 * (1.0 - height**2) * np.sqrt(np.minimum(1.0, 0.35 + 8.0 * height)) + 0.012
    wrinkles = 0.006 * np.sin(9.0 * height + 5.0 * np.cos(angle)) * np.sin(math.pi * height)
    wrinkles = wrinkles + 0.004 * np.sin(23.0 * height - 3.0 * angle)
    x = width * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** 0.7
    y = (depth + wrinkles) * np.sin(angle)
    body = np.stack([x, y, np.broadcast_to(POUCH_HEIGHT * height, x.shape)], -1)
    ends = [np.broadcast_to((0.0, 0.0, z), (1, columns, 3)) for z in (0.0, POUCH_HEIGHT)]
    return np.concatenate([ends[0], body, ends[1]])


def round_it(label: Label, radius: float):
    """Return where a label is looked up that is bent round a turned thing, its foot at z = 0 and its middle at +x."""

    def spot(tree):
        angle = math_node(tree, "ARCTAN2", position_socket(tree, "Y"), position_socket(tree, "X"))
        return _spot(tree, label, math_node(tree, "MULTIPLY", angle, radius))

    return spot


def round_box(label: Label, width: float, depth: float):
    """Return where a label is looked up whose left ``width`` is on a box's front and back, the rest on its two sides."""

    def spot(tree):
        normal_x, normal_y = (position_socket(tree, axis, "Normal") for axis in "XY")
        sideways = math_node(tree, "GREATER_THAN", math_node(tree, "ABSOLUTE", normal_x, 0.0), 0.7)
        across = math_node(tree, "MULTIPLY", position_socket(tree, "X"), math_node(tree, "SIGN", normal_y, 0.0))
        front = math_node(tree, "SUBTRACT", -0.5 * depth, across)
        side = math_node(tree, "MULTIPLY", position_socket(tree, "Y"), math_node(tree, "SIGN", normal_x, 0.0))
        side = math_node(tree, "ADD", side, 0.5 * width)
        difference = math_node(tree, "MULTIPLY", math_node(tree, "SUBTRACT", side, front), sideways)
        return _spot(tree, label, math_node(tree, "ADD", front, difference))

    return spot


def on_faces(label: Label):
    """Return where a label is looked up that is on the face towards -y and on that towards +y."""

    def spot(tree):
        facing = math_node(tree, "SIGN", position_socket(tree, "Y"), 0.0)
        across = math_node(tree, "MULTIPLY", position_socket(tree, "X"), facing)
        return _spot(tree, label, math_node(tree, "SUBTRACT", 0.0, across))

    return spot


def _spot(tree, label: Label, across):
    """Return the picture's coordinates: from ``across``, u in label units, and the height over the thing's foot."""
    u = math_node(tree, "ADD", math_node(tree, "DIVIDE", across, label.width), 0.5)
    return u, math_node(tree, "DIVIDE", position_socket(tree, "Z"), label.height)


def upright(radius: float, height: float, foot: float, lid: float) -> list[tuple[float, float]]:
    """Return the profile of an upright wall with a narrower foot and lid; points close together keep edges sharp."""
    wall = [(radius, z) for z in np.linspace(0.07, height - 0.08, 6)]
    rim = [(lid, height - 0.01), (lid - 0.005, height), (lid - 0.025, height), (lid - 0.03, height - 0.01)]
    return [
        (0.0, 0.0),
        (foot - 0.01, 0.0),
        (foot, 0.005),
        (radius - 0.004, 0.06),
        *wall,
        (radius - 0.006, height - 0.07),
        *rim,
        (lid - 0.032, height - 0.025),
        (0.0, height - 0.025),
    ]
