"""The state of each step of a scene (done, outdated and why, running, to do), and which steps are folded.

Panels use it at every redraw, so nothing reads the disk. What the user folds or opens stays so until a step is done.
"""

from dataclasses import dataclass, field

import bpy

from .. import session
from ..host import windows
from ..host.words import translatable
from ..project import captures, disk, folders
from ..project.disk import Contents
from ..tasks import runner

STEPS = ("import", "mark", "learn", "edit", "render")
TO_DO, DONE, STALE, RUNNING = "to do", "done", "stale", "running"
FOLDERS = ("import", "learn")  # steps that fold; marking folds with learning
STEP_OF_STAGE = {
    "poses": "import",
    "import-splat": "import",
    "geometry": "learn",
    "segmentation": "learn",
    "palette": "learn",
    "recoloring": "learn",
    "colorways": "render",
}
OTHER_PRESET = translatable("Learned with another preset: learn again to use this one.")
OTHER_NERF = translatable("Learned with another NeRF or without one: learn again to use this choice.")
OTHER_PHOTOS = translatable("Learned from other photos: learn again to use this choice.")
OTHER_MARKS = translatable("Marks have changed since then: learn again.")
OTHER_SCENE = translatable("The scene alone has been learned again since then: learn all again.")
OTHER_OBJECTS = translatable("The objects alone have been found again since then: learn all again.")


@dataclass(frozen=True)
class State:
    kind: str = TO_DO
    reason: str = ""  # why it is outdated


def state_of(scene: bpy.types.Scene, step: str) -> State:
    if step == _running_step(scene):
        return State(RUNNING)
    known = disk.contents_of(scene)
    if known.missing:
        return State()
    reason = _why_stale(scene, step, known)
    if reason:
        return State(STALE, reason)
    return State(DONE) if _is_done(scene, step, known) else State()


def _running_step(scene: bpy.types.Scene) -> str:
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
    return step == "learn" and bool(scene.karf.objects)


def _why_stale(scene: bpy.types.Scene, step: str, known: Contents) -> str:
    if step != "learn" or "geometry" not in known.stages | known.outdated:
        return ""
    preset, nerf = known.learned_with
    if nerf != folders.text_of(scene, "nerf"):
        return OTHER_NERF
    if not nerf and preset not in ("", scene.karf.preset):
        return OTHER_PRESET
    if known.left_out != set(captures.left_out(scene)):
        return OTHER_PHOTOS
    if "segmentation" in known.outdated:
        return OTHER_MARKS if "segmentation" in known.stages else OTHER_SCENE
    return OTHER_OBJECTS if "recoloring" in known.outdated else ""


@dataclass
class LastStates:
    per_file = True
    scene: int | None = None  # its `session_uid`
    kinds: dict[str, str] = field(default_factory=dict)


def opened(before: dict[str, str], after: dict[str, str]) -> dict[str, bool]:
    """Return which steps to open or fold after a change of states, `before` empty for a new scene; others stay."""
    if not before:
        return {step: step in _next(after) for step in STEPS}
    stale = {step: True for step in STEPS if after[step] == STALE != before[step]}
    done = [step for step in (*FOLDERS, "mark") if after[step] == DONE != before[step]]
    if not done:
        return stale
    last = max((STEPS.index(step) for step in done if step in FOLDERS), default=-1)
    return dict.fromkeys(STEPS[: last + 1], False) | dict.fromkeys(_next(after), True) | stale


def _next(kinds: dict[str, str]) -> tuple[str, ...]:
    """The steps to work on: the first that is not done, and learning beside marking, as the scene needs no marks."""
    first = next((step for step in STEPS if kinds[step] != DONE), "edit")
    return ("mark", "learn") if first == "mark" else (first,)


@session.listener(disk.READ)
def update() -> None:
    """Fold and open the panels of the main window's scene if its steps have changed."""
    scene = bpy.data.window_managers[0].windows[0].scene
    kinds = {step: state_of(scene, step).kind for step in STEPS}
    if RUNNING in kinds.values():  # how it stands is known when it has ended
        return
    last = session.get(LastStates)
    before = last.kinds if scene.session_uid == last.scene else {}
    if kinds == before:
        return
    last.scene, last.kinds = scene.session_uid, kinds
    folding = bpy.data.window_managers[0].karf_folding
    for step, is_open in opened(before, kinds).items():
        setattr(folding, f"show_{step}", is_open)
    windows.redraw()
