"""A task: engine jobs in a row, what follows each, and the scene that they belong to."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import bpy

from ..engine_api import Request
from .ownership import Owner


@dataclass(frozen=True)
class Task:
    """Jobs of one project to run in a row, with what Blender does after each is done, for the scene that began them.

    Attributes:
        title: What the panel calls it.
        requests: The jobs.
        after: Called with each job's request when it is done.
        owner: Who began it.
        seconds: What each job is expected to take, where they are several.
        result: Gives what came of it, for the script that has waited until all was done.
    """

    title: str
    requests: tuple[Request, ...]
    after: Callable[[Request], None]
    owner: Owner | None = None
    seconds: tuple[float, ...] = ()
    result: Callable[[], Any] = lambda: None

    @property
    def is_file_open(self) -> bool:
        """True while the file is open that began the task."""
        return self.owner is None or self.owner.is_file_open

    @property
    def label(self) -> str:
        """The title, with the scene's name where the file has several, or that it is another file's."""
        if not self.is_file_open:
            return f"{self.title} (of another file)"
        scene = self.owner.find() if self.owner and len(bpy.data.scenes) > 1 else None
        return f"{self.title} ({scene.name})" if scene else self.title
