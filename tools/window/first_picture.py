"""The shortest way from photos to a recolored picture of a printed object. Runs inside Blender."""

from __future__ import annotations

import bpy
import numpy as np

from . import acts, controls, desk, hands
from .desk import PHOTO_SIZE, check, until
from .hands import SIDEBAR, VIEW, Wait
from .recoloring import recolored
from .record import Chapter, Story

CHAPTER = Chapter()
AT_MOST = 10  # clicks, drags and keys
MUG = 50 / 256, 97 / 256, 118 / 256, 177 / 256  # in the first photo: left, top, right, bottom, in shares of it
INK, PAPER = 40, 5  # by how much blue exceeds red in its bands, and red blue between them, bytes


@CHAPTER.step("script: a new file with the KaRF workspace")
def start_anew(story: Story) -> Wait:
    """A new file shows the workspace, and knows nothing of the other one."""
    bpy.ops.wm.read_homefile()
    yield 1.0
    with hands.inside(VIEW):
        bpy.ops.karf.open_workspace()
    yield from until(lambda: hands.window().workspace.name == "KaRF", "the workspace")
    yield from acts.show_tab()
    yield from acts.save_file_as(story.desk / "first" / "first.blend")  # its project is another
    check(not desk.scene().karf.views, "a new file has views")


@CHAPTER.step("mouse: Import Capture, a box, Learn All, a swatch, step 5, This View; keys: Return; path by script")
def first_picture(story: Story) -> Wait:
    """Ten clicks, drags and keys recolor the bands of a mug, and leave the rest of the photo as it is."""
    hands.gestures.clear()
    yield from controls.press_button(SIDEBAR, r"karf\.import_capture")
    yield from acts.choose_file(story.desk / "pots")
    yield from until(lambda: desk.scene().karf.marking.photo is not None, "the photo to mark")
    yield 1.0  # its tool and size
    left, top, right, bottom = MUG
    yield from hands.drag([hands.in_picture(left, 1 - top), hands.in_picture(right, 1 - bottom)], 0.5)
    yield from until(lambda: desk.mask_file().is_file(), "the mask", 60)
    yield from story.shoot("marked")
    yield from acts.press_job(r"karf\.learn_all")
    yield from acts.fit_picture()
    yield from story.shoot("learned")
    photo = desk.pixels()
    yield from controls.drag_swatch((-45, -25))
    yield from story.shoot()
    yield from controls.open_step(SIDEBAR, "render")
    yield from acts.dialog_job(story, r"karf\.render_view")
    picture = desk.pixels_of(recolored(f"{desk.scene().karf.active_view}.png"))
    check(len(hands.gestures) <= AT_MOST, f"it took {len(hands.gestures)} gestures: {hands.gestures}")
    story.note(f"{len(hands.gestures)} gestures: {', '.join(hands.gestures)}")
    changed, bands, others = desk.difference(photo, picture).max(-1), *_bands(photo)
    story.note(
        f"bands changed by {np.median(changed[bands]):.0f} of 255, others by {np.percentile(changed[others], 95)}"
    )
    check(np.median(changed[bands]) > 40, "the bands have not changed")
    check(np.percentile(changed[others], 95) <= 2, "the cream of the mug has changed")
    check(np.percentile(changed, 50) <= 1, "the rest of the photo has changed")


def _bands(photo: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return where the mug's bands are, and where its paper is, [H, W] bool."""
    left, top, right, bottom = (round(share * PHOTO_SIZE) for share in MUG)
    inside = np.zeros(photo.shape[:2], bool)
    inside[top:bottom, left:right] = True
    blue_over_red = photo[..., 2].astype(int) - photo[..., 0]
    return inside & (blue_over_red > INK), inside & (blue_over_red < -PAPER)
