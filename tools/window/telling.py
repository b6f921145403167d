"""What a chapter of the story is made of. Runs inside Blender."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .acts import Story
from .hands import Wait


@dataclass(frozen=True)
class Step:
    """A step: its name, how it is done, and the generator that does it."""

    name: str
    how: str
    run: Callable[[Story], Wait]


class Chapter:
    """Steps in their order."""

    def __init__(self):
        self.steps: list[Step] = []

    def step(self, name: str, how: str):
        """Add a generator function to the chapter."""

        def add(run: Callable[[Story], Wait]):
            self.steps.append(Step(name, how, run))
            return run

        return add
