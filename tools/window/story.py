"""The story of an artist's afternoon, step by step, with what must hold after each. Runs inside Blender.

A step is a generator: it yields the seconds to wait until Blender resumes it. Its `how` says by what it is done: mouse
and keys are events in the window; what no event can reach in a sensible time is done by script.
"""

from . import editing, keeping, learning, pictures

STEPS = [step for chapter in (learning, editing, pictures, keeping) for step in chapter.CHAPTER.steps]
