"""Step 2: objects and their masks, and the tools that mark a photo: click, box, lasso, brush."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import session, steps
from ..engine_api import BadRequest
from ..host import windows
from ..host.words import translate_report
from ..marking import mask_layers, objects, photo, raster, tools
from ..pictures import editors
from ..project import disk
from ..steps import masks
from .base import PROJECT, SEGMENTATION, Undoable, is_met, need, reports_errors

DOES_ITEMS = [
    ("ADD", "Add", "Mark as part of the object"),
    ("TAKE", "Take Away", "Mark as outside the object"),
    ("CLEAR", "Clear", "Clear a correction here. In a mask: same as Take Away"),
]
MIN_DRAG = 3  # pixels on the screen; a shorter drag of a box or lasso is a slip of the mouse
OBJECT = need("Add an object first", lambda context: objects.active(context.scene) is not None)


class KARF_OT_mark(Undoable, bpy.types.Operator):
    """Show the active view's photo in the Image Editors and select a tool to mark it: click, box, lasso or brush"""

    bl_idname = "karf.mark"
    bl_label = "Mark in Photo"
    needs = (PROJECT,)

    def step(self, context):
        image = steps.show_photo(context.scene)
        if context.area is not None and context.area.type == "IMAGE_EDITOR":
            editors.show(context.area, image)
        disk.refresh()
        shown = photo.areas(context.scene)
        if not shown and not bpy.app.background:
            self.report({"WARNING"}, "Open an Image Editor to mark the photo")
        for area in shown:
            tools.take_up(context, area)


class KARF_OT_go_to_view(Undoable, bpy.types.Operator):
    """Make the next or previous view active"""

    bl_idname = "karf.go_to_view"
    bl_label = "Next View"
    needs = (PROJECT,)

    by: IntProperty(name="By", default=1, description="1: next view; -1: previous view")
    marked: BoolProperty(name="Marked", description="Only visit views where the object is marked")

    @classmethod
    def description(cls, context, properties):
        which = "next" if properties.by > 0 else "previous"
        return f"Go to the {which} view" + (" in which the object is marked" if properties.marked else "")

    def step(self, context):
        steps.go_to_view(context.scene, self.by, self.marked)
        if context.region is not None and context.area.type == "IMAGE_EDITOR" and context.region.type == "WINDOW":
            editors.show(context.area, steps.show_photo(context.scene))  # by a key of the tools


class KARF_OT_go_to_suggested(Undoable, bpy.types.Operator):
    """Go to the view where a mark would help most, according to the last segmentation. Press again for the next best"""

    bl_idname = "karf.go_to_suggested"
    bl_label = "Suggested View"
    needs = (PROJECT, SEGMENTATION)

    def step(self, context):
        steps.go_to_suggested(context.scene)


class KARF_OT_erase_mask(Undoable, bpy.types.Operator):
    """Erase the object's mask, or its corrections, in the active view"""

    bl_idname = "karf.erase_mask"
    bl_label = "Erase Mask"
    needs = (PROJECT, OBJECT)
    scene_step = steps.erase_mask


class KARF_OT_set_volume(Undoable, bpy.types.Operator):
    """Restrict the object to the inside or the outside of the active mesh or Empty's box, where it is now"""

    bl_idname = "karf.set_volume"
    bl_label = "Volume"
    needs = (PROJECT, OBJECT)

    kind: EnumProperty(
        name="Volume",
        items=[
            ("inside", "Inside", "The object is nowhere else"),
            ("outside", "Outside", "The object is not in it"),
            ("none", "None", "Take all volumes of the object away"),
        ],
    )

    def step(self, context):
        shape = None if self.kind == "none" else context.active_object
        if shape is None and self.kind != "none":
            raise BadRequest("There is no active object.", "Select a mesh or an Empty in the 3D View.")
        count = steps.set_volume(context.scene, shape, self.kind)
        name = objects.active(context.scene).folder
        return translate_report("Volumes of {name}: {count}. Segment takes them into account", name=name, count=count)


class KARF_OT_add_object(Undoable, bpy.types.Operator):
    """Add an object to mark. Double-click its name to rename it"""

    bl_idname = "karf.add_object"
    bl_label = "Add Object"
    needs = (PROJECT,)

    name: StringProperty(name="Name", default=objects.FIRST)

    def step(self, context):
        steps.add_object(context.scene, self.name)
        windows.redraw()


class KARF_OT_remove_object(Undoable, bpy.types.Operator):
    """Remove the object with all its masks and corrections. Undo restores them"""

    bl_idname = "karf.remove_object"
    bl_label = "Remove Object"
    needs = (PROJECT, OBJECT)
    scene_step = steps.remove_object

    def invoke(self, context, event):
        item = objects.active(context.scene)
        count = disk.contents_of(context.scene).masks.get(item.folder, 0)
        if not count:
            return self.execute(context)
        message = f"{count} masks of {item.folder!r} are removed from the disk"
        return context.window_manager.invoke_confirm(self, event, title="Remove the object?", message=message)


class MarkingTool:
    """Mix-in of operators that mark the photo; in an editor that does not show it, the first press shows it."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    does: EnumProperty(name="Does", items=DOES_ITEMS, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return context.area is not None and context.area.type == "IMAGE_EDITOR" and is_met(cls, context, PROJECT)

    @reports_errors
    def invoke(self, context, event):
        if context.region.type != "WINDOW":
            return {"PASS_THROUGH"}
        if not photo.is_displayed(context.scene, context.space_data) or mask_layers.opened(context.scene) is None:
            editors.show(context.area, steps.show_photo(context.scene))
            return {"FINISHED"}
        return self.begin(context, event)

    def place(self, context, event) -> raster.Place:
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
    """Mix-in of tools for dragging; Esc or the right button cancels."""

    hint = ""

    def begin(self, context, event):
        context.workspace.status_text_set(self.hint)
        session.get(photo.Gesture).places = [(event.mouse_region_x, event.mouse_region_y)]
        self.start(context, event)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    @reports_errors
    def modal(self, context, event):
        if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
            self.move(context, event)
            context.area.tag_redraw()
            return {"RUNNING_MODAL"}
        if event.type == "LEFTMOUSE" and event.value == "RELEASE":
            self.leave(context)
            return self.finish(context, event)
        if event.type in {"ESC", "RIGHTMOUSE"}:
            self.cancel(context)
            return {"CANCELLED"}
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self.leave(context)
        self.abandon(context)

    def leave(self, context) -> None:
        context.workspace.status_text_set(None)
        self.drawn, session.get(photo.Gesture).places = session.get(photo.Gesture).places, []
        context.area.tag_redraw()

    def start(self, context, event) -> None:
        pass

    def abandon(self, context) -> None:
        pass

    def points_in_photo(self, context) -> list[raster.Place]:
        size = mask_layers.open_layers(context.scene).size
        return [photo.photo_place(context.region, size, place) for place in self.drawn]

    def is_slip(self) -> bool:
        return all(max(values) - min(values) < MIN_DRAG for values in zip(*self.drawn, strict=True))


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
        corners = self.points_in_photo(context)
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
        steps.mark_lasso(context.scene, self.points_in_photo(context), self.does)
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
