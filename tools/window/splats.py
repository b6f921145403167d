"""The scene leaves as a splat, comes back as one of another program would, is recolored anew and leaves again. Runs inside
Blender."""

from __future__ import annotations

import importlib
from pathlib import Path

import bpy
import numpy as np

from . import acts, desk, hands, pickers
from .acts import STEPS, Story, check, until
from .first_color import MASK_SECONDS, OBJECT, TO_BLUE
from .hands import Wait
from .telling import Chapter

CHAPTER = Chapter()
COLOR = 11  # the first column of a table of Gaussians that is of its color
MOST_CHANGED = 0.9
OUT, BACK, CAMERA = "garden.ply", "garden_blue.ply", "marked_view.json"


def table_of(path: Path) -> np.ndarray:
    """The Gaussians of a .ply, by the engine that the extension brings."""
    return importlib.import_module(f"{desk.PACKAGE}.karf_engine.splats.formats.ply").read(path).table


def unfold(step: str) -> Wait:
    """Open one step of the panel alone, so that all of it is in sight."""
    for name in desk.module("workspace.states").STEPS:
        setattr(bpy.data.window_managers[0].karf_folding, f"show_{name}", False)
    yield from acts.open_step(step)


def export(story: Story, name: str) -> Wait:
    """Export Splat to a file on the desk; returns when it is written."""
    yield from unfold("render")
    yield from hands.press_button(STEPS, r"karf\.export_splat")
    yield from acts.job_begin(acts.file_browser(story.desk, name), "karf.export_splat")
    yield from acts.job_end(story)
    check((story.desk / name).is_file(), f"there is no {name}")


@CHAPTER.step(
    "splat out", "mouse: Export Splat; path by script, button clicked. Script: the marked view's camera as a file"
)
def leave(story: Story) -> Wait:
    yield from acts.set_up_screen()  # the sidebars may have been put away
    yield from export(story, OUT)
    story.note(f"{len(table_of(story.desk / OUT))} Gaussians")
    scene = desk.scene()
    camera = desk.module("rig.cameras").camera_of(scene, story.job["view"])
    desk.module("steps").export_cameras(scene, story.desk / CAMERA, camera, [scene.frame_current])


@CHAPTER.step("splat in", "mouse: Import Splat; paths by script, button clicked")
def come(story: Story) -> Wait:
    yield from unfold("import")
    yield from hands.press_button(STEPS, r"karf\.import_splat")
    yield from until(lambda: acts.editors("FILE_BROWSER") > 0, "the file browser", 10)
    yield 0.5
    hands.area_of("FILE_BROWSER").spaces.active.active_operator.cameras = str(story.desk / CAMERA)
    yield from story.shoot("splat-browser")
    yield from acts.job_begin(acts.file_browser(story.desk, OUT), "karf.import_splat")
    yield from acts.job_end(story)
    karf = desk.scene().karf
    yield from until(lambda: karf.marking.photo is not None and karf.active_view == "view_000", "the view to mark", 10)
    story.note(f"{len(karf.views)} views")
    check(not karf.objects, "the objects of another capture are still there")
    yield 1.0
    yield from story.shoot("splat-imported")


@CHAPTER.step("splat mark", "mouse: a box dragged around the object")
def mark(story: Story) -> Wait:
    corner, other = (acts.on_photo(*place) for place in story.job["box"])
    middle = [round((one + two) / 2) for one, two in zip(corner, other, strict=True)]
    yield from hands.drag([corner, middle, other])
    read = desk.module("project.disk").read
    yield from until(lambda: list(read(desk.scene()).masks.values()) == [1], "the engine's mask", MASK_SECONDS)
    yield from story.shoot("splat-marked")


@CHAPTER.step("splat learn", "mouse: Learn All")
def learn(story: Story) -> Wait:
    yield from unfold("learn")
    yield from acts.button_job(story, r"karf\.learn_all")
    stages = desk.module("project.disk").contents_of(desk.scene()).stages
    check("splats" in stages, "the imported splats are not shown")
    yield from story.shoot("splat-learned")


@CHAPTER.step("splat color", "mouse: a swatch is dragged")
def color(story: Story) -> Wait:
    swatches, before = desk.swatches()[OBJECT], desk.picture()
    index = max(range(1, len(swatches)), key=lambda number: max(swatches[number]) - min(swatches[number]))
    yield from unfold("edit")
    yield from pickers.drag_swatch(story, OBJECT, index, 10, TO_BLUE)
    check(desk.picture() != before, "the picture did not change")
    yield from story.shoot("splat-recolored")


@CHAPTER.step("splat back", "mouse: Export Splat; path by script, button clicked")
def back(story: Story) -> Wait:
    yield from export(story, BACK)
    for sentence in compare(story.desk / OUT, story.desk / BACK):
        story.note(sentence)


def compare(before: Path, after: Path) -> list[str]:
    """What differs between two files of the same Gaussians; Broken where it is more than some rows' colors."""
    own, other = table_of(before), table_of(after)
    check(own.shape == other.shape, f"{own.shape} Gaussians became {other.shape}")
    check(np.array_equal(own[:, :COLOR], other[:, :COLOR]), "not only colors changed")
    share = float((own != other).any(1).mean())
    check(0 < share < MOST_CHANGED, f"{share:.0%} of the Gaussians changed")
    check(before.stat().st_size == after.stat().st_size, "the files are not of the same size")
    return [f"{share:.0%} of the Gaussians have another color, and nothing else changed"]
