"""A sequence of new cameras around the still life, with an edit."""

from pathlib import Path

import karf_engine as karf
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import View
from karf_engine.palettes.palette import Edit, write_edit


class Sequence:
    """A learned project, a file of cameras, and an edit."""

    def __init__(self, project: Path, folder: Path, count: int, size: int = 12):
        self.project, self.cameras, self.edit = project, folder / "cameras.json", folder / "edit.json"
        self.angles, self.size = [0.05 * number for number in range(count)], size
        self.paint((0.1, 0.2, 0.8))
        self.move()

    def paint(self, color, path=None):
        """Write an edit that gives the ball's first swatch this color."""
        palettes = karf.load(self.project, device="cpu").palettes
        colors = {palette.name: palette.colors.copy() for palette in palettes}
        colors["ball"][1] = color
        write_edit(path or self.edit, Edit(colors))

    def move(self, number=0, angle=0.0):
        """Write the cameras, one of them at another angle."""
        self.angles[number] = angle
        cameras = {f"frame_{n:04d}": camera_at(angle, 0.5, size=self.size) for n, angle in enumerate(self.angles, 1)}
        write_cameras(self.cameras, [View(name, name, camera, None, "train") for name, camera in cameras.items()])

    def render(self, out, **options):
        chosen = {"views": str(self.cameras), "edit": self.edit} | options
        karf.render(self.project, out, threads=1, device="cpu", **chosen)
