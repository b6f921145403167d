"""Links in place of a project's files or folders never make the extension change anything outside it."""

import os
import shutil
from contextlib import suppress
from types import SimpleNamespace

import numpy as np
import pytest

from ..layout import Layout

pytestmark = pytest.mark.skipif(os.name == "nt", reason="links need a privilege on Windows")
PLACES = (
    *("project.json", "capture.json", "palette.json", "jobs", "lock", "planes", "masks/pot"),
    "geometry.safetensors segmentation.json volumes.json colorways_edges.json",
    "photos edits masks corrections",
    "seen inspection out",
    "planes/photo_0.npz masks/pot/photo_0.png corrections/pot out/recolor",
)


def files(folder):
    return {path: path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


def use_everything(bpy, addon, scene):
    """Do everything an artist does with a project; expected errors are ignored."""
    steps, errors = addon.steps, (addon.engine_api.KarfError, OSError, KeyError)
    area = SimpleNamespace(type="VIEW_3D", spaces=SimpleNamespace(active=SimpleNamespace(show_region_ui=True)))
    window = {"window_manager": bpy.context.window_manager, "screen": SimpleNamespace(areas=[area])}
    context = SimpleNamespace(scene=scene, area=area, **window)
    actions = (
        lambda: addon.disk.refresh(),
        lambda: addon.sidebar.draw_steps(Layout(bpy, []), context),
        lambda: addon.palettes.import_learned(scene),
        lambda: steps.show_photo(scene),
        lambda: addon.objects.sync(scene),
        lambda: setattr(scene.karf.marking, "active", scene.karf.marking.objects.find("pot")),
        lambda: steps.mark_stroke(scene, [(5, 5)], 3),
        lambda: setattr(scene.karf.marking.objects["pot"], "name", "kettle"),
        lambda: addon.objects.remove(scene),
        lambda: steps.segment(scene).wait(),
        lambda: steps.extract_palette(scene).wait(),
        lambda: steps.prepare_views(scene).wait(),
        lambda: steps.render_view(scene).wait(),
        lambda: addon.palettes._write_kept(scene, addon.edits.current_edit(scene)),
        lambda: addon.disk.refresh(),
    )
    for action in actions:
        with suppress(*errors):
            action()


@pytest.mark.parametrize("places", PLACES)
def test_links_change_nothing_outside_the_project(bpy, addon, learned, tmp_path, places):
    outside = tmp_path / "outside"  # with files named like the extension's
    for name in ("photo_0.png", "pot/photo_0.png", "recolor/photo_0.png", "20200101-000000-000-warm/a.png"):
        addon.images.write_png(outside / name, np.ones((16, 24, 3)))
    for place in places.split():
        target = outside / "made_by_a_link" if "." in place or place == "lock" else outside
        path = addon.folders.project_of(learned).folder / place
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
        path.symlink_to(target)
    before = files(outside)
    use_everything(bpy, addon, learned)
    assert files(outside) == before
