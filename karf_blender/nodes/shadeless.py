"""A material that shows a mesh's own colors as they are, whatever light there is."""

import bpy

from ..host import compat


def material(name: str, attribute: str) -> bpy.types.Material:
    """The material by this name, which shows an attribute; made where there is none."""
    material = bpy.data.materials.get(name)
    if material is not None:
        return material
    material = bpy.data.materials.new(name)
    compat.give_nodes(material)
    tree = material.node_tree
    tree.nodes.clear()
    color, light, output = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("Attribute", "Emission", "OutputMaterial"))
    color.attribute_name = attribute
    tree.links.new(color.outputs["Color"], light.inputs["Color"])
    tree.links.new(light.outputs["Emission"], output.inputs["Surface"])
    return material
