"""Materials with one or two paints, and the patterns that mix them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import bpy

PRINTED = ("letters", "neutrals")  # outputs of printed materials: 1 where the colored ink is, 1 where it is not
INK_ROUGHNESS = 0.35


@dataclass(frozen=True)
class Stock:
    """What is printed on: scene linear color, 1 for metal, roughness, and 0 to 1 for how much it is brushed."""

    color: tuple[float, float, float]
    metallic: float
    roughness: float
    brushed: float = 0.0


FOIL = Stock((0.78, 0.78, 0.79), 1.0, 0.2)


def material(name: str, color, roughness: float, second=None, pattern=None, refraction: float = 1.5):
    """Return a Principled material; with ``second``, ``pattern(tree)`` gives the socket that mixes in the second color.

    ``refraction`` is the index that says how strongly the surface mirrors.

    The color sockets are found again by ``set_colors``: the slots are called ``main`` and ``second``.
    """
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = roughness
    shader.inputs["IOR"].default_value = refraction
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


def printed(name: str, image, place: Callable, paper: Stock, ink, dark=(0.02, 0.02, 0.02), foil=FOIL):
    """Return a material of a paper that inks cover, where ``image`` has them (`lettering.INKS`, channel by channel).

    ``place(tree)`` gives the sockets of the picture's coordinates in [0, 1]. The slots of ``set_colors`` are ``main``,
    the colored ink, ``second``, the paper, and ``dark``. The outputs named in PRINTED tell what is colored and what not.
    """
    made = material(name, ink, INK_ROUGHNESS)
    tree = made.node_tree
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    picture, spot = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeCombineXYZ")
    picture.image, picture.extension = image, "CLIP"
    for number, socket in enumerate(place(tree)):
        tree.links.new(socket, spot.inputs[number])
    tree.links.new(spot.outputs[0], picture.inputs[0])
    inks = tree.nodes.new("ShaderNodeSeparateColor")
    tree.links.new(picture.outputs[0], inks.inputs[0])
    colored, black, metal = inks.outputs
    color = color_node(tree, "second", paper.color)
    color = mixed(tree, black, color, color_node(tree, "dark", dark))
    color = mixed(tree, metal, color, color_node(tree, "foil", foil.color))
    color = mixed(tree, colored, color, tree.nodes["main"].outputs[0])
    tree.links.new(color, shader.inputs["Base Color"])
    inked = math_node(tree, "ADD", colored, black)
    for title, of_ink in (("metallic", 0.0), ("roughness", INK_ROUGHNESS)):
        value = mixed(tree, metal, getattr(paper, title), getattr(foil, title), "FLOAT")
        tree.links.new(mixed(tree, inked, value, of_ink, "FLOAT"), shader.inputs[title.capitalize()])
    shader.inputs["Anisotropic"].default_value = paper.brushed
    for title, value in zip(PRINTED, (colored, math_node(tree, "SUBTRACT", 1.0, colored)), strict=True):
        told = tree.nodes.new("ShaderNodeOutputAOV")
        told.aov_name = title
        tree.links.new(value, told.inputs["Value"])
    return made


def color_node(tree, slot: str, color):
    """Return the socket of a new color that ``set_colors`` finds by its slot."""
    tree.nodes.new("ShaderNodeRGB").name = slot
    tree.nodes[slot].outputs[0].default_value = (*color, 1.0)
    return tree.nodes[slot].outputs[0]


def mixed(tree, share, one, other, kind: str = "RGBA"):
    """Return the socket between ``one`` (share 0) and ``other`` (1), sockets both, or of kind FLOAT also numbers."""
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type = kind
    sockets = [socket for socket in mix.inputs if socket.enabled]
    for socket, value in zip((sockets[0], *sockets[-2:]), (share, one, other), strict=True):
        feed(tree, socket, value)
    return next(socket for socket in mix.outputs if socket.enabled)


def feed(tree, socket, value) -> None:
    """Give an input ``value``, a number or a socket."""
    if isinstance(value, float):
        socket.default_value = value
    else:
        tree.links.new(value, socket)


def unlit():
    """Return a new material that no light needs to be looked for: what is quick to render where only shapes count."""
    made = bpy.data.materials.new("unlit")
    made.use_nodes = True
    tree = made.node_tree
    tree.nodes.clear()
    surface = tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]
    tree.links.new(tree.nodes.new("ShaderNodeEmission").outputs[0], surface)
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


def math_node(tree, operation: str, value, other, clamp: bool = False):
    """Return the output socket of a math node fed by ``value`` and ``other``, numbers or sockets."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation = operation
    node.use_clamp = clamp
    feed(tree, node.inputs[0], value)
    feed(tree, node.inputs[1], other)
    return node.outputs[0]


def position_socket(tree, axis: str, of: str = "Object"):
    """Return the socket of the object-space position along ``axis``, X, Y or Z, or of the ``Normal`` there."""
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinates.outputs[of], split.inputs[0])
    return split.outputs[axis]


def bands(period: float, offset: float):
    """Return a pattern of horizontal bands of equal width: 0 and 1 alternate along the object's height."""

    def pattern(tree):
        return sharpened(tree, height_wave(tree, period, offset))

    return pattern


def checks(around: int, period: float):
    """Return a pattern of checks on a turned shape: ``around`` pairs round it, pairs of ``period`` along its height."""

    def pattern(tree):
        angle = math_node(tree, "ARCTAN2", position_socket(tree, "Y"), position_socket(tree, "X"))
        turned = math_node(tree, "SINE", math_node(tree, "MULTIPLY", angle, float(around)), 0.0)
        return sharpened(tree, math_node(tree, "MULTIPLY", turned, height_wave(tree, period, 0.0)))

    return pattern


def height_wave(tree, period: float, offset: float):
    """Return the socket of a sine wave along the object's height."""
    shifted = math_node(tree, "ADD", position_socket(tree, "Z"), offset)
    return math_node(tree, "SINE", math_node(tree, "MULTIPLY", shifted, 2.0 * math.pi / period), 0.0)


def sharpened(tree, wave):
    """Return the socket of 0 where ``wave`` is negative and 1 where it is positive, with narrow soft borders."""
    return math_node(tree, "ADD", math_node(tree, "MULTIPLY", wave, 8.0), 0.5, clamp=True)


def rise(low: float, high: float):
    """Return a pattern that goes from 0 at object height ``low`` to 1 at ``high``."""

    def pattern(tree):
        shifted = math_node(tree, "SUBTRACT", position_socket(tree, "Z"), low)
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
