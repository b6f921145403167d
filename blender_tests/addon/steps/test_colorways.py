"""Colorways: colors are predicted without the engine, which then renders them."""

from types import SimpleNamespace

import pytest

from ..layout import Layout

SHEET = """colorway,object,hex,lab
Night,pot,#102040,
Night,lid,,60 90 -90
Day,pot,#e0c080,
"""


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "autumn.csv"
    path.write_text(SHEET)
    return path


def test_colorways_are_predicted_without_an_engine(addon, learned, sheet, monkeypatch):
    monkeypatch.setenv("KARF_ENGINE_PYTHON", "/nowhere/python")
    night, day = addon.steps.predict_colorways(learned, sheet)
    assert (night.colorway.name, day.colorway.name) == ("Night", "Day")
    pot, lid = night.predictions
    assert pot.ciede2000 < 1 and not pot.reason
    assert lid.ciede2000 > 2 and "no sRGB picture" in lid.reason
    for swatch in learned.karf.objects["pot"].swatches[1:]:
        swatch.locked = True
    night, _ = addon.steps.predict_colorways(learned, sheet)
    assert "locked swatches" in night.predictions[0].reason


@pytest.mark.parametrize("is_chosen", [True, False])
def test_engine_renders_each_colorway_in_each_view(bpy, addon, learned, sheet, tmp_path, is_chosen):
    if is_chosen:
        folder = tmp_path / "out"
        addon.steps.colorways(learned, sheet, "photo_0,photo_2", folder).wait()
    else:
        folder = addon.folders.out_folder(learned) / "colorways" / "autumn"
        assert bpy.ops.karf.render_colorways(filepath=str(sheet), views="photo_0,photo_2") == {"FINISHED"}
    written = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.png"))
    assert written == ["Day/photo_0.png", "Day/photo_2.png", "Night/photo_0.png", "Night/photo_2.png"]


def test_invalid_sheet_is_rejected_before_a_job_starts(bpy, addon, learned, sheet):
    sheet.write_text(SHEET.replace("Day,pot", "Day,pan"))
    with pytest.raises(addon.engine_api.DataError, match="line 4: there is no object 'pan'"):
        addon.steps.colorways(learned, sheet).wait()
    with pytest.raises(RuntimeError, match="line 4"):
        bpy.ops.karf.colorways(filepath=str(sheet))
    assert not list(addon.folders.project_of(learned).folder.glob("jobs/*colorways"))
    learned.karf.objects.clear()
    assert not bpy.ops.karf.colorways.poll() and not bpy.ops.karf.render_colorways.poll()


def test_dialog_lists_each_colors_difference_and_reason(bpy, addon, learned, sheet):
    operators, drawn = addon.colorways, []
    operators.show_predictions(bpy.context, sheet)
    shown, rows = bpy.context.window_manager.karf_colorways, [("Night", "pot"), ("Night", "lid"), ("Day", "pot")]
    assert [(item.colorway, item.object) for item in shown.colors] == rows
    for item in shown.colors:
        operators.draw_color(Layout(bpy, drawn), item)
    assert drawn.count("Night") == 2 and any("no sRGB picture" in text for text in drawn)
    assert shown.active == 1  # the first that cannot be reached
    drawn.clear()
    dialog = SimpleNamespace(layout=Layout(bpy, drawn), bl_rna=bpy.ops.karf.render_colorways.get_rna_type())
    operators.KARF_OT_render_colorways.draw(dialog, bpy.context)
    assert "3 colors, 1 out of reach. Numbers: difference from the wanted color; 1 is just visible" in drawn
    assert any(text.startswith("Out of reach: no sRGB picture") for text in drawn)
