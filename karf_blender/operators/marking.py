"""Step 3: what the tools of the Image Editor do: click, box, lasso, brush over the photo."""

import bpy
from bpy.props import EnumProperty

from .. import session, steps
from ..marking import mask_layers, photo, raster
from ..pictures import editors
from ..steps import masks
from .reporting import has_project, reports_errors

DOES_ITEMS = [
    ("ADD", "Add", "Mark as part of the object"),
    ("TAKE", "Take Away", "Mark as outside the object"),
    ("CLEAR", "Clear", "Clear a correction here. In a mask: same as Take Away"),
]
LEAST = 3  # pixels of the screen below which a box or lasso is a slip of the mouse


class MarkingTool:
    """Mix-in of operators that mark the photo; in an editor that does not show it, the first press shows it."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    does: EnumProperty(name="Does", items=DOES_ITEMS, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR" and has_project(cls, context)

    def invoke(self, context, event):
        return self.press(context, event)

    @reports_errors
    def press(self, context, event):
        """The mouse button was pressed."""
        if context.region.type != "WINDOW":
            return {"PASS_THROUGH"}
        if not photo.is_displayed(context.scene, context.space_data) or mask_layers.opened(context.scene) is None:
            editors.show(context.area, steps.show_photo(context.scene))
            return {"FINISHED"}
        return self.begin(context, event)

    def place(self, context, event) -> raster.Place:
        """Where the mouse is in the photo."""
        size = mask_layers.open_layers(context.scene).size
        return photo.photo_place(context.region, size, (event.mouse_region_x, event.mouse_region_y))


class KARF_OT_mark_click(MarkingTool, bpy.types.Operator):
    """Click on the object: the engine finds its outline. Click again to refine it. Ctrl or Alt: exclude this part"""

    bl_idname = "karf.mark_click"
    bl_label = "Mark: Click"

    def begin(self, context, event):
        place, size = self.place(context, event), mask_layers.open_layers(context.scene).size
        if not all(0 <= value < length for value, length in zip(place, size, strict=True)):
            return {"CANCELLED"}  # beside the photo
        steps.mark_click(context.scene, place, self.does)
        return {"FINISHED"}


class DragTool(MarkingTool):
    """Mix-in of tools that are dragged; Esc or the right button lets the drag be."""

    hint = ""

    def begin(self, context, event):
        context.workspace.status_text_set(self.hint)
        session.get(photo.Gesture).places = [(event.mouse_region_x, event.mouse_region_y)]
        self.start(context, event)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        return self.drag(context, event)

    @reports_errors
    def drag(self, context, event):
        """The mouse was moved, or a button or key let go or pressed."""
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            self.move(context, event)
            context.area.tag_redraw()
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.leave(context)
            return self.finish(context, event)
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self.leave(context)
            self.abandon(context)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self.leave(context)
        self.abandon(context)

    def leave(self, context) -> None:
        """The drag is over: its hint goes; `drawn` is where it was."""
        context.workspace.status_text_set(None)
        self.drawn, session.get(photo.Gesture).places = session.get(photo.Gesture).places, []
        context.area.tag_redraw()

    def start(self, context, event) -> None:
        """The button was pressed."""

    def abandon(self, context) -> None:
        """The drag was let be."""

    def on_photo(self, context) -> list[raster.Place]:
        """The drag's places in the photo."""
        size = mask_layers.open_layers(context.scene).size
        return [photo.photo_place(context.region, size, place) for place in self.drawn]

    def is_slip(self) -> bool:
        """Whether the mouse was hardly moved."""
        return all(max(values) - min(values) < LEAST for values in zip(*self.drawn, strict=True))


class KARF_OT_mark_box(DragTool, bpy.types.Operator):
    """Drag a box around the object: the engine finds it there. Ctrl: exclude everything in the box"""

    bl_idname = "karf.mark_box"
    bl_label = "Mark: Box"
    hint = "Release: mark the object in the box    Esc, right button: cancel"

    def move(self, context, event):
        (x0, y0), x1, y1 = session.get(photo.Gesture).places[0], event.mouse_region_x, event.mouse_region_y
        session.get(photo.Gesture).places = [(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)]

    def finish(self, context, event):
        if self.is_slip():
            return {"CANCELLED"}
        corners = self.on_photo(context)
        steps.mark_box(context.scene, corners[0], corners[2], self.does)
        return {"FINISHED"}


class KARF_OT_mark_lasso(DragTool, bpy.types.Operator):
    """Draw around the object. Ctrl: exclude the enclosed area"""

    bl_idname = "karf.mark_lasso"
    bl_label = "Mark: Lasso"
    hint = "Release: close the line    Esc, right button: cancel"

    def move(self, context, event):
        session.get(photo.Gesture).places.append((event.mouse_region_x, event.mouse_region_y))

    def finish(self, context, event):
        if self.is_slip():
            return {"CANCELLED"}
        steps.mark_lasso(context.scene, self.on_photo(context), self.does)
        return {"FINISHED"}


class KARF_OT_mark_brush(DragTool, bpy.types.Operator):
    """Paint over the object. Ctrl: erase, or exclude this part. Shift: clear a correction"""

    bl_idname = "karf.mark_brush"
    bl_label = "Mark: Brush"
    hint = "Release: keep the stroke    Esc, right button: cancel"

    def start(self, context, event):
        scene = context.scene
        session.get(photo.Gesture).places = []  # the mask itself shows the stroke
        self.layer, self.value = masks.layer_to_mark(scene), masks.value_of(scene, self.does)
        size = mask_layers.open_layers(scene).size
        self.radius = photo.photo_length(context.region, size, scene.karf.marking.brush)
        self.last = self.place(context, event)
        self.move(context, event)

    def move(self, context, event):
        now = self.place(context, event)
        raster.stroke(self.layer.pixels, self.last, now, self.radius, self.value)
        self.layer.touch()
        self.last = now

    def finish(self, context, event):
        masks.keep(context.scene, self.layer)
        return {"FINISHED"}

    def abandon(self, context):
        mask_layers.reread(context.scene)
