"""Step 7: pictures."""

import bpy
from bpy.props import BoolProperty, IntProperty, StringProperty

from .. import preferences, steps
from ..project import folders
from ..tasks import runner
from .reporting import PaletteStep, ProjectSwatchStep, reports_errors


class KARF_OT_render_view(ProjectSwatchStep, bpy.types.Operator):
    """Recolor the active view's photo at its own size; without the engine, write the preview that is shown"""

    bl_idname = "karf.render_view"
    bl_label = "This View"

    @reports_errors
    def execute(self, context):
        if preferences.has_engine():
            runner.launch(steps.render_view(context.scene))
            self.report({"INFO"}, f"The picture goes to {folders.out_folder(context.scene) / 'recolor'}")
        else:
            self.report({"WARNING"}, f"Without the engine the preview was written: {steps.save_shown(context.scene)}")
        return {"FINISHED"}


class KARF_OT_render_capture(PaletteStep, bpy.types.Operator):
    """Recolor the capture's photos with the swatches as they stand"""

    bl_idname = "karf.render_capture"
    bl_label = "Captured Views"

    views: StringProperty(name="Views", default="all", description="all, train, test or names with commas")

    @reports_errors
    def execute(self, context):
        runner.launch(steps.render_captured(context.scene, self.views))
        self.report({"INFO"}, f"Pictures go to {folders.out_folder(context.scene) / 'recolor'}")
        return {"FINISHED"}


class KARF_OT_render_camera(PaletteStep, bpy.types.Operator):
    """Recolor what the scene's camera sees, for every frame of the scene; swatches may be keyframed"""

    bl_idname = "karf.render_camera"
    bl_label = "Camera's Frames"

    @reports_errors
    def execute(self, context):
        scene = context.scene
        runner.launch(steps.render_camera(scene, scene.camera, steps.frame_range(scene)))
        self.report({"INFO"}, f"Pictures go to {steps.camera_folder(scene) / 'recolor'}")
        return {"FINISHED"}


class KARF_OT_farm_bundle(ProjectSwatchStep, bpy.types.Operator):
    """Write the scene's frames as a job for a render farm: a folder with all it needs, by Open Job Description"""

    bl_idname = "karf.farm_bundle"
    bl_label = "Farm Job"

    directory: StringProperty(name="Folder", subtype="DIR_PATH", description="New or empty; default: in the output")
    per_task: IntProperty(name="Frames a Task", default=10, min=1, description="How many frames a task renders")

    @reports_errors
    def execute(self, context):
        scene = context.scene
        out = folders.absolute(self.directory) if self.directory else None
        bundle = steps.camera_bundle(scene, scene.camera, steps.frame_range(scene), out, self.per_task)
        self.report({"INFO"}, f"The job is in {bundle}")
        return {"FINISHED"}


class KARF_OT_build_compositor(PaletteStep, bpy.types.Operator):
    """Recolor the active view by nodes in the compositor, with a color socket for each swatch"""

    bl_idname = "karf.build_compositor"
    bl_label = "Build Compositor"

    view: StringProperty(name="View", description="Name of a captured view; empty: the active one")
    driven: BoolProperty(
        name="Follow Swatches",
        description="The sockets follow the swatches; else they begin with them, and are set by hand",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def description(cls, context, properties):
        if properties.driven:
            return f"{cls.__doc__} that follows it, keyframes too"
        return f"{cls.__doc__} that begins with it and is then set by hand"

    @reports_errors
    def execute(self, context):
        runner.launch(steps.build_compositor(context.scene, self.view, self.driven))
        return {"FINISHED"}


class FramesStep:
    """Mix-in of operators that need rendered frames."""

    @classmethod
    def poll(cls, context):
        if not context.scene.karf.frames:
            cls.poll_message_set("Render captured views or a camera's frames first")
            return False
        return True


class KARF_OT_show_frames(FramesStep, bpy.types.Operator):
    """Show the frames that were rendered last in the Image Editor"""

    bl_idname = "karf.show_frames"
    bl_label = "Show Frames"

    @reports_errors
    def execute(self, context):
        image = steps.show_frames(context.scene)
        self.report({"INFO"}, f"{image.name!r} is in the Image Editors")
        return {"FINISHED"}


class KARF_OT_add_strip(FramesStep, bpy.types.Operator):
    """Put the frames that were rendered last into the video sequencer, as one strip"""

    bl_idname = "karf.add_strip"
    bl_label = "Add Strip"
    bl_options = {"REGISTER", "UNDO"}

    @reports_errors
    def execute(self, context):
        strip = steps.add_strip(context.scene)
        self.report(
            {"INFO"}, f"{strip.name!r} is on channel {strip.channel} of the sequencer of {context.scene.name!r}"
        )
        return {"FINISHED"}


CLASSES = (
    KARF_OT_render_view,
    KARF_OT_render_capture,
    KARF_OT_render_camera,
    KARF_OT_farm_bundle,
    KARF_OT_build_compositor,
    KARF_OT_show_frames,
    KARF_OT_add_strip,
)
