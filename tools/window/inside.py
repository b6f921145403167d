"""Runs the story in the window: started by the driver with `blender --enable-event-simulate --python inside.py -- JOB`."""

from __future__ import annotations

import json
import sys
import time
import traceback
from collections.abc import Generator
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # Blender runs this file by its path
from tools.window import acts, hands, record
from tools.window.story import steps_of
from tools.window.telling import Step

SHOT_SECONDS = 5.0
IDLE_SECONDS = 0.005  # that Blender sleeps between two looks for events, where they are not simulated


def play(job: dict) -> Generator[float, None, None]:
    """The steps after the one named by the job, of those it names; a step that fails does not end the story."""
    lines, facts = Path(job["record"]), Path(job["facts"])
    known = json.loads(facts.read_text()) if facts.exists() else {}
    story = acts.Story(job, known, lambda text: record.note(lines, kind="note", text=text), shooter(job))
    yield 1.0
    if bpy.data.filepath:  # after a crash: the window as the .blend has it
        yield from acts.set_up_screen()
        yield from acts.show_tab()
    steps = steps_of(job["story"])
    names = [step.name for step in steps]
    start = names.index(job["after"]) + 1 if job["after"] else 0
    for step in steps[start:]:
        parts = {part.strip() for part in step.name.split(",")}  # as the names of steps that are given
        if not job["only"] or parts <= set(job["only"]):
            yield from perform(story, step, lines)
            acts.save_facts(story)


def perform(story: acts.Story, step: Step, lines: Path) -> Generator[float, None, None]:
    """One step, and its lines in the record."""
    record.note(lines, kind="begin", name=step.name, how=step.how)
    begin = time.monotonic()
    outcome = record.PASSED
    try:
        yield from step.run(story)
    except (acts.Broken, hands.NotFound) as failure:
        outcome = record.FAILED
        story.note(str(failure))
    except Exception:
        outcome = record.FAILED
        story.note(traceback.format_exc())
    if outcome == record.FAILED:
        yield from story.shoot(f"failed-{step.name}")
        yield from back_to_the_window()
    record.note(lines, kind="end", outcome=outcome, seconds=round(time.monotonic() - begin, 1))


def back_to_the_window() -> Generator[float, None, None]:
    """Close what a failed step has left open: popups, a file browser."""
    for _ in range(2):
        area = max(hands.window().screen.areas, key=lambda each: each.width * each.height)
        yield from hands.press("ESC", (area.x + area.width // 2, area.y + area.height // 2))


def shooter(job: dict):
    """A function that has the driver photograph the screen, and waits until it has."""

    def shoot(name: str) -> Generator[float, None, None]:
        name = name.replace(" ", "-").replace(",", "").replace("'", "")
        yield 0.3
        if job["has_screen"]:
            record.note(Path(job["record"]), kind="shot", text=name)
            end = time.monotonic() + SHOT_SECONDS
            while not (Path(job["shots"]) / f"{name}.png").exists() and time.monotonic() < end:
                yield 0.05

    return shoot


def main() -> None:
    """Play the story from a timer: only there the window is drawn between two events."""
    job = json.loads(Path(sys.argv[sys.argv.index("--") + 1]).read_text())
    scenes = play(job)

    def tick() -> float | None:
        try:
            return next(scenes)
        except StopIteration:
            pass
        except BaseException:
            traceback.print_exc()
        bpy.ops.wm.quit_blender()
        return None

    bpy.app.timers.register(tick, first_interval=1.0, persistent=True)
    bpy.app.timers.register(idle, persistent=True)


def idle() -> float:
    """Let Blender sleep as an artist's does: where events are simulated it never would, and take a core from the engine."""
    time.sleep(IDLE_SECONDS)
    return 0.0


main()
