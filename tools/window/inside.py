"""Plays the story in the window: started with `blender --enable-event-simulate --python inside.py -- JOB`."""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # Blender runs this file by its path
from tools.window import acts, desk, first_picture, hands, learning, recoloring, record

IDLE_SECONDS = 0.005  # that Blender sleeps between two looks for events, where they are simulated


def tell(job: dict) -> hands.Wait:
    """Do the steps that the job names, or all; a failing step does not end the story."""
    file = Path(job["out"]) / "record.json"
    told = [*learning.CHAPTER.steps, *recoloring.CHAPTER.steps, *first_picture.CHAPTER.steps]
    told = [(step, run) for step, run in told if not job["only"] or step.name in job["only"]]
    steps = [step for step, _ in told]
    record.write(file, steps)
    yield 1.0
    if bpy.data.filepath:
        yield from acts.show_tab()
    for step, run in told:
        step.outcome = record.UNFINISHED
        record.write(file, steps)
        begin = time.monotonic()
        yield from perform(record.Story(job, step), run)
        step.seconds = round(time.monotonic() - begin, 1)
        record.write(file, steps)


def perform(story: record.Story, run: Callable[[record.Story], hands.Wait]) -> hands.Wait:
    """Do one step, and note its outcome."""
    failure = ""
    try:
        yield from run(story)
    except desk.Broken as broken:
        failure = str(broken)
    except Exception:
        failure = traceback.format_exc()
    if failure:
        story.note(failure)
        yield from story.shoot("failed")
        for _ in range(2):  # close what is open: popups, a file browser
            yield from hands.press("ESC", (hands.window().width // 2, hands.window().height // 2))
    story.step.outcome = record.FAILED if failure else record.PASSED


def idle() -> float:
    """Let Blender sleep, which it never would where events are simulated, and take a core from the engine."""
    time.sleep(IDLE_SECONDS)
    return 0.0


hands.play(tell(json.loads(sys.argv[-1])))
bpy.app.timers.register(idle, persistent=True)
