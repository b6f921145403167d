"""The scene's own objects within the captured one: two renders in the compositor, of which the nearer one is seen."""

import bpy

from ..host import compat

OBJECTS = "KaRF Objects"  # what the scene of the objects is called after, and its render's node
CAPTURED, NEARER = "KaRF Scene", "KaRF Over Scene"


def build(scene: bpy.types.Scene, objects: bpy.types.Scene) -> bpy.types.Node:
    """Let the compositor show, in each pixel, the nearer of both scenes; nodes that are there already are used again.

    Args:
        scene: Rendered by KaRF.
        objects: What is put into it, on transparent film.

    Returns:
        The node whose picture is both.
    """
    tree = compat.compositing_tree(scene)
    front, back = _render(tree, OBJECTS, objects, 0), _render(tree, CAPTURED, scene, -450)
    node = tree.nodes.get(NEARER) or tree.nodes.new("CompositorNodeZcombine")
    node.name = node.label = NEARER
    node.location = 300, -150
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


def _render(tree: bpy.types.NodeTree, name: str, scene: bpy.types.Scene, top: float) -> bpy.types.Node:
    """The node of a scene's render."""
    node = tree.nodes.get(name) or tree.nodes.new("CompositorNodeRLayers")
    node.name = node.label = name
    node.location = 0, top
    node.scene = scene
    return node
