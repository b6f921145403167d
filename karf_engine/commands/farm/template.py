"""Build job templates by the Open Job Description specification, revision 2023-09, without extensions.

See https://github.com/OpenJobDescription. The tasks are the range `first-last:step` with the number of frames per task as
step: a task gets its first frame, and the engine renders `step` frames from there.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ...errors import BadRequest

VERSION = "jobtemplate-2023-09"
LONGEST_NAME = 128  # characters of a job's name
# a bundle's folders and files, as the template's paths name them
ENGINE, PROJECT, CAPTURE, MASKS, FRAMES = "engine", "project", "capture", "masks", "frames"
CAMERAS = "cameras.json"
PYTHON = "{{Param.EnginePython}}"
RUN = ("-I", "-B", "-u", "-X", "utf8", "{{Param.Engine}}/karf_engine")  # as Blender runs the engine

Json = dict[str, Any]


@dataclass(frozen=True)
class Frames:
    """The frames to render."""

    views: str  # the value of `render --views`; `CAMERAS` for the bundle's camera file
    edit: str  # the bundle's file or folder of edits; empty for none
    count: int
    per_task: int
    arguments: tuple[str, ...] = ()  # further ones of the verb `render`


def render_job(name: str, frames: Frames) -> Json:
    """Return a job that renders frames of a learned project."""
    parameters = [_folder("Project", PROJECT, "IN", "The learned project."), *_frame_parameters(frames)]
    return _job(name, parameters, [_render_step(frames)])


def learning_job(name: str, capture: str, settings: Sequence[str], machine: Sequence[str], frames: Frames) -> Json:
    """Return a job that learns a capture, a step for every stage, and then renders frames of it.

    capture: the file to open in the bundle's folder `CAPTURE`; empty for the folder itself. settings: further arguments
    of the verb `geometry`. machine: further arguments of every stage: threads, device.
    """
    parameters = [
        _folder("Capture", CAPTURE, "IN", "Photos with camera poses."),
        _folder("Masks", MASKS, "IN", "A rough mask of each object."),
        _folder("Project", PROJECT, "INOUT", "Where what is learned goes."),
        *_frame_parameters(frames),
    ]
    project = "{{Param.Project}}"
    opened = "/".join(("{{Param.Capture}}", *_literal([capture] if capture else [])))
    stages = {
        "Geometry": ("geometry", opened, "--project", project, "--masks", "{{Param.Masks}}", *_literal(settings)),
        "Segmentation": ("segmentation", project, "--masks", "{{Param.Masks}}"),
        "Palette": ("palette", project),
        "Recoloring": ("recoloring", project),
        "Splats": ("splats", project),
    }
    steps, before = [], ""
    for title, arguments in stages.items():
        steps.append(_step(title, [*arguments, *_literal(machine)], before))
        before = title
    return _job(name, parameters, [*steps, _render_step(frames, before)])


def _job(name: str, parameters: list[Json], steps: list[Json]) -> Json:
    python = _parameter(
        "EnginePython", "STRING", "python3", "A Python with the engine's packages, as the farm's machines know it."
    )
    engine = _folder("Engine", ENGINE, "IN", "The engine's own files.")
    name = "".join(letter for letter in name if letter.isprintable())[:LONGEST_NAME]
    return {
        "specificationVersion": VERSION,
        "name": re.sub(r"([{}])\1+", r"\1", name),
        "parameterDefinitions": [python, engine, *parameters],
        "steps": steps,
    }


def _frame_parameters(frames: Frames) -> list[Json]:
    last = {"minValue": 1, "maxValue": frames.count}
    found = [
        _parameter("FirstFrame", "INT", 1, "Frames are counted from 1, in the order of the cameras.") | last,
        _parameter("LastFrame", "INT", frames.count, "The last frame that is rendered.") | last,
        _parameter("FramesPerTask", "INT", frames.per_task, "How many frames a task renders.") | {"minValue": 1},
        _folder("Frames", FRAMES, "OUT", "Where pictures go."),
    ]
    if frames.views == CAMERAS:
        found.append(_path("Cameras", "FILE", CAMERAS, "IN", "The cameras that are rendered."))
    if frames.edit:
        kind = "FILE" if "." in frames.edit else "DIRECTORY"
        found.append(_path("Edit", kind, frames.edit, "IN", "The colors that objects shall have."))
    return found


def _render_step(frames: Frames, after: str = "") -> Json:
    views = "{{Param.Cameras}}" if frames.views == CAMERAS else _literal([frames.views])[0]
    part = ("--first", "{{Task.Param.Frame}}", "--last", "{{Param.LastFrame}}", "--count", "{{Param.FramesPerTask}}")
    edit = ("--edit", "{{Param.Edit}}") if frames.edit else ()
    arguments = ["render", "{{Param.Project}}", "--out", "{{Param.Frames}}", "--views", views, *part, *edit]
    step = _step("Render", [*arguments, "--skip-existing", *_literal(frames.arguments)], after)
    each = {"name": "Frame", "type": "INT", "range": "{{Param.FirstFrame}}-{{Param.LastFrame}}:{{Param.FramesPerTask}}"}
    return step | {"parameterSpace": {"taskParameterDefinitions": [each]}}


def _step(name: str, arguments: Sequence[str], after: str) -> Json:
    step = {"name": name, "script": {"actions": {"onRun": {"command": PYTHON, "args": [*RUN, *arguments]}}}}
    return step | ({"dependencies": [{"dependsOn": after}]} if after else {})


def _folder(name: str, place: str, flow: str, text: str) -> Json:
    return _path(name, "DIRECTORY", place, flow, text)


def _path(name: str, kind: str, place: str, flow: str, text: str) -> Json:
    return _parameter(name, "PATH", place, text) | {"objectType": kind, "dataFlow": flow}


def _parameter(name: str, kind: str, default: str | int, text: str) -> Json:
    return {"name": name, "type": kind, "description": text, "default": default}


def _literal(arguments: Sequence[str]) -> list[str]:
    """Return arguments unchanged; refuse double braces, which a template would expand."""
    for text in arguments:
        if "{{" in text or "}}" in text:
            raise BadRequest(f"{text!r} holds two braces, which no job template can hold.", "Choose another name.")
    return list(arguments)
