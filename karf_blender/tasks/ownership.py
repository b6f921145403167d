"""Who began a job. Its end belongs to that file, scene and project, even if others are open or they are renamed by then."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import bpy

from .. import session
from ..project import folders


class OpenFile:
    """The file that is open: another one, or the same opened again, has another object."""

    per_file = True


@dataclass(frozen=True)
class Owner:
    """A scene, by `session_uid`, of the file that was open, and the project folder that it worked on, if any."""

    file: OpenFile
    scene: int
    project: Path | None

    @classmethod
    def of(cls, scene: bpy.types.Scene) -> "Owner":
        return cls(session.get(OpenFile), scene.session_uid, _project_of(scene))

    @property
    def is_file_open(self) -> bool:
        """True while no other file was opened."""
        return self.file is session.get(OpenFile)

    def find(self) -> bpy.types.Scene | None:
        """The scene, if it is still there and works on the same project."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if scene.session_uid == self.scene and _project_of(scene) == self.project:
                return scene
        return None

    def scenes(self) -> Iterator[bpy.types.Scene]:
        """All scenes of the file that work on the same project; none where another file was opened."""
        for scene in bpy.data.scenes if self.is_file_open else ():
            if self.project is not None and _project_of(scene) == self.project:
                yield scene


def _project_of(scene: bpy.types.Scene) -> Path | None:
    return folders.project_of(scene).folder if scene.karf.project else None
