"""Differences between Blender versions, and nothing else; the only file that asks for the version."""

import bpy

BLENDER = bpy.app.version_string

# properties that hold paths must say since 4.5 that `//` is understood; before, the word is unknown
PATH_OPTIONS = {"PATH_SUPPORTS_BLEND_RELATIVE"} if bpy.app.version >= (4, 5, 0) else set()

# since 4.5 a separate shader draws points of a given size
POINT_SHADER = "POINT_FLAT_COLOR" if bpy.app.version >= (4, 5, 0) else "FLAT_COLOR"

# Blender's engine for the graphics card, which was called next from 4.2 to 4.5
EEVEE = "BLENDER_EEVEE" if bpy.app.version >= (5, 0, 0) else "BLENDER_EEVEE_NEXT"

# 4.2 writes the colors of points into glTF files as if they had an alpha, which makes the file unreadable
HAS_GLTF_POINTS = bpy.app.version >= (4, 3, 0)


def give_nodes(material: bpy.types.Material) -> None:
    """Enable nodes in a new material; since 5.0 they always are."""
    if bpy.app.version < (5, 0, 0):
        material.use_nodes = True


def curves_of(owner: bpy.types.AnimData | bpy.types.NlaStrip) -> list[bpy.types.FCurve]:
    """Return the F-curves of animation data or of an NLA strip; actions have slots and layers since 4.4."""
    if owner.action is None:
        return []
    if bpy.app.version < (4, 4, 0):
        return list(owner.action.fcurves)
    strips = [strip for layer in owner.action.layers for strip in layer.strips]
    bags = [bag for strip in strips for bag in strip.channelbags if bag.slot == owner.action_slot]
    return [curve for bag in bags for curve in bag.fcurves]


# --- the compositor, whose trees and nodes changed in 4.5 and 5.0 ----------------------------------------------------
def compositing_tree(scene: bpy.types.Scene) -> bpy.types.NodeTree:
    """Return the scene's compositing nodes, switched on; create an empty tree if there is none."""
    if bpy.app.version < (5, 0, 0):
        is_new = scene.node_tree is None
        scene.use_nodes = True
        if is_new:  # it comes with nodes that nobody asked for
            scene.node_tree.nodes.clear()
        return scene.node_tree
    if scene.compositing_node_group is None:
        scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
    return scene.compositing_node_group


def compositing_tree_or_none(scene: bpy.types.Scene) -> bpy.types.NodeTree | None:
    """Return the scene's compositing nodes, if it has some."""
    return scene.node_tree if bpy.app.version < (5, 0, 0) else scene.compositing_node_group


def compositing_output(tree: bpy.types.NodeTree) -> bpy.types.NodeSocket:
    """Return the socket of the rendered picture; create the output node if there is none."""
    if bpy.app.version < (5, 0, 0):
        node = _first(tree, "COMPOSITE") or tree.nodes.new("CompositorNodeComposite")
        return node.inputs["Image"]
    outputs = [item for item in tree.interface.items_tree if getattr(item, "in_out", "") == "OUTPUT"]
    if not any(item.socket_type == "NodeSocketColor" for item in outputs):
        tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
    node = _first(tree, "GROUP_OUTPUT") or tree.nodes.new("NodeGroupOutput")
    return next(socket for socket in node.inputs if socket.type == "RGBA")


def _first(tree: bpy.types.NodeTree, kind: str) -> bpy.types.Node | None:
    return next((node for node in tree.nodes if node.type == kind), None)


def new_color_math(tree: bpy.types.NodeTree, operation: str, clips: bool = False) -> bpy.types.Node:
    """Create a node for two colors (`ADD`, `SUBTRACT`, `MULTIPLY`) that may clip the result to 0..1."""
    if bpy.app.version < (4, 5, 0):
        node = tree.nodes.new("CompositorNodeMixRGB")
        node.use_clamp = clips
    else:
        node = tree.nodes.new("ShaderNodeMix")
        node.data_type, node.clamp_result = "RGBA", clips
    node.blend_type = operation
    node.inputs[0].default_value = 1.0
    return node


def color_math_sockets(node: bpy.types.Node) -> tuple[bpy.types.NodeSocket, bpy.types.NodeSocket, bpy.types.NodeSocket]:
    """Return the two inputs and the result of such a node, which has sockets of other types too."""
    first, second = [socket for socket in node.inputs if socket.type == "RGBA"]
    return first, second, next(socket for socket in node.outputs if socket.type == "RGBA")


def set_option(node: bpy.types.Node, socket: str, name: str, value: bool) -> None:
    """Set an option of a node: a socket since 4.5, a property before."""
    if socket in node.inputs:
        node.inputs[socket].default_value = value
    else:
        setattr(node, name, value)


# --- the sequencer, whose strips are called strips since 4.4 ---------------------------------------------------------
def strips_of(scene: bpy.types.Scene) -> bpy.types.bpy_prop_collection:
    """Return the strips of the scene's sequencer; create the sequencer if there is none."""
    editor = scene.sequence_editor or scene.sequence_editor_create()
    return editor.sequences if bpy.app.version < (4, 4, 0) else editor.strips


def all_strips() -> list["bpy.types.Strip"]:
    """Return the strips of all scenes, also those within meta strips."""
    name = "sequences_all" if bpy.app.version < (4, 4, 0) else "strips_all"
    editors = [scene.sequence_editor for scene in bpy.data.scenes if scene.sequence_editor is not None]
    return [strip for editor in editors for strip in getattr(editor, name)]


def show_in_sequencers(scene: bpy.types.Scene) -> None:
    """Show this scene in sequencers that show none; since 5.0 the workspace stores it, not the window."""
    for workspace in bpy.data.workspaces:
        if getattr(workspace, "sequencer_scene", scene) is None:
            workspace.sequencer_scene = scene


def strip_range(strip: "bpy.types.Strip") -> tuple[int, int]:
    """Return the first frame of a strip and the one after its last; its ends are called handles since 5.1."""
    if bpy.app.version < (5, 1, 0):
        return strip.frame_final_start, strip.frame_final_end
    return strip.left_handle, strip.right_handle
