"""The tools in the toolbar of the Image Editor, with their keys."""

import bpy
import gpu
from gpu_extras.presets import draw_circle_2d

from .. import session
from ..host import windows
from ..project import disk

BLENDERS = "builtin.sample"  # the first tool of the Image Editor
BRUSH_SIZE = "scene.karf.marking.brush"


def _key(operator: str, key: str, *properties: tuple, **more) -> tuple:
    return operator, {"type": key, "value": "PRESS", **more}, {"properties": list(properties)}


def _keymap(operator: str) -> tuple:
    return (
        _key(operator, "LEFTMOUSE", ("does", "ADD")),
        _key(operator, "LEFTMOUSE", ("does", "TAKE"), ctrl=True),
        _key(operator, "LEFTMOUSE", ("does", "TAKE"), alt=True),
        _key(operator, "LEFTMOUSE", ("does", "CLEAR"), shift=True),
        _key("karf.go_to_view", "PAGE_DOWN", ("by", 1)),
        _key("karf.go_to_view", "PAGE_UP", ("by", -1)),
        _key("wm.radial_control", "F", ("data_path_primary", BRUSH_SIZE)),
        _key("wm.context_scale_int", "LEFT_BRACKET", ("data_path", BRUSH_SIZE), ("value", 0.8), repeat=True),
        _key("wm.context_scale_int", "RIGHT_BRACKET", ("data_path", BRUSH_SIZE), ("value", 1.25), repeat=True),
    )


class Tool:
    bl_space_type = "IMAGE_EDITOR"
    bl_context_mode = "VIEW"
    bl_cursor = "CROSSHAIR"

    @staticmethod
    def draw_settings(context, layout, tool):
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
        radius = context.scene.karf.marking.brush
        gpu.state.blend_set("ALPHA")
        for color, size in (((0, 0, 0, 0.6), radius + 1), ((1, 1, 1, 0.9), radius)):
            draw_circle_2d(place, color, size, segments=48)
        gpu.state.blend_set("NONE")


TOOLS = (Box, Click, Lasso, Brush)


def _is_ours(tool) -> bool:
    return tool is not None and tool.idname in {each.bl_idname for each in TOOLS}


def take_up(context: bpy.types.Context, area: bpy.types.Area) -> None:
    """Activate the box in an Image Editor, unless one of these tools is active, and show the toolbar."""
    space = area.spaces.active
    space.mode = "VIEW"
    space.show_region_toolbar = True
    tool = context.workspace.tools.from_space_image_mode("VIEW", create=True)
    if not _is_ours(tool):
        region = next(region for region in area.regions if region.type == "WINDOW")
        with context.temp_override(area=area, region=region):
            bpy.ops.wm.tool_set_by_id(name=Box.bl_idname, space_type="IMAGE_EDITOR")


def lay_down() -> None:
    """Activate Blender's first tool instead of one of these: else Blender would continue to draw its cursor."""
    for area in windows.areas("IMAGE_EDITOR"):
        window = windows.window_of(area)
        if _is_ours(window.workspace.tools.from_space_image_mode("VIEW")):
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
