"""What all operators share: errors become reports, steps that lack something are greyed out and say why."""

from collections.abc import Callable
from functools import wraps

from .. import job_watch
from ..engine_api import KarfError


def reports_errors(execute: Callable) -> Callable:
    """Turn a KarfError in `execute` into an error report and {'CANCELLED'}; in background mode Blender raises it."""

    @wraps(execute)
    def safe(self, context):
        try:
            return execute(self, context)
        except KarfError as error:
            self.report({"ERROR"}, f"{error.sentence} {error.hint}".strip())
            return {"CANCELLED"}

    return safe


class EngineStep:
    """Mix-in of operators that run the engine: not while it is busy, and not before a capture is imported."""

    @classmethod
    def poll(cls, context):
        if job_watch.is_running():
            cls.poll_message_set("KaRF is busy: wait for the running job, or cancel it")
            return False
        return has_project(cls, context)


class SwatchStep:
    """Mix-in of operators that need palettes."""

    @classmethod
    def poll(cls, context):
        return has_palette(cls, context)


class PaletteStep(EngineStep):
    """Mix-in of operators that run the engine on palettes."""

    @classmethod
    def poll(cls, context):
        return super().poll(context) and has_palette(cls, context)


def has_project(cls: type, context) -> bool:
    """For `poll`: whether a capture was imported; if not, the operator says so."""
    if not context.scene.karf.project:
        cls.poll_message_set("Import a capture first")
        return False
    return True


def has_palette(cls: type, context) -> bool:
    """For `poll`: whether there are palettes; if not, the operator says so."""
    if not context.scene.karf.objects:
        cls.poll_message_set("Extract the palettes first")
        return False
    return True
