"""Make the demo capture: a still life rendered with Cycles, its true labels and depth, its true recolors and rough masks.

    python tools/make_demo_capture.py --out DIR [--only photos truth recolors masks]

Needs the bpy wheel, numpy and imageio. Everything is procedural and seeded: the same arguments give the same files.

Naming: z is up and the table top is z = 0; lengths are scene units (read them as metres); base colors are scene linear.
Pixel corners lie at integers, pixel centers at +0.5; camera_to_world matrices use Blender axes (x right, y up, looks
down -z). A label image holds one object id per pixel, seen through the pixel center.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import bpy
import imageio.v3 as iio
import numpy as np
from mathutils import Matrix, Vector
from PIL import Image

NAMES = {"pot": 1, "mug": 2, "apple": 3}
STEPS = ("photos", "truth", "recolors", "masks")
FIELD_OF_VIEW = math.radians(38.0)
DOME_RADIUS = 4.2
ELEVATIONS = (math.radians(12.0), math.radians(65.0))
LOOK_AT = (0.0, 0.02, 0.27)
DEPTH_UNIT = 0.001
NO_DEPTH = 65535
IOU_RANGE = (0.77, 0.88)
LABEL_COLORS = (0, 0, 0, 220, 50, 40, 40, 90, 220, 90, 190, 50)

# What each edit changes: material -> the colors of its slots.
EDITS = {
    "pot_to_blue": {"pot": {"main": (0.018, 0.12, 0.50)}},
    "mug_and_apple": {
        "stripes": {"main": (0.62, 0.035, 0.17)},
        "glaze": {"main": (0.62, 0.035, 0.17)},
        "apple": {"main": (0.66, 0.36, 0.025), "second": (0.72, 0.47, 0.07)},
    },
}
EDITED_OBJECTS = {"pot_to_blue": ["pot"], "mug_and_apple": ["mug", "apple"]}

# The deliberate faults of the coarse masks: (object, place in its three views) -> fault.
FLAWS = {("pot", 2): "gap", ("mug", 1): "spill"}

README = """\
Demo capture: a still life of a red teapot, a striped mug, a green apple and unmarked neighbors
================================================================================================

Rendered with Cycles from a procedural scene; public domain (CC0 1.0). Made by
    python tools/make_demo_capture.py --out demo
(bpy {blender}, {size} x {size} pixels, up to {samples} samples per pixel, denoised, view transform Standard).

What is where
  transforms_train.json, transforms_test.json   cameras, NeRF-synthetic layout (file_path has no extension)
  train/r_000.png ...       {train} training photos, 8-bit sRGB, no alpha
  test/r_000.png ...        {test} test photos, their directions lie between those of the training photos
  labels/<split>/r_000.png  object id of each pixel (palette image, pixel value = id), one ray per pixel center
  labels/names.json         object name -> id; 0 is everything else
  depth/test/r_000.png      16-bit depth along the camera axis in steps of 0.001 scene units; 65535 = nothing there
  recolor/<edit>/test/      the test photos with only the materials' base colors changed (same light, same seed)
  recolor/<edit>/train/     the same for one training photo, the reference view {reference}
  edits.json                edit -> the objects it changes and its reference view
  coarse_masks/one/<object>/    one rough mask of each object (0 or 255), named after its training view
  coarse_masks/three/<object>/  the same mask and two more, from far-apart sides

Conventions
  camera_to_world matrices are 4x4, camera axes x right, y up, looking down -z; the world has z up.
  Pinhole, square pixels, camera_angle_x in radians, principal point at the center of the image.
  Pixel corners lie at integers, pixel centers at +0.5. Lengths are scene units; the table top is the disk z = 0 of
  radius 1.69 about the origin; all objects stand within 1.3 of it and reach up to z = 1.0; the cameras lie on a
  dome of radius 4.0 to 4.35 about (0, 0.02, 0.27). Behind the table is a smooth gradient that depends only on the
  viewing direction.

Edits
  pot_to_blue    the red pot (body, lid, handle, spout) becomes a medium blue
  mug_and_apple  the blue bands and handle of the mug become magenta, the cream stays cream;
                 the green apple becomes golden yellow
  Unmarked: a pumpkin that touches the pot and is close to it in hue, an olive tin and a green book close to the
  apple, dark red cherries, lemons, a violet book. A true recolor also changes the light that the object reflects
  onto its surroundings, so a recolored render differs slightly from the photo outside the object.

Coarse masks
  Made from the true labels by coarse_mask() of the tool: the signed distance to the border plus smooth noise (cells
  of 12 pixels, deviation 2.6 pixels) and a constant shift, thresholded at 0. "spill": a disk added across the border
  onto another marked object. "gap": a disk cut out at the border. IoU is against the true label.

{masks}
"""


@dataclass(frozen=True)
class View:
    """One camera: its stem (``r_007``), its split (``train`` or ``test``) and its 4x4 camera_to_world matrix."""

    split: str
    stem: str
    camera_to_world: Matrix


# ---------------------------------------------------------------------------------------------------------- cameras


def dome_views(train: int, test: int) -> list[View]:
    """Return the views of both splits, spread over the dome by one golden-angle spiral with a small jitter.

    The test views are taken at regular steps of the common spiral, so each lies between training directions.
    """
    count = train + test
    rng = np.random.default_rng(7)
    low, high = (math.sin(angle) for angle in ELEVATIONS)
    test_places = {int((k + 0.5) * count / test) for k in range(test)} if test else set()
    numbers = {"train": 0, "test": 0}
    views = []
    for place in range(count):
        split = "test" if place in test_places else "train"
        elevation = math.asin(low + (high - low) * (place + 0.5) / count)
        azimuth = place * math.pi * (3.0 - math.sqrt(5.0))
        radius = DOME_RADIUS + rng.uniform(-0.1, 0.1)
        target = Vector(LOOK_AT) + Vector(rng.uniform(-0.05, 0.05, 3))
        views.append(View(split, f"r_{numbers[split]:03d}", look_at(azimuth, elevation, radius, target)))
        numbers[split] += 1
    return views


def look_at(azimuth: float, elevation: float, radius: float, target: Vector) -> Matrix:
    """Return the camera_to_world matrix of a camera on a sphere of ``radius`` about ``target``, angles in radians."""
    direction = Vector(
        (math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation))
    )
    rotation = direction.to_track_quat("Z", "Y").to_matrix().to_4x4()
    return Matrix.Translation(target + radius * direction) @ rotation


def write_transforms(out: Path, views: list[View]) -> None:
    """Write ``transforms_train.json`` and ``transforms_test.json`` in the NeRF-synthetic layout."""
    for split in ("train", "test"):
        frames = [
            {
                "file_path": f"./{split}/{view.stem}",
                "transform_matrix": [[round(x, 9) for x in row] for row in view.camera_to_world],
            }
            for view in views
            if view.split == split
        ]
        write_json(out / f"transforms_{split}.json", {"camera_angle_x": FIELD_OF_VIEW, "frames": frames})


# -------------------------------------------------------------------------------------------------------- materials


def material(name: str, color, roughness: float, second=None, pattern=None):
    """Return a Principled material; with ``second``, ``pattern(tree)`` gives the socket that mixes in the second color.

    The color sockets are found again by ``set_colors``: the slots are called ``main`` and ``second``.
    """
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = roughness
    for slot, value in (("main", color), ("second", second)):
        if value is not None:
            tree.nodes.new("ShaderNodeRGB").name = slot
            tree.nodes[slot].outputs[0].default_value = (*value, 1.0)
    source = tree.nodes["main"].outputs[0]
    if second is not None:
        mix = tree.nodes.new("ShaderNodeMix")
        mix.data_type = "RGBA"
        tree.links.new(pattern(tree), mix.inputs[0])
        tree.links.new(source, mix.inputs[6])
        tree.links.new(tree.nodes["second"].outputs[0], mix.inputs[7])
        source = mix.outputs[2]
    tree.links.new(source, shader.inputs["Base Color"])
    return made


def set_colors(colors) -> dict:
    """Set ``{material: {slot: (r, g, b)}}`` and return the same mapping with the colors that were there before."""
    before = {}
    for name, slots in colors.items():
        nodes = bpy.data.materials[name].node_tree.nodes
        before[name] = {slot: tuple(nodes[slot].outputs[0].default_value)[:3] for slot in slots}
        for slot, value in slots.items():
            nodes[slot].outputs[0].default_value = (*value, 1.0)
    return before


def math_node(tree, operation: str, value, other: float, clamp: bool = False):
    """Return the output socket of a math node fed by the socket ``value`` and the number ``other``."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    node.use_clamp = clamp
    tree.links.new(value, node.inputs[0])
    node.inputs[1].default_value = other
    return node.outputs[0]


def height_socket(tree):
    """Return the socket of the object-space height."""
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinates.outputs["Object"], split.inputs[0])
    return split.outputs["Z"]


def bands(period: float, offset: float):
    """Return a pattern of horizontal bands of equal width: 0 and 1 alternate along the object's height."""

    def pattern(tree):
        shifted = math_node(tree, "ADD", height_socket(tree), offset)
        wave = math_node(tree, "SINE", math_node(tree, "MULTIPLY", shifted, 2.0 * math.pi / period), 0.0)
        return math_node(tree, "ADD", math_node(tree, "MULTIPLY", wave, 8.0), 0.5, clamp=True)

    return pattern


def rise(low: float, high: float):
    """Return a pattern that goes from 0 at object height ``low`` to 1 at ``high``."""

    def pattern(tree):
        shifted = math_node(tree, "SUBTRACT", height_socket(tree), low)
        return math_node(tree, "DIVIDE", shifted, high - low, clamp=True)

    return pattern


def clouds(scale: float, stretch: float):
    """Return a pattern of soft noise with ``scale`` blobs per unit, ``stretch`` times longer along x."""

    def pattern(tree):
        coordinates = tree.nodes.new("ShaderNodeTexCoord")
        mapping = tree.nodes.new("ShaderNodeMapping")
        mapping.inputs["Scale"].default_value = (scale / stretch, scale, scale)
        noise = tree.nodes.new("ShaderNodeTexNoise")
        noise.inputs["Scale"].default_value = 1.0
        noise.inputs["Detail"].default_value = 1.0
        tree.links.new(coordinates.outputs["Object"], mapping.inputs[0])
        tree.links.new(mapping.outputs[0], noise.inputs["Vector"])
        return noise.outputs[0]

    return pattern


# ----------------------------------------------------------------------------------------------------------- shapes


def smooth_curve(points, per_span: int = 8) -> np.ndarray:
    """Return the Catmull-Rom curve through ``points`` (N, D) as ((N - 1) * per_span + 1, D)."""
    points = np.asarray(points, float)
    padded = np.concatenate([2 * points[:1] - points[1:2], points, 2 * points[-1:] - points[-2:-1]])
    t = np.linspace(0.0, 1.0, per_span, endpoint=False)[:, None]
    spans = []
    for a, b, c, d in zip(padded[:-3], padded[1:-2], padded[2:-1], padded[3:], strict=True):
        bend = (2 * a - 5 * b + 4 * c - d) * t**2 + (3 * b - a - 3 * c + d) * t**3
        spans.append(0.5 * (2 * b + (c - a) * t + bend))
    return np.concatenate([*spans, points[-1:]])


def grid_object(name: str, grid: np.ndarray, made, object_id: int = 0):
    """Add the smooth surface of a vertex grid (rows, columns, 3) whose columns close on themselves."""
    rows, columns = grid.shape[:2]
    faces = [
        (i * columns + j, i * columns + (j + 1) % columns, (i + 1) * columns + (j + 1) % columns, (i + 1) * columns + j)
        for i in range(rows - 1)
        for j in range(columns)
    ]
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(grid.reshape(-1, 3).tolist(), [], faces)
    mesh.shade_smooth()
    mesh.materials.append(made)
    added = bpy.data.objects.new(name, mesh)
    added.pass_index = object_id
    bpy.context.scene.collection.objects.link(added)
    return added


def lathe(profile, ribs: int = 0, rib_depth: float = 0.0, columns: int = 96) -> np.ndarray:
    """Return the vertex grid of a profile of (radius, height) points turned about z, with optional vertical ribs."""
    curve = smooth_curve(profile)
    angle = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)
    furrow = 1.0 - rib_depth * (1.0 - np.abs(np.sin(0.5 * ribs * angle))) ** 2
    radius = np.maximum(curve[:, :1], 1e-4) * furrow
    height = np.broadcast_to(curve[:, 1:], radius.shape)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1)


def tube(path, thickness, azimuth: float, columns: int = 24) -> np.ndarray:
    """Return the vertex grid of a tube along a path of (radius, height) points in the vertical plane at ``azimuth``.

    ``thickness`` is one tube radius, or one per path point.
    """
    path = np.asarray(path, float)
    thick = np.broadcast_to(np.asarray(thickness, float), len(path))
    curve = smooth_curve(np.column_stack([path, thick]))
    tangent = np.gradient(curve[:, :2], axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    outward = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    sideways = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    up = np.array([0.0, 0.0, 1.0])
    center = curve[:, :1] * outward + curve[:, 1:2] * up
    normal = -tangent[:, 1:] * outward + tangent[:, :1] * up
    angle = np.linspace(0.0, 2.0 * math.pi, columns, endpoint=False)[:, None]
    ring = np.cos(angle) * normal[:, None] + np.sin(angle) * sideways
    body = center[:, None] + curve[:, 2][:, None, None] * ring
    caps = [np.repeat(center[i][None, None], columns, 1) for i in (0, -1)]
    return np.concatenate([caps[0], body, caps[1]])


def box(name: str, size, center, made):
    """Add a box with slightly rounded edges; ``size`` and ``center`` in scene units."""
    bpy.ops.mesh.primitive_cube_add(size=1.0)
    added = bpy.context.object
    added.name = name
    added.data.transform(Matrix.LocRotScale(Vector(center), None, Vector(size)))
    added.data.materials.append(made)
    bevel = added.modifiers.new("edges", "BEVEL")
    bevel.width, bevel.segments = 0.012, 3
    return added


def place(objects, x: float, y: float, z: float = 0.0, azimuth: float = 0.0) -> None:
    """Move objects built at the origin to (x, y, z), turned about z by ``azimuth`` radians."""
    for item in objects:
        item.matrix_world = Matrix.Translation((x, y, z)) @ Matrix.Rotation(azimuth, 4, "Z") @ item.matrix_world


# ------------------------------------------------------------------------------------------------------------ scene


def add_table() -> None:
    """Add the round matte table top: radius 1.7, its upper face at z = 0."""
    wood = material("table", (0.50, 0.37, 0.25), 0.85, second=(0.36, 0.25, 0.16), pattern=clouds(3.0, 3.0))
    rim = [(1.0, 0.0), (1.5, 0.0), (1.62, 0.0), (1.67, -0.01), (1.685, -0.04)]
    profile = [(0.0, 0.0), *rim, *((radius, -0.08 - height) for radius, height in rim[-2::-1]), (0.0, -0.08)]
    grid_object("table", lathe(profile, columns=160), wood)


def add_pot() -> None:
    """Add the glossy red pot with lid, knob, spout and handle."""
    red = material("pot", (0.55, 0.03, 0.025), 0.3)
    profile = [(0.0, 0.0), (0.22, 0.0), (0.26, 0.015), (0.40, 0.16), (0.45, 0.34), (0.40, 0.52), (0.29, 0.635)]
    profile += [(0.255, 0.66), (0.255, 0.68), (0.285, 0.695), (0.28, 0.72), (0.19, 0.785), (0.07, 0.82), (0.045, 0.85)]
    profile += [(0.075, 0.89), (0.095, 0.93), (0.07, 0.975), (0.0, 0.99)]
    handle = [(0.36, 0.57), (0.52, 0.63), (0.66, 0.56), (0.69, 0.40), (0.60, 0.24), (0.40, 0.20)]
    spout = [(0.33, 0.24), (0.50, 0.31), (0.57, 0.44), (0.62, 0.58), (0.68, 0.64)]
    parts = [
        grid_object("pot", lathe(profile), red, NAMES["pot"]),
        grid_object("pot handle", tube(handle, 0.048, math.radians(125.0)), red, NAMES["pot"]),
        grid_object("pot spout", tube(spout, (0.13, 0.10, 0.075, 0.06, 0.055), 0.0), red, NAMES["pot"]),
    ]
    place(parts, -0.05, 0.15)


def add_pumpkin() -> None:
    """Add the orange pumpkin that touches the pot."""
    orange = material("pumpkin", (0.62, 0.13, 0.02), 0.5)
    stalk = material("stalk", (0.16, 0.13, 0.05), 0.7)
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
        grid_object("pumpkin", lathe(profile, ribs=9, rib_depth=0.16, columns=144), orange),
        grid_object("pumpkin stalk", tube([(0.0, 0.42), (0.01, 0.54), (0.07, 0.62)], (0.06, 0.04, 0.045), 1.0), stalk),
    ]
    place(parts, 0.42, 0.80, azimuth=0.2)


def add_mug() -> None:
    """Add the mug with bold blue and cream bands, a blue handle and a plain cream inside."""
    blue, cream = (0.02, 0.075, 0.36), (0.76, 0.68, 0.52)
    striped = material("stripes", blue, 0.35, second=cream, pattern=bands(0.21, 0.05))
    glaze = material("glaze", blue, 0.35)
    plain = material("cream", cream, 0.5)
    outside = [(0.0, 0.0), (0.20, 0.0), (0.235, 0.02), (0.27, 0.20), (0.28, 0.40), (0.285, 0.585), (0.275, 0.60)]
    inside = [(0.275, 0.60), (0.26, 0.595), (0.255, 0.40), (0.24, 0.20), (0.20, 0.10), (0.0, 0.10)]
    handle = [(0.276, 0.49), (0.38, 0.50), (0.46, 0.43), (0.46, 0.29), (0.38, 0.18), (0.262, 0.16)]
    parts = [
        grid_object("mug", lathe(outside), striped, NAMES["mug"]),
        grid_object("mug inside", lathe(inside), plain, NAMES["mug"]),
        grid_object("mug handle", tube(handle, 0.042, math.radians(-15.0)), glaze, NAMES["mug"]),
    ]
    place(parts, 0.70, -0.36)


def add_apple() -> None:
    """Add the green apple and its stalk."""
    green, ripe = (0.16, 0.36, 0.03), (0.34, 0.45, 0.05)
    skin = material("apple", green, 0.38, second=ripe, pattern=rise(0.15, 0.5))
    profile = [(0.0, 0.03), (0.09, 0.0), (0.19, 0.06), (0.27, 0.22), (0.28, 0.33), (0.22, 0.44), (0.12, 0.475)]
    profile += [(0.05, 0.455), (0.0, 0.40)]
    parts = [
        grid_object("apple", lathe(profile, ribs=5, rib_depth=0.03), skin, NAMES["apple"]),
        grid_object(
            "apple stalk",
            tube([(0.0, 0.40), (0.01, 0.48), (0.05, 0.57)], 0.018, 0.5),
            bpy.data.materials["stalk"],
            NAMES["apple"],
        ),
    ]
    place(parts, 0.04, -0.70)


def add_lemons() -> None:
    """Add two lemons lying on the table."""
    yellow = material("lemon", (0.72, 0.47, 0.03), 0.45)
    profile = [(0.0, -0.24), (0.035, -0.225), (0.06, -0.19), (0.13, -0.11), (0.16, 0.0), (0.13, 0.11), (0.06, 0.18)]
    profile += [(0.03, 0.21), (0.0, 0.22)]
    for number, (x, y, azimuth) in enumerate(((-0.54, -0.80, 0.5), (-0.41, -0.47, -0.6))):
        lemon = grid_object(f"lemon {number}", lathe(profile), yellow)
        lemon.matrix_world = Matrix.Rotation(math.pi / 2, 4, "Y")
        place([lemon], x, y, 0.158, azimuth)


def add_books() -> None:
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
        place(parts, -0.90, 0.12, base, azimuth)


def add_tin() -> None:
    """Add the olive tin with a lid."""
    olive = material("olive", (0.20, 0.22, 0.05), 0.5)
    profile = [(0.0, 0.0), (0.19, 0.0), (0.20, 0.01), (0.20, 0.15), (0.20, 0.28), (0.215, 0.29), (0.215, 0.36)]
    profile += [(0.205, 0.375), (0.10, 0.38), (0.0, 0.38)]
    place([grid_object("tin", lathe(profile), olive)], 0.98, 0.26)


def add_cherries() -> None:
    """Add three dark cherries with their stalks."""
    dark = material("cherry", (0.10, 0.008, 0.015), 0.35)
    angle = np.linspace(-math.pi / 2, math.pi / 2, 9)
    profile = np.column_stack([0.09 * np.cos(angle), 0.09 + 0.085 * np.sin(angle)])
    for number, (x, y, azimuth) in enumerate(((0.40, -0.98, 0.4), (0.57, -0.90, 1.4), (0.24, -1.12, 2.6))):
        stalk = tube([(0.0, 0.16), (0.03, 0.25), (0.10, 0.31)], 0.012, azimuth)
        parts = [
            grid_object(f"cherry {number}", lathe(profile, columns=48), dark),
            grid_object(f"cherry stalk {number}", stalk, bpy.data.materials["stalk"]),
        ]
        place(parts, x, y)


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
    height = math_node(tree, "MULTIPLY", height_socket(tree), 0.5)
    tree.links.new(math_node(tree, "ADD", height, 0.5), ramp.inputs[0])
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(ramp.outputs[0], background.inputs[0])


def build_scene() -> None:
    """Build the still life in an empty file."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    add_table()
    add_pot()
    add_pumpkin()
    add_mug()
    add_apple()
    add_lemons()
    add_books()
    add_tin()
    add_cherries()
    add_light("key", (2.6, -2.4, 4.2), 3.2, 255.0, (1.0, 0.96, 0.9))
    add_light("fill", (-3.6, 1.2, 2.6), 3.0, 60.0, (0.9, 0.95, 1.0))
    add_world()


# ---------------------------------------------------------------------------------------------------------- renders


def set_up_render(size: int) -> None:
    """Set the camera and the render settings that all passes share: ``size`` pixels square, CPU, fixed seed."""
    scene = bpy.context.scene
    camera = bpy.data.cameras.new("camera")
    camera.angle = FIELD_OF_VIEW
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.collection.objects.link(scene.camera)
    render = scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = size
    render.resolution_percentage = 100
    render.use_persistent_data = True
    render.threads_mode, render.threads = "FIXED", 2
    scene.cycles.device = "CPU"
    scene.cycles.seed = 1
    scene.cycles.max_bounces = 6
    scene.cycles.denoiser = "OPENIMAGEDENOISE"
    scene.view_settings.view_transform = "Standard"


def set_up_photo(samples: int) -> None:
    """Make the next renders photos: adaptive sampling up to ``samples``, denoised, 8-bit sRGB."""
    scene = bpy.context.scene
    scene.use_nodes = False
    layer = scene.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_z = False
    scene.cycles.samples = samples
    scene.cycles.use_adaptive_sampling = True
    scene.cycles.adaptive_threshold = 0.02
    scene.cycles.use_denoising = True
    scene.cycles.filter_width = 1.5
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"


def set_up_truth(folder: Path) -> None:
    """Make the next renders ground truth: one ray through each pixel center, id and depth as float EXR in ``folder``."""
    scene = bpy.context.scene
    layer = scene.view_layers[0]
    layer.use_pass_object_index = layer.use_pass_z = True
    scene.cycles.samples = 1
    scene.cycles.use_adaptive_sampling = False
    scene.cycles.use_denoising = False
    scene.cycles.filter_width = 0.01
    scene.use_nodes = True
    tree = scene.node_tree
    tree.nodes.clear()
    layers = tree.nodes.new("CompositorNodeRLayers")
    tree.links.new(layers.outputs["Image"], tree.nodes.new("CompositorNodeComposite").inputs[0])
    for name in ("IndexOB", "Depth"):
        sink = tree.nodes.new("CompositorNodeOutputFile")
        sink.base_path = str(folder)
        sink.format.file_format = "OPEN_EXR"
        sink.format.color_mode = "RGB"
        sink.format.color_depth = "32"
        sink.file_slots[0].path = name
        tree.links.new(layers.outputs[name], sink.inputs[0])


def render_view(view: View, file: Path) -> float:
    """Render one view with the present settings into ``file`` and return the seconds it took."""
    scene = bpy.context.scene
    scene.camera.matrix_world = view.camera_to_world
    scene.render.filepath = str(file)
    start = time.perf_counter()
    bpy.ops.render.render(write_still=True)
    return time.perf_counter() - start


def render_photos(out: Path, views: list[View], samples: int) -> None:
    """Render ``out/<split>/<stem>.png`` for every view and print the mean time of one."""
    set_up_photo(samples)
    seconds = []
    with tempfile.TemporaryDirectory() as folder:
        for view in views:
            raw = Path(folder) / "photo.png"
            seconds.append(render_view(view, raw))
            write_png(out / view.split / f"{view.stem}.png", iio.imread(raw)[..., :3])
    print(f"{out}: {len(seconds)} photos, {np.mean(seconds):.2f} s each", flush=True)


def render_truth(out: Path, views: list[View]) -> None:
    """Render the label image of every view, and the depth image of every test view."""
    write_json(out / "labels" / "names.json", NAMES)
    with tempfile.TemporaryDirectory() as folder:
        set_up_truth(Path(folder))
        for view in views:
            render_view(view, Path(folder) / "unused.png")
            ids, depth = (read_pass(Path(folder), name) for name in ("IndexOB", "Depth"))
            write_labels(out / "labels" / view.split / f"{view.stem}.png", np.rint(ids).astype(np.uint8))
            if view.split == "test":
                steps = np.minimum(np.rint(depth / DEPTH_UNIT), NO_DEPTH).astype(np.uint16)
                write_png(out / "depth" / "test" / f"{view.stem}.png", steps)


def read_pass(folder: Path, name: str) -> np.ndarray:
    """Return the first channel of the pass that the compositor just wrote, (H, W) with the top row first."""
    file = next(folder.glob(f"{name}*.exr"))
    image = bpy.data.images.load(str(file))
    image.colorspace_settings.name = "Non-Color"
    width, height = image.size
    values = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    file.unlink()
    return values.reshape(height, width, -1)[::-1, :, 0]


def render_recolors(out: Path, views: list[View], samples: int) -> None:
    """Render the true recolors of all test views and of the reference view, and write ``edits.json``."""
    reference = reference_view(out, views)
    chosen = [view for view in views if view.split == "test" or view == reference]
    for edit, colors in EDITS.items():
        before = set_colors(colors)
        render_photos(out / "recolor" / edit, chosen, samples)
        set_colors(before)
    edits = {edit: {"objects": EDITED_OBJECTS[edit], "reference_view": reference.stem} for edit in EDITS}
    write_json(out / "edits.json", {"edits": edits})


# ------------------------------------------------------------------------------------------------------------ masks


def read_truth(out: Path, view: View) -> np.ndarray:
    """Return the label image of a view, (H, W) uint8."""
    return iio.imread(out / "labels" / view.split / f"{view.stem}.png", mode="P")


def visible_shares(out: Path, views: list[View]) -> np.ndarray:
    """Return each object's pixels in each view over its most in any view, (views, objects) in [0, 1]."""
    counts = np.array([[(truth == k).sum() for k in NAMES.values()] for truth in (read_truth(out, v) for v in views)])
    return counts / counts.max(0)


def reference_view(out: Path, views: list[View]) -> View:
    """Return the training view in which the least visible of the marked objects is most visible."""
    train = [view for view in views if view.split == "train"]
    return train[int(visible_shares(out, train).min(1).argmax())]


def marked_views(out: Path, views: list[View], column: int) -> list[View]:
    """Return the reference view and two more training views that show object ``column`` well from far-apart sides."""
    train = [view for view in views if view.split == "train"]
    shares = visible_shares(out, train)[:, column]
    sides = np.array([view.camera_to_world.col[2][:3] for view in train])
    chosen = [train.index(reference_view(out, views))]
    for _ in range(2):
        closest = (sides @ sides[chosen].T).max(1)
        chosen.append(int(np.where(shares >= 0.6, closest, np.inf).argmin()))
    return [train[index] for index in chosen]


def signed_distance(mask: np.ndarray) -> np.ndarray:
    """Return the distance in pixels to the border of ``mask`` (H, W), positive inside, by brute force."""
    padded = np.pad(mask, 1)
    inner = mask & padded[:-2, 1:-1] & padded[2:, 1:-1] & padded[1:-1, :-2] & padded[1:-1, 2:]
    border = np.argwhere(mask & ~inner)
    best = np.full(mask.shape, np.inf)
    rows, columns = np.indices(mask.shape)
    for row, column in border:
        np.minimum(best, (rows - row) ** 2 + (columns - column) ** 2, out=best)
    return np.where(mask, np.sqrt(best) + 0.5, 0.5 - np.sqrt(best))


def smooth_noise(rng: np.random.Generator, size: int, cell: int) -> np.ndarray:
    """Return noise (size, size) of unit deviation that varies over ``cell`` pixels."""
    knots = rng.standard_normal((size // cell + 3, size // cell + 3))
    at = np.arange(size) / cell
    whole = at.astype(int)
    part = 0.5 - 0.5 * np.cos(np.pi * (at - whole))
    rows = knots[whole] * (1 - part)[:, None] + knots[whole + 1] * part[:, None]
    noise = rows[:, whole] * (1 - part) + rows[:, whole + 1] * part
    return noise / noise.std()


def coarse_mask(distance: np.ndarray, rng: np.random.Generator, flaw: str) -> np.ndarray:
    """Return a blobby hand-drawn mask from a signed ``distance`` (H, W): its border moved by smooth noise.

    The noise is about 3 px in an image of 256 px, and in proportion in others.

    ``flaw`` is "spill" (a disk added across the border), "gap" (a disk cut out at the border) or "none".
    """
    pixel = len(distance) / 256
    drawn = distance + pixel * (2.6 * smooth_noise(rng, len(distance), round(12 * pixel)) + rng.uniform(-0.5, 1.5))
    if flaw != "none":
        rim = np.argwhere(np.abs(distance) < 1.0)
        row, column = rim[rng.integers(len(rim))]
        rows, columns = np.indices(distance.shape)
        disk = 4.0 * pixel + 0.18 * math.sqrt((distance > 0).sum()) - np.hypot(rows - row, columns - column)
        drawn = np.maximum(drawn, disk) if flaw == "spill" else np.minimum(drawn, -disk)
    return drawn > 0.0


def intersection_over_union(a: np.ndarray, b: np.ndarray) -> float:
    """Return the intersection over union of two boolean masks."""
    return float((a & b).sum() / (a | b).sum())


def flaw_area(mask: np.ndarray, distance: np.ndarray, others: np.ndarray, flaw: str) -> float:
    """Return the area of the flaw over the object's: marked ``others`` covered by a spill, or inner pixels lost."""
    wrong = mask & others if flaw == "spill" else ~mask & (distance > 5.0 * len(mask) / 256)
    return float(wrong.sum() / (distance > 0).sum())


def draw_mask(labels: np.ndarray, object_id: int, flaw: str, seed: int) -> np.ndarray:
    """Return the first coarse mask, over successive seeds, whose IoU lies in ``IOU_RANGE`` and whose flaw shows."""
    truth = labels == object_id
    distance = signed_distance(truth)
    low, high = IOU_RANGE
    for attempt in range(300):
        mask = coarse_mask(distance, np.random.default_rng((seed, attempt)), flaw)
        shows = flaw == "none" or flaw_area(mask, distance, (labels > 0) & ~truth, flaw) > 0.03
        if shows and low <= intersection_over_union(mask, truth) <= high:
            return mask
    raise RuntimeError(f"no coarse mask of object {object_id} with flaw {flaw} has an IoU between {low} and {high}")


def render_masks(out: Path, views: list[View]) -> str:
    """Draw the coarse masks into ``out/coarse_masks`` and return the table of their overlaps with the truth."""
    lines = ["object  view   set         flaw   IoU"]
    for column, (name, object_id) in enumerate(NAMES.items()):
        for place_in_set, view in enumerate(marked_views(out, views, column)):
            flaw = FLAWS.get((name, place_in_set), "none")
            labels = read_truth(out, view)
            mask = draw_mask(labels, object_id, flaw, 100 * object_id + place_in_set)
            sets = ("one", "three") if place_in_set == 0 else ("three",)
            for folder in sets:
                write_png(
                    out / "coarse_masks" / folder / name / f"{view.stem}.png", np.where(mask, 255, 0).astype(np.uint8)
                )
            overlap = intersection_over_union(mask, labels == object_id)
            lines.append(f"{name:7s} {view.stem}  {'+'.join(sets):10s}  {flaw:5s}  {overlap:.3f}")
    return "\n".join(lines)


# ------------------------------------------------------------------------------------------------------------ files


def write_png(path: Path, pixels: np.ndarray) -> None:
    """Write (H, W) or (H, W, 3) unsigned integers as a small PNG."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(pixels).save(path, optimize=True)


def write_labels(path: Path, ids: np.ndarray) -> None:
    """Write object ids (H, W) uint8 as a palette PNG whose pixel values are the ids."""
    path.parent.mkdir(parents=True, exist_ok=True)
    image = Image.fromarray(ids).convert("L")
    image.putpalette(LABEL_COLORS)
    image.save(path, optimize=True)


def write_json(path: Path, content) -> None:
    """Write ``content`` as indented JSON."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")


def write_readme(out: Path, views: list[View], options: argparse.Namespace, masks: str) -> None:
    """Write ``README.txt`` with the facts of this run and the table of the coarse masks."""
    text = README.format(
        blender=bpy.app.version_string,
        size=options.size,
        samples=options.samples,
        train=options.train,
        test=options.test,
        reference=reference_view(out, views).stem,
        masks=masks,
    )
    (out / "README.txt").write_text(text, encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Make the whole capture, or the steps named by ``--only``; later steps read the labels of the ``truth`` step."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder to write, for example demo")
    parser.add_argument("--size", type=int, default=256, help="width and height in pixels")
    parser.add_argument("--train", type=int, default=60, help="number of training views")
    parser.add_argument("--test", type=int, default=12, help="number of test views")
    parser.add_argument("--samples", type=int, default=64, help="samples per pixel at most")
    parser.add_argument("--only", nargs="+", choices=STEPS, default=STEPS, help="steps to run")
    options = parser.parse_args(argv)
    out, views = options.out, dome_views(options.train, options.test)
    build_scene()
    set_up_render(options.size)
    if "photos" in options.only:
        write_transforms(out, views)
        render_photos(out, views, options.samples)
    if "truth" in options.only:
        render_truth(out, views)
    if "recolors" in options.only:
        render_recolors(out, views, options.samples)
    if "masks" in options.only:
        table = render_masks(out, views)
        write_readme(out, views, options, table)
        print(table)
    return 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    # The bpy module may hang or crash while the interpreter shuts down.
    os._exit(code)
