"""The owner of a job: its result goes to that file, scene and project, even if others are open or they were renamed."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import session
from ..project import folders


class OpenFile:
    """The open file; a new object for each opened file, also if it is the same again."""

    per_file = True


@dataclass(frozen=True)
class Owner:
    """A scene of a file and its project folder, if any."""

    file: OpenFile
    scene: int
    project: Path | None

    @classmethod
    def of(cls, scene: bpy.types.Scene) -> "Owner":
        return cls(session.get(OpenFile), scene.session_uid, _project_of(scene))

    @property
    def is_file_open(self) -> bool:
        """Return True while no other file was opened."""
        return self.file is session.get(OpenFile)

    def find(self) -> bpy.types.Scene | None:
        """Return the scene, if it still exists and has the same project."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if scene.session_uid == self.scene and _project_of(scene) == self.project:
                return scene
        return None

    def scenes(self) -> Iterator[bpy.types.Scene]:
        """Yield all scenes of the file with the same project; none after another file was opened."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if self.project is not None and _project_of(scene) == self.project:
                yield scene


def _project_of(scene: bpy.types.Scene) -> Path | None:
    return folders.project_of(scene).folder if scene.karf.project else None
