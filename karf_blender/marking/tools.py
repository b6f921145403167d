"""The tools in the toolbar of the Image Editor, with their keys."""

import bpy
import gpu
from gpu_extras.presets import draw_circle_2d

from .. import session
from ..project import disk

BLENDERS = "builtin.sample"  # the first tool of the Image Editor


def _mark(operator: str, does: str = "ADD", **keys) -> tuple:
    return operator, {"type": "LEFTMOUSE", "value": "PRESS", **keys}, {"properties": [("does", does)]}


def _keymap(operator: str) -> tuple:
    """The mouse and the keys of a tool; what takes away is the same with Ctrl or Alt in all of them."""
    brush = [("data_path_primary", "scene.karf.marking.brush")]
    scale = [("data_path", "scene.karf.marking.brush")]
    return (
        _mark(operator),
        _mark(operator, "TAKE", ctrl=True),
        _mark(operator, "TAKE", alt=True),
        _mark(operator, "CLEAR", shift=True),
        ("karf.go_to_view", {"type": "PAGE_DOWN", "value": "PRESS"}, {"properties": [("by", 1)]}),
        ("karf.go_to_view", {"type": "PAGE_UP", "value": "PRESS"}, {"properties": [("by", -1)]}),
        ("wm.radial_control", {"type": "F", "value": "PRESS"}, {"properties": brush}),
        (
            "wm.context_scale_int",
            {"type": "LEFT_BRACKET", "value": "PRESS", "repeat": True},
            {"properties": [*scale, ("value", 0.8)]},
        ),
        (
            "wm.context_scale_int",
            {"type": "RIGHT_BRACKET", "value": "PRESS", "repeat": True},
            {"properties": [*scale, ("value", 1.25)]},
        ),
    )


class Tool:
    """What all tools share."""

    bl_space_type = "IMAGE_EDITOR"
    bl_context_mode = "VIEW"
    bl_cursor = "CROSSHAIR"

    @staticmethod
    def draw_settings(context, layout, tool):
        """The tool's row in the header."""
        marking = context.scene.karf.marking
        if tool.idname == Brush.bl_idname:
            layout.prop(marking, "brush")
        if "segmentation" in disk.contents_of(context.scene).stages:
            layout.prop(marking, "correct")


class Click(Tool, bpy.types.WorkSpaceTool):
    """Click on the object and the engine finds its outline. Ctrl or Alt: exclude this part"""

    bl_idname = "karf.mark_click"
    bl_label = "Mark: Click"
    bl_icon = "ops.generic.select"
    bl_keymap = _keymap("karf.mark_click")


class Box(Tool, bpy.types.WorkSpaceTool):
    """Drag a box around the object, and the engine finds it there"""

    bl_idname = "karf.mark_box"
    bl_label = "Mark: Box"
    bl_icon = "ops.generic.select_box"
    bl_keymap = _keymap("karf.mark_box")


class Lasso(Tool, bpy.types.WorkSpaceTool):
    """Draw around the object. Ctrl: exclude the enclosed area"""

    bl_idname = "karf.mark_lasso"
    bl_label = "Mark: Lasso"
    bl_icon = "ops.generic.select_lasso"
    bl_keymap = _keymap("karf.mark_lasso")


class Brush(Tool, bpy.types.WorkSpaceTool):
    """Paint over the object. Ctrl: erase"""

    bl_idname = "karf.mark_brush"
    bl_label = "Mark: Brush"
    bl_icon = "ops.generic.select_paint"
    bl_keymap = _keymap("karf.mark_brush")

    @staticmethod
    def draw_cursor(context, tool, place):
        """The brush as a circle."""
        radius = context.scene.karf.marking.brush
        gpu.state.blend_set("ALPHA")
        for color, size in (((0, 0, 0, 0.6), radius + 1), ((1, 1, 1, 0.9), radius)):
            draw_circle_2d(place, color, size, segments=48)
        gpu.state.blend_set("NONE")


TOOLS = (Box, Click, Lasso, Brush)


def take_up(context: bpy.types.Context, area: bpy.types.Area) -> None:
    """Make the box the tool of an Image Editor, unless one of these is; its toolbar is shown."""
    space = area.spaces.active
    space.mode = "VIEW"
    space.show_region_toolbar = True
    tool = context.workspace.tools.from_space_image_mode("VIEW", create=True)
    if tool is None or tool.idname not in {each.bl_idname for each in TOOLS}:
        region = next(region for region in area.regions if region.type == "WINDOW")
        with context.temp_override(area=area, region=region):
            bpy.ops.wm.tool_set_by_id(name=Box.bl_idname, space_type="IMAGE_EDITOR")


def lay_down() -> None:
    """Take up Blender's first tool in the Image Editors that have one of these: Blender would draw its cursor on."""
    for window in bpy.data.window_managers[0].windows:
        tool = window.workspace.tools.from_space_image_mode("VIEW")
        if tool is None or tool.idname not in {each.bl_idname for each in TOOLS}:
            continue
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                with bpy.context.temp_override(window=window, area=area):
                    bpy.ops.wm.tool_set_by_id(name=BLENDERS, space_type="IMAGE_EDITOR")


@session.setup
def _toolbar():
    after = None
    for tool in TOOLS:
        bpy.utils.register_tool(tool, after=after, separator=after is None)
        after = {tool.bl_idname}
    yield
    lay_down()
    for tool in reversed(TOOLS):
        bpy.utils.unregister_tool(tool)
