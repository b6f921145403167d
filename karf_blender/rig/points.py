"""The sparse points of a capture as a mesh of vertices, displayed as small colored balls by Geometry Nodes.

Vertices alone have no color in the viewport; balls do, in Solid mode (Color: Attribute) and with their material.
"""

import bpy
import numpy as np

from ..engine_api import SparsePoints
from ..nodes import shadeless

NAME = "KaRF points"


def build(points: SparsePoints, parent: bpy.types.Object, radius: float) -> bpy.types.Object:
    """Make an object that is not rendered, with the attributes `color` (sRGB bytes) and `error` (pixels).

    The radius of the balls is in units of the parent, the rig's Empty.
    """
    mesh = bpy.data.meshes.new(NAME)
    mesh.vertices.add(len(points))
    mesh.vertices.foreach_set("co", points.positions.astype(np.float32).ravel())
    colors = np.ones((len(points), 4), np.float32)
    colors[:, :3] = points.colors / np.float32(255)
    mesh.attributes.new("color", "BYTE_COLOR", "POINT").data.foreach_set("color_srgb", colors.ravel())
    mesh.attributes.new("error", "FLOAT", "POINT").data.foreach_set("value", points.errors.astype(np.float32))
    mesh.update()
    item = bpy.data.objects.new(NAME, mesh)
    item.modifiers.new("Balls", "NODES").node_group = _balls(radius)
    item.parent = parent
    item.hide_render = True
    return item


def _balls(radius: float) -> bpy.types.NodeTree:
    """Make a node group that puts an octahedron on every vertex."""
    group = bpy.data.node_groups.new(NAME, "GeometryNodeTree")
    group.is_modifier = True
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Radius", in_out="INPUT", socket_type="NodeSocketFloat").default_value = radius
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    add, link = group.nodes.new, group.links.new
    entry, ball, instances = add("NodeGroupInput"), add("GeometryNodeMeshUVSphere"), add("GeometryNodeInstanceOnPoints")
    realized, joined = add("GeometryNodeRealizeInstances"), add("GeometryNodeJoinGeometry")
    neighbors, is_bare = add("GeometryNodeInputMeshVertexNeighbors"), add("FunctionNodeBooleanMath")
    cleared, painted = add("GeometryNodeDeleteGeometry"), add("GeometryNodeSetMaterial")
    is_bare.operation = "NOT"
    ball.inputs["Segments"].default_value, ball.inputs["Rings"].default_value = 4, 2
    painted.inputs["Material"].default_value = shadeless.material(NAME, "color")
    link(entry.outputs["Radius"], ball.inputs["Radius"])
    link(entry.outputs["Geometry"], instances.inputs["Points"])
    link(ball.outputs["Mesh"], instances.inputs["Instance"])
    link(instances.outputs["Instances"], realized.inputs["Geometry"])
    link(realized.outputs["Geometry"], joined.inputs["Geometry"])
    # only the vertices know which attribute is the active color; join them, then delete them: Blender draws them black
    link(entry.outputs["Geometry"], joined.inputs["Geometry"])
    link(joined.outputs["Geometry"], cleared.inputs["Geometry"])
    link(neighbors.outputs["Face Count"], is_bare.inputs[0])
    link(is_bare.outputs["Boolean"], cleared.inputs["Selection"])
    link(cleared.outputs["Geometry"], painted.inputs["Geometry"])
    link(painted.outputs["Geometry"], add("NodeGroupOutput").inputs["Geometry"])
    for column, node in enumerate(group.nodes):
        node.location.x = 180 * column
    return group
