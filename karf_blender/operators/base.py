"""The base of the operators: what they need, the step that they run, and errors as reports."""

from collections.abc import Callable
from functools import wraps
from pathlib import Path

import bpy
from bpy.props import BoolProperty, StringProperty

from ..engine import failures, installing
from ..engine_api import KarfError
from ..host import windows
from ..host.words import translatable, translate_error, translate_report
from ..project import disk, folders
from ..tasks import runner

Need = Callable[[bpy.types.Context], str]  # returns why an operator cannot run, "" if it can


def need(sentence: str, is_met: Callable[[bpy.types.Context], object]) -> Need:
    """Return a need with the sentence that says what is missing."""
    return lambda context: "" if is_met(context) else sentence


def _stage(stage: str, sentence: str) -> Need:
    return need(sentence, lambda context: stage in disk.contents_of(context.scene).stages)


def _project(context: bpy.types.Context) -> str:
    if not context.scene.karf.project:
        return translatable("Import a capture first")
    missing = disk.contents_of(context.scene).missing
    if missing is None:
        return ""
    sentence = translatable("The project folder {path} is missing: bring it back, or choose it in step 1")
    return translate_report(sentence, path=missing)


IDLE = need("KaRF is busy: wait for the running job, or cancel it", lambda context: not runner.is_running())
NOT_INSTALLING = need("The engine is being installed or removed", lambda context: not installing.is_running())
PROJECT = _project
GEOMETRY = _stage("geometry", "Learn the scene first")
SEGMENTATION = _stage("segmentation", "Segment the objects first")
PALETTES = need("Extract the palettes first", lambda context: context.scene.karf.objects)
RECOLORING = _stage("recoloring", "Extract the palettes first")
SPLATS = _stage("splats", "Learn splats first")
PREPARED = need("Prepare the view first", lambda context: disk.contents_of(context.scene).is_prepared)
CAMERA = need("The scene has no camera", lambda context: context.scene.camera)


def is_met(cls: type, context: bpy.types.Context, *needs: Need) -> bool:
    """Return whether the needs of an operator are met; if not, its button says why."""
    reason = next(filter(None, (need(context) for need in needs)), "")
    if reason:
        cls.poll_message_set(reason)
    return not reason


def reports_errors(method: Callable) -> Callable:
    """Turn a KarfError or OSError in an operator's method into an error report, raised in background mode."""

    def run(self, *args):
        try:
            return method(self, *args)
        except KarfError as error:
            self.report({"ERROR"}, translate_error(error))
        except OSError as error:
            self.report({"ERROR"}, translate_error(failures.disk_error(error)))
        return {"CANCELLED"}

    if method.__code__.co_argcount == 3:  # Blender counts arguments
        return wraps(method)(lambda self, context, event: run(self, context, event))
    return wraps(method)(lambda self, context: run(self, context))


class StepOperator:
    """Mix-in of operators that check their `needs` and run `step`; it may return a task to launch, or a report."""

    needs: tuple[Need, ...] = ()
    scene_step: Callable  # in place of a method `step`: a function of `steps`, called with the scene

    @classmethod
    def poll(cls, context):
        return is_met(cls, context, *cls.needs)

    @reports_errors
    def execute(self, context):
        result = self.step(context)
        if isinstance(result, str) and result:
            self.report({"INFO"}, result)
        elif result and result.requests:
            runner.launch(result)
        windows.redraw_sidebars()  # those of other editors too
        return {"FINISHED"}

    def step(self, context):
        return type(self).scene_step(context.scene)


class Undoable(StepOperator):
    """Mix-in of operators that undo takes back."""

    bl_options = {"REGISTER", "UNDO"}


class OpenFileOperator(StepOperator):
    """Mix-in of operators that read a file, dropped, given or chosen in the file browser."""

    filepath: StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})

    @property
    def path(self) -> Path:
        """The file, with an absolute path."""
        return Path(bpy.path.abspath(self.filepath))

    def invoke(self, context, event):
        if self.filepath:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


class SaveFileOperator(OpenFileOperator):
    """Mix-in of operators that write a file, whose name is proposed by the default of `filepath`."""

    check_existing: BoolProperty(default=True, options={"HIDDEN"})

    def invoke(self, context, event):
        if not self.properties.is_property_set("filepath"):  # else Blender proposes the .blend itself
            self.filepath = str(folders.likely_folder(context.scene) / self.filepath)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}


def file_filter(patterns: str):
    """Return a property that lets the file browser show only files of these patterns."""
    return StringProperty(default=patterns, options={"HIDDEN"})
