"""The things and the lights of the scenes. Things stand on z = 0; ``object_id`` 0 gets no mask."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Matrix, Vector

from .materials import bands, clouds, material, math_node, position_socket, rise
from .shapes import box, grid_object, lathe, place, tube


def add_table(scale: float = 1.0) -> None:
    """Add the round matte table top: radius 1.69 times ``scale``, its upper face at z = 0."""
    rim = [(1.0, 0.0), (1.5, 0.0), (1.62, 0.0), (1.67, -0.01), (1.685, -0.04)]
    profile = [(0.0, 0.0), *rim, *((radius, -0.08 - height) for radius, height in rim[-2::-1]), (0.0, -0.08)]
    grid_object("table", lathe(profile, columns=160) * (scale, scale, 1.0), wood())


def wood():
    """Return the new material of a scene's table."""
    return material("table", (0.50, 0.37, 0.25), 0.85, second=(0.36, 0.25, 0.16), pattern=clouds(3.0, 3.0))


def add_pot(x: float, y: float, color=(0.55, 0.03, 0.025), object_id: int = 0) -> None:
    """Add the glossy pot with lid, knob, spout and handle; material ``pot``."""
    paint = material("pot", color, 0.3)
    profile = [(0.0, 0.0), (0.22, 0.0), (0.26, 0.015), (0.40, 0.16), (0.45, 0.34), (0.40, 0.52), (0.29, 0.635)]
    profile += [(0.255, 0.66), (0.255, 0.68), (0.285, 0.695), (0.28, 0.72), (0.19, 0.785), (0.07, 0.82), (0.045, 0.85)]
    profile += [(0.075, 0.89), (0.095, 0.93), (0.07, 0.975), (0.0, 0.99)]
    handle = [(0.36, 0.57), (0.52, 0.63), (0.66, 0.56), (0.69, 0.40), (0.60, 0.24), (0.40, 0.20)]
    spout = [(0.33, 0.24), (0.50, 0.31), (0.57, 0.44), (0.62, 0.58), (0.68, 0.64)]
    parts = [
        grid_object("pot", lathe(profile), paint, object_id),
        grid_object("pot handle", tube(handle, 0.048, math.radians(125.0)), paint, object_id),
        grid_object("pot spout", tube(spout, (0.13, 0.10, 0.075, 0.06, 0.055), 0.0), paint, object_id),
    ]
    place(parts, x, y)


def add_pumpkin(x: float, y: float, color=(0.62, 0.13, 0.02), object_id: int = 0) -> None:
    """Add the ribbed pumpkin and its stalk; material ``pumpkin``."""
    skin = material("pumpkin", color, 0.5)
    stem = [(0.0, 0.42), (0.01, 0.54), (0.07, 0.62)]
    profile = [
        (0.0, 0.03),
        (0.14, 0.0),
        (0.30, 0.07),
        (0.37, 0.24),
        (0.33, 0.40),
        (0.18, 0.49),
        (0.06, 0.47),
        (0.0, 0.44),
    ]
    parts = [
        grid_object("pumpkin", lathe(profile, ribs=9, rib_depth=0.16, columns=144), skin, object_id),
        grid_object("pumpkin stalk", tube(stem, (0.06, 0.04, 0.045), 1.0), stalk(), object_id),
    ]
    place(parts, x, y, azimuth=0.2)


def stalk():
    """Return the material of all stalks."""
    return bpy.data.materials.get("stalk") or material("stalk", (0.16, 0.13, 0.05), 0.7)


def add_mug(x: float, y: float, object_id: int = 0) -> None:
    """Add the mug with bold bands, a handle and a plain inside; materials ``stripes``, ``glaze`` and ``cream``."""
    blue, cream = (0.02, 0.075, 0.36), (0.76, 0.68, 0.52)
    striped = material("stripes", blue, 0.35, second=cream, pattern=bands(0.21, 0.05))
    glaze = material("glaze", blue, 0.35)
    plain = material("cream", cream, 0.5)
    outside = [(0.0, 0.0), (0.20, 0.0), (0.235, 0.02), (0.27, 0.20), (0.28, 0.40), (0.285, 0.585), (0.275, 0.60)]
    inside = [(0.275, 0.60), (0.26, 0.595), (0.255, 0.40), (0.24, 0.20), (0.20, 0.10), (0.0, 0.10)]
    handle = [(0.276, 0.49), (0.38, 0.50), (0.46, 0.43), (0.46, 0.29), (0.38, 0.18), (0.262, 0.16)]
    parts = [
        grid_object("mug", lathe(outside), striped, object_id),
        grid_object("mug inside", lathe(inside), plain, object_id),
        grid_object("mug handle", tube(handle, 0.042, math.radians(-15.0)), glaze, object_id),
    ]
    place(parts, x, y)


def add_apple(x: float, y: float, colors=((0.16, 0.36, 0.03), (0.34, 0.45, 0.05)), object_id: int = 0) -> None:
    """Add the apple, which is ripe (the second color) above, and its stalk; material ``apple``."""
    skin = material("apple", colors[0], 0.38, second=colors[1], pattern=rise(0.15, 0.5))
    profile = [(0.0, 0.03), (0.09, 0.0), (0.19, 0.06), (0.27, 0.22), (0.28, 0.33), (0.22, 0.44), (0.12, 0.475)]
    profile += [(0.05, 0.455), (0.0, 0.40)]
    parts = [
        grid_object("apple", lathe(profile, ribs=5, rib_depth=0.03), skin, object_id),
        grid_object("apple stalk", tube([(0.0, 0.40), (0.01, 0.48), (0.05, 0.57)], 0.018, 0.5), stalk(), object_id),
    ]
    place(parts, x, y)


def add_lemons(places) -> None:
    """Add a lying lemon at each of ``places``: x, y, azimuth."""
    yellow = material("lemon", (0.72, 0.47, 0.03), 0.45)
    profile = [(0.0, -0.24), (0.035, -0.225), (0.06, -0.19), (0.13, -0.11), (0.16, 0.0), (0.13, 0.11), (0.06, 0.18)]
    profile += [(0.03, 0.21), (0.0, 0.22)]
    for number, (x, y, azimuth) in enumerate(places):
        lemon = grid_object(f"lemon {number}", lathe(profile), yellow)
        lemon.matrix_world = Matrix.Rotation(math.pi / 2, 4, "Y")
        place([lemon], x, y, 0.158, azimuth)


def add_books(x: float, y: float) -> None:
    """Add a stack of two books: dull violet below, dull green above."""
    pages = material("pages", (0.66, 0.58, 0.45), 0.8)
    stack = (
        ("violet", (0.11, 0.065, 0.16), 0.0, (0.54, 0.78), 1.45),
        ("sage", (0.14, 0.19, 0.07), 0.15, (0.46, 0.66), 1.85),
    )
    for name, color, base, (width, length), azimuth in stack:
        cover = material(name, color, 0.6)
        parts = [
            box(f"{name} lower", (length, width, 0.025), (0.0, 0.0, 0.0125), cover),
            box(f"{name} upper", (length, width, 0.025), (0.0, 0.0, 0.1375), cover),
            box(f"{name} spine", (length, 0.025, 0.15), (0.0, 0.5 * width, 0.075), cover),
            box(f"{name} pages", (length - 0.05, width - 0.03, 0.12), (0.0, -0.005, 0.075), pages),
        ]
        place(parts, x, y, base, azimuth)


def add_tin(x: float, y: float, color=(0.20, 0.22, 0.05)) -> None:
    """Add the tin with a lid; material ``tin``."""
    paint = material("tin", color, 0.5)
    profile = [(0.0, 0.0), (0.19, 0.0), (0.20, 0.01), (0.20, 0.15), (0.20, 0.28), (0.215, 0.29), (0.215, 0.36)]
    profile += [(0.205, 0.375), (0.10, 0.38), (0.0, 0.38)]
    place([grid_object("tin", lathe(profile), paint)], x, y)


def add_cherries(places) -> None:
    """Add a dark cherry with its stalk at each of ``places``: x, y, azimuth."""
    dark = material("cherry", (0.10, 0.008, 0.015), 0.35)
    angle = np.linspace(-math.pi / 2, math.pi / 2, 9)
    profile = np.column_stack([0.09 * np.cos(angle), 0.09 + 0.085 * np.sin(angle)])
    for number, (x, y, azimuth) in enumerate(places):
        stem = tube([(0.0, 0.16), (0.03, 0.25), (0.10, 0.31)], 0.012, azimuth)
        parts = [
            grid_object(f"cherry {number}", lathe(profile, columns=48), dark),
            grid_object(f"cherry stalk {number}", stem, stalk()),
        ]
        place(parts, x, y)


def add_studio() -> None:
    """Add the light that all scenes share: a warm key light, a cool fill light and the backdrop."""
    add_light("key", (2.6, -2.4, 4.2), 3.2, 255.0, (1.0, 0.96, 0.9))
    add_light("fill", (-3.6, 1.2, 2.6), 3.0, 60.0, (0.9, 0.95, 1.0))
    add_world()


def add_room() -> None:
    """Add a wide table before a wall with pictures and a shelf of books, seen from where y is negative."""
    plaster = material("wall", (0.46, 0.47, 0.44), 0.9, second=(0.34, 0.37, 0.37), pattern=clouds(1.5, 1.0))
    boards = material("floor", (0.20, 0.15, 0.11), 0.8, second=(0.30, 0.23, 0.17), pattern=clouds(6.0, 5.0))
    table = wood()
    box("table", (4.4, 2.4, 0.08), (0.0, 0.2, -0.04), table)
    box("floor", (16.0, 12.0, 0.1), (0.0, 0.0, -1.05), boards)
    box("wall", (16.0, 0.1, 9.0), (0.0, 3.4, 2.0), plaster)
    pictures = (
        (-1.5, 1.45, (0.9, 1.1), (0.12, 0.25, 0.35), (0.60, 0.55, 0.40)),
        (0.1, 1.75, (1.2, 0.8), (0.45, 0.30, 0.08), (0.10, 0.14, 0.10)),
    )
    for number, (x, z, (width, height), *paints) in enumerate(pictures):
        canvas = material(f"picture {number}", paints[0], 0.8, second=paints[1], pattern=clouds(4.0, 1.0))
        box(f"picture {number}", (width, 0.06, height), (x, 3.32, z), canvas)
    box("shelf", (2.2, 0.5, 0.06), (1.9, 3.1, 0.55), table)
    rng = np.random.default_rng(3)
    for number in range(13):
        cover = material(f"cover {number}", rng.uniform(0.04, 0.4, 3).tolist(), 0.6)
        height = rng.uniform(0.45, 0.7)
        box(f"book {number}", (0.12, 0.36, height), (1.0 + 0.145 * number, 3.1, 0.58 + height / 2), cover)


def add_light(name: str, position, size: float, energy: float, color) -> None:
    """Add a square area light, hidden from the camera, that shines on the still life; ``energy`` in watts."""
    data = bpy.data.lights.new(name, "AREA")
    data.size, data.energy, data.color = size, energy, color
    light = bpy.data.objects.new(name, data)
    light.visible_camera = False
    direction = Vector((0.0, 0.0, 0.2)) - Vector(position)
    light.matrix_world = Matrix.Translation(position) @ direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    bpy.context.scene.collection.objects.link(light)


def add_world() -> None:
    """Add the studio backdrop: a smooth vertical gradient of cool grey, brighter overhead."""
    world = bpy.data.worlds.new("studio")
    world.use_nodes = True
    bpy.context.scene.world = world
    tree = world.node_tree
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.interpolation = "EASE"
    ramp.color_ramp.elements[0].color = (0.15, 0.20, 0.22, 1.0)
    ramp.color_ramp.elements[1].color = (0.75, 0.80, 0.84, 1.0)
    middle = ramp.color_ramp.elements.new(0.5)
    middle.color = (0.38, 0.45, 0.47, 1.0)
    height = math_node(tree, "MULTIPLY", position_socket(tree, "Z"), 0.5)
    tree.links.new(math_node(tree, "ADD", height, 0.5), ramp.inputs[0])
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(ramp.outputs[0], background.inputs[0])
