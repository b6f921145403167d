"""A sequence of new cameras round the still life, with an edit."""

from dataclasses import dataclass
from pathlib import Path

import karf_engine as karf
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import View
from karf_engine.palettes.palette import Edit, write_edit


@dataclass(frozen=True)
class Sequence:
    """A learned project, a file of cameras, and an edit."""

    project: Path
    cameras: Path
    edit: Path

    def render(self, out, **options):
        chosen = {"views": str(self.cameras), "edit": self.edit} | options
        karf.render(self.project, out, threads=1, device="cpu", **chosen)


def write_sequence(project, folder, count, size=12):
    names = [f"frame_{number:04d}" for number in range(1, count + 1)]
    cameras = [camera_at(0.05 * number, 0.5, size=size) for number in range(count)]
    views = [View(name, name, camera, None, "train") for name, camera in zip(names, cameras, strict=True)]
    write_cameras(folder / "cameras.json", views)
    palettes = karf.load(project, device="cpu").palettes
    colors = {palette.name: palette.colors.copy() for palette in palettes}
    colors["ball"][1] = [0.1, 0.2, 0.8]
    write_edit(folder / "edit.json", Edit(colors))
    return Sequence(project, folder / "cameras.json", folder / "edit.json")
