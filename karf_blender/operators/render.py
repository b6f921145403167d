"""Step 5: recolored photos, camera frames, compositor nodes and Blender's own renders."""

import bpy
from bpy.props import BoolProperty, EnumProperty, IntProperty, StringProperty

from .. import preferences, progress, steps
from ..engine_api import FarmOptions, bounds_of
from ..host.words import translatable, translate_report
from ..project import folders
from ..properties.scene import FORMAT_DEPTHS
from ..swatches import outputs
from ..tasks import runner
from .base import GEOMETRY, IDLE, PALETTES, PROJECT, StepOperator, Undoable, need

WIDTH = 420  # width of the dialogs, in pixels at an interface scale of 1
SPLIT_ITEMS = [
    ("ALL", "All", "All captured views"),
    ("TRAIN", "Learned From", "Views used for learning the scene"),
    ("TEST", "Kept for Testing", "Views kept out of learning"),
]

FRAMES = need("Render captured views or a camera's frames first", lambda context: context.scene.karf.frames)


class RenderDialog(StepOperator):
    """Mix-in of operators that ask for size, range or format before they render; scripts are not asked."""

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=WIDTH)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split, layout.use_property_decorate = True, False
        self.draw_what(layout, context)
        draw_output(layout.column(), context.scene.karf)


def draw_output(layout, karf):
    """Draw where pictures go, and what becomes of those that are there."""
    for name in ("out", "file_names", "layered", "skip_existing", "overwrite"):
        layout.prop(karf, name)
    layout.label(text=outputs.shown_path(karf.id_data), icon="FILE_IMAGE", translate=False)


def launched(scene, task):
    """Launch a task of pictures, and return a report of where they will be."""
    runner.launch(task)
    return translate_report("Pictures will be in {path}", path=outputs.folder_of(folders.place_of(scene, "frames")))


def _draw_size(layout, karf):
    layout.prop(karf, "captured_size")
    if karf.captured_size == "PIXELS":
        layout.prop(karf, "captured_pixels")


class KARF_OT_render_view(RenderDialog, bpy.types.Operator):
    """Recolor the active view's photo at full size. Without the engine, write the displayed preview"""

    bl_idname = "karf.render_view"
    bl_label = "Render This View"
    needs = (PROJECT, PALETTES)

    def invoke(self, context, event):
        return super().invoke(context, event) if preferences.has_engine() else self.execute(context)

    def draw_what(self, layout, context):
        _draw_size(layout, context.scene.karf)

    def step(self, context):
        if preferences.has_engine():
            return launched(context.scene, steps.render_view(context.scene))
        sentence = translatable("Without the engine, only the preview was written: {path}")
        self.report({"WARNING"}, translate_report(sentence, path=steps.save_shown(context.scene)))


class KARF_OT_render_capture(RenderDialog, bpy.types.Operator):
    """Recolor the capture's photos with the current swatches"""

    bl_idname = "karf.render_capture"
    bl_label = "Render Captured Views"
    needs = (IDLE, PROJECT, PALETTES)

    split: EnumProperty(name="Views", items=SPLIT_ITEMS)
    views: StringProperty(
        name="Names",
        description="Names of views and ranges (0000-0007), separated by commas. Empty: all views chosen above",
    )

    def draw_what(self, layout, context):
        layout.prop(self, "split")
        layout.prop(self, "views")
        _draw_size(layout, context.scene.karf)

    def step(self, context):
        return launched(context.scene, steps.render_captured(context.scene, self.views or self.split.lower()))


class CameraDialog(RenderDialog):
    """Mix-in of operators that render what the scene's camera sees, by default over the scene's own frames."""

    frame_start: IntProperty(name="Frame Start", options={"SKIP_SAVE"})
    frame_end: IntProperty(name="End", options={"SKIP_SAVE"})
    frame_step: IntProperty(name="Step", default=1, min=1, options={"SKIP_SAVE"})

    def invoke(self, context, event):
        frames = steps.frame_range(context.scene)
        self.frame_start, self.frame_end, self.frame_step = frames.start, frames.stop - 1, frames.step
        return super().invoke(context, event)

    def draw_what(self, layout, context):
        scene = context.scene
        layout.prop(scene, "camera")
        column = layout.column(align=True)
        column.prop(scene.render, "resolution_x", text="Resolution X")
        column.prop(scene.render, "resolution_y", text="Y")
        column.prop(scene.render, "resolution_percentage", text="%")
        column = layout.column(align=True)
        for name in ("frame_start", "frame_end", "frame_step"):
            column.prop(self, name)
        _draw_format(layout.column(), scene.karf)

    def frames(self, scene):
        """Return the chosen frames, or else those of the scene."""
        own = steps.frame_range(scene)
        chosen = self.properties.is_property_set
        start = self.frame_start if chosen("frame_start") else own.start
        stop = self.frame_end + 1 if chosen("frame_end") else own.stop
        return range(start, stop, self.frame_step if chosen("frame_step") else own.step)


def _draw_format(layout, karf):
    layout.prop(karf, "file_format")
    layout.row().prop(karf, "color_mode", expand=True)
    split = layout.split(factor=0.4)  # single values of an enum are not divided into name and field
    split.use_property_split = False
    name = split.row()
    name.alignment = "RIGHT"
    name.label(text="Color Depth")
    row = split.row(align=True)
    for depth in FORMAT_DEPTHS[karf.file_format]:
        row.prop_enum(karf, "color_depth", depth)


class KARF_OT_render_camera(CameraDialog, bpy.types.Operator):
    """Render the recolored scene from the scene's camera at every frame. Swatches may be keyframed"""

    bl_idname = "karf.render_camera"
    bl_label = "Render Camera's Frames"
    needs = (IDLE, PROJECT, PALETTES)

    def step(self, context):
        scene = context.scene
        return launched(scene, steps.render_sequence(scene, scene.camera, self.frames(scene)))


class KARF_OT_farm_bundle(CameraDialog, bpy.types.Operator):
    """Write the scene's frames as a render farm job: a self-contained folder in Open Job Description format"""

    bl_idname = "karf.farm_bundle"
    bl_label = "Farm Job"
    needs = (PROJECT, PALETTES)

    directory: StringProperty(
        name="Folder", subtype="DIR_PATH", description="New or empty folder. Default: in the output folder"
    )
    per_task: IntProperty(
        name="Frames per Task", description="Number of frames that a task renders", **bounds_of(FarmOptions, "per_task")
    )

    def draw_what(self, layout, context):
        super().draw_what(layout, context)
        layout.prop(self, "per_task")
        layout.prop(self, "directory")

    def step(self, context):
        scene = context.scene
        out = folders.absolute(self.directory) if self.directory else None
        bundle = steps.farm_bundle(scene, scene.camera, self.frames(scene), out, self.per_task)
        progress.wrote(bundle)
        return translate_report("The job is in {path}", path=bundle)


class KARF_OT_build_compositor(StepOperator, bpy.types.Operator):
    """Recolor the active view with compositor nodes that have a color socket for each swatch"""

    bl_idname = "karf.build_compositor"
    bl_label = "Build Compositor"
    needs = (IDLE, PROJECT, PALETTES)

    view: StringProperty(name="View", description="Name of a captured view. Empty: the active view")
    driven: BoolProperty(
        name="Follow Swatches",
        description="Sockets follow the swatches. Otherwise they start with the swatches' colors and are set by hand",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context, properties):
        if properties.driven:
            return translatable("Recolor the active view with compositor nodes whose sockets follow the swatches")
        return translatable("Recolor the active view with compositor nodes whose sockets are set by hand")

    def step(self, context):
        return steps.build_compositor(context.scene, self.view, driven=self.driven)


class KARF_OT_show_frames(StepOperator, bpy.types.Operator):
    """Show the last rendered frames in the Image Editor"""

    bl_idname = "karf.show_frames"
    bl_label = "Show Frames"
    needs = (FRAMES,)

    def step(self, context):
        image = steps.show_frames(context.scene)
        return translate_report("{name} is open in the Image Editors", name=image.name)


class KARF_OT_add_strip(Undoable, bpy.types.Operator):
    """Add the last rendered frames to the video sequencer as one strip"""

    bl_idname = "karf.add_strip"
    bl_label = "Add Strip"
    needs = (FRAMES,)

    def step(self, context):
        strip = steps.add_strip(context.scene)
        sentence = translatable("{name} is on channel {channel} of the sequencer of {scene}")
        values = {"name": strip.name, "channel": strip.channel, "scene": context.scene.name}
        return translate_report(sentence, **values)


class KARF_OT_rendered_view(StepOperator, bpy.types.Operator):
    """Show the recolored scene from any angle in the 3D Views, and render it with F12: render engine KaRF"""

    bl_idname = "karf.rendered_view"
    bl_label = "Rendered View"
    needs = (GEOMETRY,)

    def step(self, context):
        areas = context.screen.areas if context.screen else ()
        steps.use_engine(context.scene, [area.spaces.active for area in areas if area.type == "VIEW_3D"])
        return translate_report("A KaRF job is running: the view waits for it") if runner.is_running() else ""


class KARF_OT_standard_colors(Undoable, bpy.types.Operator):
    """Set the scene's view transform to Standard, which shows photos and renders in the colors of their files"""

    bl_idname = "karf.standard_colors"
    bl_label = "Show Photo Colors"

    def step(self, context):
        steps.use_standard(context.scene)


class KARF_OT_over_scene(Undoable, bpy.types.Operator):
    """Composite this file's objects into renders of the captured scene, with correct occlusion"""

    bl_idname = "karf.over_scene"
    bl_label = "Over Scene"
    needs = (GEOMETRY,)

    def step(self, context):
        steps.put_objects_in(context.scene)
