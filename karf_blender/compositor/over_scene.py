"""Objects of Blender in front of and behind the captured scene: two renders in the compositor; the nearer one shows."""

import bpy

from ..host import compat
from ..nodes import named

OBJECTS = "KaRF Objects"  # what the scene of the objects is called after, and its render's node
CAPTURED, NEARER = "KaRF Scene", "KaRF Over Scene"


def build(scene: bpy.types.Scene, objects: bpy.types.Scene) -> bpy.types.Node:
    """Show the nearer of the scene and one with transparent film, by new or earlier nodes; return the result's node."""
    tree = compat.compositing_tree(scene)
    front = named(tree, OBJECTS, "CompositorNodeRLayers", (0, 0))
    back = named(tree, CAPTURED, "CompositorNodeRLayers", (0, -450))
    front.scene, back.scene = objects, scene
    node = named(tree, NEARER, "CompositorNodeZcombine", (300, -150))
    compat.set_option(node, "Use Alpha", "use_alpha", True)
    compat.set_option(node, "Anti-Alias", "use_antialias_z", True)
    images = [socket for socket in node.inputs if socket.type == "RGBA"]
    depths = [socket for socket in node.inputs if socket.type == "VALUE"]
    for render, image, depth in zip((front, back), images, depths, strict=True):
        tree.links.new(render.outputs["Image"], image)
        tree.links.new(render.outputs["Depth"], depth)
    output = compat.compositing_output(tree)
    if not output.is_linked or output.links[0].from_node.bl_idname == "CompositorNodeRLayers":
        tree.links.new(node.outputs[0], output)
    return node
