"""Materials that no light changes."""

import bpy

from ..host import compat


def material(name: str, attribute: str) -> bpy.types.Material:
    """The material by this name, which shows an attribute as it is; made where there is none."""
    material = bpy.data.materials.get(name)
    if material is not None:
        return material
    material, light = _new(name, "Emission")
    color = material.node_tree.nodes.new("ShaderNodeAttribute")
    color.attribute_name = attribute
    material.node_tree.links.new(color.outputs["Color"], light.inputs["Color"])
    return material


def background(name: str) -> bpy.types.Material:
    """A new white material, as exporters know it."""
    material, light = _new(name, "Background")
    light.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    return material


def _new(name: str, kind: str) -> tuple[bpy.types.Material, bpy.types.Node]:
    """A new material of one shader, and that shader."""
    material = bpy.data.materials.new(name)
    compat.give_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    light, output = tree.nodes.new(f"ShaderNode{kind}"), tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(light.outputs[0], output.inputs["Surface"])
    return material, light
