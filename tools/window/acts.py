"""What the steps of the story are made of: waiting, jobs, files, swatches, brush strokes. Runs inside Blender."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from . import desk, hands
from .hands import Wait, Where

TAB = "KaRF"
FILM_FRAMES = 60
STEPS, BESIDE_PICTURE = Where("VIEW_3D"), Where("IMAGE_EDITOR")  # the sidebars, of the steps and of marks and swatches
PICTURE = Where("IMAGE_EDITOR", "WINDOW")
TOOLBAR = Where("IMAGE_EDITOR", "TOOLS")
VIEW = Where("VIEW_3D", "WINDOW")
JOB_SECONDS = 900.0  # a machine may be busy with other things
ASKED_SECONDS = 4.0  # in which a busy machine has opened what was asked for, where Blender asks nothing
MARKED = r"karf\.marking\.active"  # the rows of the list of objects to mark
LIST_ROW = 20  # pixels between two rows of a list
BRUSH = 14  # at most: radius, pixels of the screen


class Broken(Exception):
    """What a step promises does not hold."""


@dataclass
class Story:
    """What the steps know: the driver's job, and facts that outlive a crash of Blender."""

    job: dict[str, Any]
    facts: dict[str, Any]
    note: Callable[[str], None]
    shoot: Callable[[str], Wait]

    @property
    def desk(self) -> Path:
        """The folder in which the artist works."""
        return Path(self.job["desk"])

    @property
    def home(self) -> Path:
        """The folder of the .blend and its project."""
        return self.desk / "here"


def check(holds: bool, sentence: str) -> None:
    """Raise Broken with the sentence where something does not hold."""
    if not holds:
        raise Broken(sentence)


def install(story: Story) -> Wait:
    """Install from Disk, and the engine's Python in the preferences; nothing lies over the window that events hit."""
    view = bpy.context.preferences.view
    view.show_splash = view.show_tooltips = False
    view.filebrowser_display_type, view.render_display_type = "SCREEN", "NONE"
    bpy.ops.extensions.package_install_files(filepath=story.job["package"], repo="user_default", enable_on_install=True)
    check(desk.PACKAGE in bpy.context.preferences.addons, "the extension is not enabled after its installation")
    choose_engine(story)
    yield from until(lambda: not desk.module("preferences.state").known().problem, "the engine to be noticed", 10)


def choose_engine(story: Story) -> None:
    """Set the engine's Python in the preferences."""
    preferences = desk.module("preferences").current()
    preferences.engine_python, preferences.threads = story.job["engine_python"], story.job["threads"]


# --- what several steps do -----------------------------------------------------------------------------------------
def until(condition: Callable[[], bool], what: str, seconds: float) -> Wait:
    """Wait for something; Broken where it does not come."""
    end = time.monotonic() + seconds
    while not condition():
        check(time.monotonic() < end, f"{what} did not happen within {seconds:.0f} s")
        yield 0.1


def job_end(story: Story, expected: str = "done", seconds: float = JOB_SECONDS) -> Wait:
    """Wait for the running job; Broken where it ends otherwise than expected."""
    progress = bpy.data.window_managers[0].karf_progress
    yield from until(lambda: not desk.module("tasks.runner").is_running(), "the job's end", seconds)
    if progress.warnings:
        story.note(f"warning: {progress.warnings}")
    check(not progress.error, f"{progress.stage} failed: {progress.error}")
    check(progress.text == expected, f"{progress.stage} ended as {progress.text!r}, not {expected!r}")
    yield 0.5


def job_begin(press: Wait, operator: str) -> Wait:
    """Press what starts a job, and wait for it; one that ends between two looks has announced that its status changed."""
    runner, session, events = desk.module("tasks.runner"), desk.module("session"), []
    notify = session.notify

    def noted(event: str, *values: object) -> None:
        events.append(event)
        notify(event, *values)

    session.notify = noted
    try:
        yield from press
        yield from until(lambda: runner.STATUS_CHANGED in events or runner.is_running(), f"{operator}'s job", 10)
    finally:
        session.notify = notify


def button_job(story: Story, operator: str) -> Wait:
    """Click a button that starts a job, and wait for its end."""
    yield from job_begin(hands.press_button(STEPS, operator), operator)
    yield from hands.move(hands.middle_of(PICTURE))  # a button under the mouse would stay greyed out after the job
    yield from job_end(story)


def open_step(name: str) -> Wait:
    """Open a step that did not open by itself."""
    setattr(bpy.data.window_managers[0].karf_folding, f"show_{name}", True)
    yield from show_tab()


def dialog_job(story: Story, operator: str) -> Wait:
    """Click a button that asks in a dialog, take that as it is, and wait for the end of its job."""
    yield from hands.press_button(STEPS, operator)
    yield 0.5
    yield from story.shoot(f"dialog-{operator.rpartition('.')[2]}")
    take = hands.press("RET", (hands.window().width // 2, hands.window().height // 2))
    yield from job_begin(take, operator)
    yield from job_end(story)


def file_browser(folder: Path, name: str = "") -> Wait:
    """Choose a file in the file browser that is open: the path is put in by script, the button that takes it clicked."""
    yield from until(lambda: editors("FILE_BROWSER") > 0, "the file browser", 10)
    yield 0.5
    params = hands.area_of("FILE_BROWSER").spaces.active.params
    params.directory, params.filename = str(folder).encode(), name
    hands.count()  # the path, which an artist types or clicks together
    yield 0.5
    yield from hands.press_button(Where("FILE_BROWSER", "EXECUTE"), r"file\.execute", 0.93)
    yield from until(lambda: editors("FILE_BROWSER") == 0, "the file browser's end", 30)
    yield 0.5


def save_file() -> Wait:
    """Ctrl S, as one does now and then."""
    yield from hands.press("S", hands.middle_of(VIEW), ctrl=True)
    yield from affirm_pictures(lambda: not bpy.data.is_dirty)
    yield from until(lambda: not bpy.data.is_dirty, "saving", 10)


def save_file_as(blend: Path) -> Wait:
    """Ctrl Shift S, to another place."""
    yield from hands.press("S", hands.middle_of(VIEW), ctrl=True, shift=True)
    yield from affirm_pictures(lambda: editors("FILE_BROWSER") > 0)
    yield from file_browser(blend.parent, blend.name)
    yield from until(lambda: bpy.data.filepath == str(blend), "saving", 10)


def affirm_pictures(is_asked_nothing: Callable[[], bool]) -> Wait:
    """Blender 5 asks before it saves whether pictures without a file should be saved too; Return says yes."""
    end = time.monotonic() + ASKED_SECONDS
    while not is_asked_nothing() and time.monotonic() < end:
        yield 0.2
    if not is_asked_nothing():
        yield from hands.press("RET", hands.middle_of(PICTURE))


def editors(kind: str) -> int:
    """How many editors of a type the window has."""
    return sum(area.type == kind for area in hands.window().screen.areas)


def set_up_screen() -> Wait:
    """3D View at the left, Image Editor at the right, in both the KaRF tab."""
    if not editors("IMAGE_EDITOR"):
        with hands.inside(VIEW):
            bpy.ops.screen.area_split(direction="VERTICAL", factor=0.4)
        hands.area_of("VIEW_3D").type = "IMAGE_EDITOR"
    for kind in ("VIEW_3D", "IMAGE_EDITOR"):
        hands.area_of(kind).spaces.active.show_region_ui = True
    yield 1.0


def show_tab() -> Wait:
    """Bring the KaRF tab to the front in both sidebars, and fit the picture."""
    for kind in ("VIEW_3D", "IMAGE_EDITOR"):
        sidebar = hands.region_of(Where(kind))
        sidebar.active_panel_category = TAB
        sidebar.tag_redraw()
    yield 0.5


def mark(story: Story, number: int, name: str) -> Wait:
    """Name the object of a number in the list, and paint over it with the brush from the toolbar."""
    row = yield from hands.find(BESIDE_PICTURE, MARKED, 0.2)
    x, top = yield from hands.edge(BESIDE_PICTURE, MARKED, row, (0, 1))
    yield from hands.write(name, (x, top - number * LIST_ROW - LIST_ROW // 2), ctrl=True)
    item = desk.scene().karf.marking.objects[number]
    check(item.name == name, f"typed {name}, got {item.name}")
    yield from hands.press_button(TOOLBAR, r"karf\.mark_brush", 0.5)
    for _ in range(5):
        if desk.scene().karf.marking.brush > BRUSH:
            yield from hands.press("LEFT_BRACKET", hands.middle_of(PICTURE))
    for stroke in story.job["strokes"][name]:
        yield from hands.drag([on_photo(*place) for place in stroke])
    yield from story.shoot(f"marked-{name}")


def on_photo(u: float, v: float) -> hands.Place:
    """A place of the picture in the Image Editor, in shares of it from the lower left, in the window."""
    region = hands.region_of(PICTURE)
    x, y = region.view2d.view_to_region(u, v, clip=False)
    return x + region.x, y + region.y


def render_animation(story: Story, number: int, frames: int) -> Wait:
    """Blender's own animation render while the keyframed picture is open."""
    scene, film = desk.scene(), story.desk / f"film_{number}"
    scene.render.engine, scene.render.filepath = "BLENDER_WORKBENCH", f"{film}/"
    scene.render.resolution_percentage = 50
    check(editors("IMAGE_EDITOR") == 1 and scene.karf.result is not None, "the picture is not open")
    hands.area_of("IMAGE_EDITOR").spaces.active.image = scene.karf.result
    yield from hands.press("F12", hands.middle_of(VIEW), ctrl=True)
    # an idle machine is done before anybody looks
    yield from until(lambda: bpy.app.is_job_running("RENDER") or any(film.glob("*.png")), "the render", 10)
    if number == 1:
        yield from story.shoot("rendering")
    end = time.monotonic() + 120
    while bpy.app.is_job_running("RENDER"):
        check(time.monotonic() < end, "the render did not end within 120 s")
        hands.area_of("IMAGE_EDITOR").tag_redraw()  # drawn while it may be written: where Blender used to crash
        yield 0.005
    yield 1.0
    count = len(list(film.glob("*.png")))
    check(count == frames, f"{count} frames were written, not {frames}")
    check(desk.is_in_step(), "after the render the picture is not what the swatches say")


def save_facts(story: Story) -> None:
    """Keep what a new Blender must know after a crash."""
    Path(story.job["facts"]).write_text(json.dumps(story.facts))


def open_group(wanted: str) -> Wait:
    """Open the group of step 7 that has a button: a click on each row below the first group that has no button."""
    _, top = yield from hands.find(STEPS, r"karf\.render_camera")
    x, _ = hands.middle_of(STEPS, hands.COLUMNS[0])
    for y in range(top - hands.ROW, hands.region_of(STEPS).y + 4 * hands.ROW, -hands.ROW):
        yield from hands.move((x, y))
        if hands.meaning(STEPS):
            continue
        yield from hands.click((x, y))
        for below in range(1, 5):
            yield from hands.move((x, y - below * hands.ROW))
            if re.search(wanted, hands.meaning(STEPS)):
                return
        yield from hands.click((x, y))  # it was another group
    raise Broken(f"no group has {wanted}")


def render_image(file: Path) -> Wait:
    """F12, and what it has rendered as a file."""
    yield from hands.press("F12", hands.middle_of(PICTURE))
    yield 1.0
    yield from until(lambda: not bpy.app.is_job_running("RENDER"), "the render's end", 60)
    bpy.data.images["Render Result"].save_render(str(file))
