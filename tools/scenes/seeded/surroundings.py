"""The surroundings and the lights of the drawn things, in Blender."""

from __future__ import annotations

import math

import bpy
import numpy as np
from mathutils import Euler

from ..materials import clouds, material
from ..shapes import box, grid_object, lathe
from ..things import add_light, add_room, add_table, add_world, wood
from .scene import Scene

PLAIN = (0.32, 0.33, 0.34)
SKY = {"sun": ((0.55, 0.68, 0.85), (0.10, 0.25, 0.62)), "overcast": ((0.80, 0.82, 0.84), (0.62, 0.65, 0.70))}
SUN, SUN_ANGLE = 3.0, math.radians(1.0)
CLIPPED = 1.6  # how much brighter than white clouds are at most
CLOUD_STEP = 0.01  # by which clouds move from photo to photo


def add_surroundings(scene: Scene) -> None:
    """Add the place of a scene and its light."""
    rng = np.random.default_rng((scene.seed, 1))
    {"table": _table, "shelf": _shelf, "garden": _garden, "room": _room}[scene.place](rng)
    _backdrop(scene)
    if scene.light == "lamps":
        for number, side in enumerate((-1.0, 1.0)):
            position = (side * rng.uniform(1.5, 3.5), rng.uniform(-3.5, -1.5), rng.uniform(2.5, 4.5))
            warm = rng.uniform(0.7, 1.0)
            add_light(f"lamp {number}", position, rng.uniform(0.3, 2.5), rng.uniform(80, 220), (1.0, 0.95 * warm, warm))
    if scene.light == "sun":
        _sun(rng)


def _table(rng) -> None:
    add_table()


def _room(rng) -> None:
    add_room()


def _shelf(rng) -> None:
    """Two boards before a back panel, between two sides."""
    boards = wood()
    back = material("back", rng.uniform(0.15, 0.5, 3).tolist(), 0.9, rng.uniform(0.15, 0.5, 3).tolist(), clouds(3, 2))
    box("back", (3.8, 0.06, 2.8), (0.0, 0.55, 1.0), back)
    for height in (-0.04, 1.16, 2.36):
        box("board", (3.6, 1.0, 0.08), (0.0, 0.05, height), boards)
    for side in (-1.84, 1.84):
        box("side", (0.08, 1.0, 2.5), (side, 0.05, 1.15), boards)
    plaster = material("wall", (0.55, 0.53, 0.48), 0.9, second=(0.45, 0.44, 0.42), pattern=clouds(1.0, 1.0))
    box("wall", (14.0, 0.1, 9.0), (0.0, 0.7, 1.5), plaster)


def _garden(rng) -> None:
    """A lawn, bushes at some distance, and hills behind."""
    grass = material("grass", (0.10, 0.20, 0.05), 0.9, second=(0.22, 0.26, 0.08), pattern=clouds(1.3, 1.0))
    box("lawn", (160.0, 160.0, 0.2), (0.0, 0.0, -0.1), grass)
    ball = lathe([(0.0, 0.0), (0.7, 0.1), (1.0, 0.6), (0.7, 1.3), (0.0, 1.5)], ribs=13, rib_depth=0.15)
    for number in range(int(rng.integers(6, 12))):
        green = (rng.uniform(0.03, 0.15), rng.uniform(0.1, 0.3), rng.uniform(0.02, 0.08))
        leaves = material(f"bush {number}", green, 0.9, second=tuple(0.4 * c for c in green), pattern=clouds(4.0, 1.0))
        azimuth, distance, size = rng.uniform(0, 2 * math.pi), rng.uniform(6.5, 14), rng.uniform(0.5, 1.6)
        bush = grid_object(f"bush {number}", ball * size, leaves)
        bush.location = (distance * math.cos(azimuth), distance * math.sin(azimuth), -0.02)
    hill = lathe([(0.0, 0.9), (0.3, 0.8), (0.7, 0.3), (1.0, 0.0)])
    for number in range(int(rng.integers(4, 9))):
        paint = material(f"hill {number}", (0.14, rng.uniform(0.2, 0.3), rng.uniform(0.15, 0.3)), 1.0)
        azimuth, width = rng.uniform(0, 2 * math.pi), rng.uniform(12, 30)
        far = grid_object(f"hill {number}", hill * (width, width, rng.uniform(4, 11)), paint)
        far.location = (60 * math.cos(azimuth), 60 * math.sin(azimuth), -0.3)


def _sun(rng) -> None:
    data = bpy.data.lights.new("sun", "SUN")
    data.energy, data.angle, data.color = SUN, SUN_ANGLE, (1.0, 0.96, 0.88)
    light = bpy.data.objects.new("sun", data)
    light.rotation_euler = Euler((rng.uniform(0.3, 1.0), 0.0, rng.uniform(-0.9, 0.9)))
    bpy.context.scene.collection.objects.link(light)


def _backdrop(scene: Scene) -> None:
    """The world: a sky over a garden, else the studio's gradient or one gray; nothing behind a matte."""
    if scene.place == "garden":
        _sky(SKY["sun" if scene.light == "sun" else "overcast"])
    elif scene.background == "plain":
        world = bpy.data.worlds.new("plain")
        world.use_nodes = True
        _background(world).inputs[0].default_value = (*PLAIN, 1.0)
        bpy.context.scene.world = world
    else:
        add_world()
    bpy.context.scene.render.film_transparent = scene.background == "matte"


def _sky(colors) -> None:
    """A gradient from the horizon up, and clouds that are brighter than white and move with the frame."""
    world = bpy.data.worlds.new("sky")
    world.use_nodes = True
    world.cycles.sampling_method, world.cycles.sample_map_resolution = (
        "MANUAL",
        128,
    )  # else made anew, large, each photo
    bpy.context.scene.world = world
    nodes, link = world.node_tree.nodes, world.node_tree.links.new
    direction = nodes.new("ShaderNodeTexCoord").outputs["Generated"]
    split, ramp, noise = (nodes.new(f"ShaderNode{kind}") for kind in ("SeparateXYZ", "ValToRGB", "TexNoise"))
    link(direction, split.inputs[0])
    link(split.outputs["Z"], ramp.inputs[0])
    for element, color in zip(ramp.color_ramp.elements, colors, strict=True):
        element.color = (*color, 1.0)
    moved = nodes.new("ShaderNodeMapping")
    moved.inputs["Scale"].default_value = (2.0, 2.0, 5.0)
    follow = moved.inputs["Location"].driver_add("default_value", 0).driver
    follow.expression = f"{CLOUD_STEP} * frame"
    link(direction, moved.inputs["Vector"])
    link(moved.outputs[0], noise.inputs["Vector"])
    shape = nodes.new("ShaderNodeMapRange")
    shape.inputs["From Min"].default_value, shape.inputs["From Max"].default_value = 0.5, 0.7
    link(noise.outputs[0], shape.inputs["Value"])
    mix = nodes.new("ShaderNodeMix")
    mix.data_type = "RGBA"
    link(shape.outputs[0], mix.inputs[0])
    link(ramp.outputs[0], mix.inputs[6])
    mix.inputs[7].default_value = (CLIPPED, CLIPPED, CLIPPED, 1.0)
    link(mix.outputs[2], _background(world).inputs[0])


def _background(world):
    return next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
