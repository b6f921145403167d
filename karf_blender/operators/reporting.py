"""What all operators share: errors become reports, steps that lack something are greyed out and say why."""

from collections.abc import Callable
from functools import wraps

from .. import preferences
from ..engine import failures, installing
from ..engine_api import VERSION, KarfError, MissingDependency
from ..host import compat
from ..host.words import translatable, translate_error, translate_report
from ..project import disk
from ..tasks import runner

MISSING = {
    "geometry": translatable("Learn the scene first"),
    "segmentation": translatable("Segment the objects first"),
    "recoloring": translatable("Extract the palettes first"),
    "splats": translatable("Learn splats first"),
}


def reports_errors(execute: Callable) -> Callable:
    """Turn a KarfError, or what the disk refuses, into an error report and {'CANCELLED'}; in background mode Blender
    raises it."""

    @wraps(execute)
    def safe(self, context, *event):
        try:
            return execute(self, context, *event)
        except KarfError as error:
            self.report({"ERROR"}, translate_error(error))
        except OSError as error:
            self.report({"ERROR"}, translate_error(failures.disk_error(error)))
        return {"CANCELLED"}

    return safe


def versions() -> dict[str, str]:
    """The programs at work by their names, for reports."""
    try:
        python = str(preferences.chosen_python())
    except MissingDependency as error:
        python = str(error)
    return {"KaRF": VERSION, "Blender": compat.BLENDER, "Engine Python": python}


class EngineStep:
    """Mix-in of operators that run the engine: not while it is busy, and not before what they build on is there."""

    after = ""  # the stage that must be finished

    @classmethod
    def poll(cls, context):
        return is_free(cls) and has_project(cls, context) and has_stage(cls, context, cls.after)


class SwatchStep:
    """Mix-in of operators that need palettes."""

    @classmethod
    def poll(cls, context):
        return has_palette(cls, context)


class ProjectSwatchStep:
    """Mix-in of operators that need palettes and the project they are from."""

    @classmethod
    def poll(cls, context):
        return has_project(cls, context) and has_palette(cls, context)


class PreparedStep(ProjectSwatchStep):
    """Mix-in of operators that need the active view's edit planes."""

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        if not disk.contents_of(context.scene).is_prepared:
            cls.poll_message_set("Prepare the view first")
            return False
        return True


class PaletteStep(EngineStep):
    """Mix-in of operators that run the engine on palettes."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_palette(cls, context)


def is_free(cls: type) -> bool:
    """For `poll`: whether no job is running; if one is, the operator says so."""
    if runner.is_running():
        cls.poll_message_set("KaRF is busy: wait for the running job, or cancel it")
        return False
    return True


def is_unchanging(cls: type) -> bool:
    """For `poll`: whether the engine is neither being installed nor removed; if it is, the operator says so."""
    if installing.is_running():
        cls.poll_message_set("The engine is being installed or removed")
        return False
    return True


def has_project(cls: type, context) -> bool:
    """For `poll`: whether a capture was imported and its project is there; if not, the operator says so."""
    if not context.scene.karf.project:
        cls.poll_message_set("Import a capture first")
        return False
    missing = disk.contents_of(context.scene).missing
    if missing is not None:
        cls.poll_message_set(
            translate_report(
                "The project folder {path} is missing: bring it back, or choose it in step 1", path=missing
            )
        )
        return False
    return True


def has_stage(cls: type, context, stage: str) -> bool:
    """For `poll`: whether the engine's stage is finished (none: always); if not, the operator says so."""
    if stage and stage not in disk.contents_of(context.scene).stages:
        cls.poll_message_set(MISSING[stage])
        return False
    return True


def has_palette(cls: type, context) -> bool:
    """For `poll`: whether there are palettes; if not, the operator says so."""
    if not context.scene.karf.objects:
        cls.poll_message_set("Extract the palettes first")
        return False
    return True
