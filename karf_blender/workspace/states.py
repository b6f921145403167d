"""How each step of a scene stands: done, stale and why, at work, or still to do. Asked at every redraw: no disk."""

from dataclasses import dataclass

import bpy

from ..host.words import translatable
from ..project import disk, folders
from ..project.disk import Contents
from ..tasks import runner

STEPS = ("import", "learn", "mark", "segment", "palette", "edit", "render")
TO_DO, DONE, STALE, RUNNING = "to do", "done", "stale", "running"
STEP_OF_STAGE = {
    "poses": "import",
    "import-splat": "import",
    "geometry": "learn",
    "segmentation": "segment",
    "palette": "palette",
    "recoloring": "palette",
    "colorways": "render",
}
OTHER_PRESET = translatable("Learned with another preset: learn the scene again to use this one.")
OTHER_NERF = translatable("Learned with another NeRF or without one: learn the scene again to use this choice.")
OTHER_MARKS = translatable("Marks have changed since then: segment again.")
OTHER_SCENE = translatable("The scene has been learned again since then: segment again.")
OTHER_OBJECTS = translatable("The objects have been segmented again since then: extract the palettes again.")


@dataclass(frozen=True)
class State:
    """A step's state, one of those above, and a sentence that says why where it is stale."""

    kind: str = TO_DO
    reason: str = ""


def state_of(scene: bpy.types.Scene, step: str) -> State:
    """How a step stands."""
    if step == _running_step(scene):
        return State(RUNNING)
    known = disk.contents_of(scene)
    if known.missing or not _is_done(scene, step, known):
        return State()
    reason = _why_stale(scene, step, known)
    return State(STALE, reason) if reason else State(DONE)


def _running_step(scene: bpy.types.Scene) -> str:
    """The step whose job is at work for the scene's project; empty where none is."""
    request = runner.current_request(scene)
    if request is None:
        return ""
    if request.stage == "render":
        return "edit" if request.options.get("planes") else "render"
    return STEP_OF_STAGE.get(request.stage, "")


def _is_done(scene: bpy.types.Scene, step: str, known: Contents) -> bool:
    if step == "import":
        return bool(scene.karf.project)
    if step == "mark":
        return bool(known.masks)
    if step == "palette":
        return bool(scene.karf.objects)
    stage = {"learn": "geometry", "segment": "segmentation"}.get(step)
    return stage in known.stages | known.outdated


def _why_stale(scene: bpy.types.Scene, step: str, known: Contents) -> str:
    if step == "learn":
        return _why_learn_again(scene, known)
    if step == "segment" and "segmentation" in known.outdated:
        return OTHER_MARKS if "segmentation" in known.stages else OTHER_SCENE
    if step == "palette" and "recoloring" in known.outdated:
        return OTHER_OBJECTS
    return ""


def _why_learn_again(scene: bpy.types.Scene, known: Contents) -> str:
    preset, nerf = known.learned_with
    if nerf != folders.nerf_of(scene):
        return OTHER_NERF
    return OTHER_PRESET if not nerf and preset not in ("", scene.karf.preset) else ""
