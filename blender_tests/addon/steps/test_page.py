"""The web page of a scene: what the engine is given by the operator and by scripts."""

import json
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def exported(addon):
    """Exports the page and returns the options that the engine received, and the looks of its sheet by name."""

    def export(scene, *arguments, **options):
        given = json.loads(addon.steps.export_page(scene, *arguments, **options).wait().read_text())
        if "sheet" not in given:
            return given, {}
        folder = Path(given["sheet"]).parent
        rows = json.loads(Path(given["sheet"]).read_text())
        return given, {row["colorway"]: json.loads((folder / row["edit"]).read_text()) for row in rows}

    return export


def test_page_has_the_scenes_looks(bpy, addon, with_splats, exported):
    bpy.ops.karf.keep_look()
    addon.steps.set_swatch(with_splats, "pot", 1, (0.1, 0.2, 0.9))
    bpy.ops.karf.keep_look(name="Sea / blue")
    _, looks = exported(with_splats)
    assert looks == {look.name: json.loads(look.edit) for look in with_splats.karf.looks}


def test_page_without_looks_has_the_current_swatches(addon, with_splats, exported):
    addon.steps.set_swatch(with_splats, "pot", 1, (0.1, 0.2, 0.9))
    _, looks = exported(with_splats)
    assert looks.keys() == {"Recolored"}
    np.testing.assert_allclose(looks["Recolored"]["objects"]["pot"]["colors"][1], (0.1, 0.2, 0.9), atol=1e-6)


def test_locked_swatches_and_fading_are_the_scenes(addon, with_splats, exported):
    with_splats.karf.objects["pot"].swatches[1].locked = True
    with_splats.karf.fade_unseen = False
    given, _ = exported(with_splats)
    assert "pot/1" in given["locked"] and "lid/1" not in given["locked"]
    assert given["overrides"] == ["render.unseen=shown"]


def test_button_gives_the_engine_its_fields(bpy, addon, with_splats, tmp_path):
    fields = {"title": "Pots", "studio": "Us", "logo": str(tmp_path / "us.svg"), "single": True}
    assert bpy.ops.karf.export_page(directory=str(tmp_path / "page"), **fields) == {"FINISHED"}
    given = json.loads((tmp_path / "page" / "index.html").read_text())
    assert {name: given[name] for name in fields} == fields


def test_page_goes_to_the_output_folder_under_the_scenes_name(bpy, addon, with_splats):
    bpy.ops.karf.export_page()
    folder = addon.folders.out_folder(with_splats) / "page"
    given = json.loads((folder / "index.html").read_text())
    assert given["title"] == with_splats.name and "logo" not in given


def test_page_needs_splats_but_no_palettes(bpy, learned, addon, exported):
    assert not bpy.ops.karf.export_page.poll()
    addon.steps.learn_splats(learned).wait()
    learned.karf.objects.clear()
    assert bpy.ops.karf.export_page.poll()
    assert exported(learned)[1] == {}
