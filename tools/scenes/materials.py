"""Materials with one or two paints, and the patterns that mix them."""

from __future__ import annotations

import math

import bpy


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
