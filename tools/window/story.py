"""The stories, step by step, with what must hold after each. Runs inside Blender.

A step is a generator: it yields the seconds to wait until Blender resumes it. Its `how` says by what it is done: mouse
and keys are events in the window; what no event can reach in a sensible time is done by script.
"""

from . import any_view, controls, editing, first_color, keeping, learning, pictures, splats
from .telling import Chapter, Step

CHAPTERS = {
    "afternoon": (learning, editing, controls, pictures, keeping),
    "first-color": (first_color, any_view, splats),
}


def steps_of(story: str) -> list[Step]:
    """The steps of a story."""
    chapters: list[Chapter] = [module.CHAPTER for module in CHAPTERS[story]]
    return [step for chapter in chapters for step in chapter.steps]
