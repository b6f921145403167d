"""The command `colorways`: pictures of every colorway in every view, tables, resuming and planning."""

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest

import karf_engine as karf
from blender_tests.engine.commands.conftest import cameras_file
from karf_engine.cli import main
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.io.images import read_photo
from karf_engine.palettes.calibration import ReferenceLight
from karf_engine.palettes.colorways import plan_colorways
from karf_engine.palettes.palette import hex_to_rgb, write_edit
from karf_engine.project import Project

SHEET = """colorway,object,hex,lab
Green,ball,#1ec040,
Green,block,,70 10 60
Violet,ball,,60 90 -90
Grey / matt,block,#808080,
"""


def write_sheet(folder, text=SHEET):
    path = folder / "sheet.csv"
    path.write_text(text)
    return path


@pytest.fixture
def sheet(tmp_path):
    return write_sheet(tmp_path)


def run(project, sheet, out, *more, views="test"):
    options = ("--sheet", sheet, "--views", views, "--out", out, "--threads", 1, *more)
    assert main(["colorways", *map(str, (project, *options))]) == 0
    return out


@pytest.fixture(scope="module")
def rendered(learned, tmp_path_factory):
    """The sheet in the two held-out views."""
    folder = tmp_path_factory.mktemp("colorways")
    return run(learned.project, write_sheet(folder), folder / "out")


def rows_of(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def table(out):
    return {(row["colorway"], row["object"]): row for row in rows_of(out / "colorways.csv")}


def times(out):
    return {str(path.relative_to(out)): path.stat().st_mtime_ns for path in out.rglob("test_*.png")}


def test_predict_only_writes_just_the_table(learned, sheet, tmp_path, capsys):
    out = run(learned.project, sheet, tmp_path / "out", "--predict-only")
    assert [path.name for path in out.iterdir()] == ["colorways.csv"]
    rows = table(out)
    assert len(rows) == 4 and not any(row["reached"] for row in rows.values())
    assert float(rows["Violet", "ball"]["predicted_ciede2000"]) > 3
    assert "no sRGB picture" in rows["Violet", "ball"]["cannot_be_reached_because"]
    assert "Violet, ball: cannot be reached, because no sRGB picture" in capsys.readouterr().err


def test_each_colorway_gets_a_folder_and_a_contact_sheet_row(rendered, model):
    assert sorted(path.name for path in rendered.iterdir() if path.is_dir()) == ["Green", "Grey _ matt", "Violet"]
    for planned in plan_colorways(model.project, rendered.parent / "sheet.csv"):
        folder = rendered / planned.colorway.folder
        assert sorted(path.name for path in folder.iterdir()) == ["test_r_0.png", "test_r_1.png"]
        expected = model.recolor(model.capture.view("test_r_0"), planned.edit)[..., :3]
        np.testing.assert_allclose(read_photo(folder / "test_r_0.png"), expected, atol=0.51 / 255)
    height, width, _ = read_photo(rendered / "contact_sheet.png").shape
    assert height > 3 * 192 and width > 2 * 192


def test_measured_colors_match_predictions_in_every_view(rendered):
    rows = rows_of(rendered / "views.csv")
    first = [" ".join((row["colorway"], row["object"], row["view"])) for row in rows[:3]]
    assert first == ["Green ball test_r_0", "Green ball test_r_1", "Green block test_r_0"] and len(rows) == 4 * 2
    for key, row in table(rendered).items():
        # object probabilities of this quickly learned project are at most 0.9
        assert abs(float(row["reached_ciede2000"]) - float(row["predicted_ciede2000"])) < 5
        own = [each for each in rows if (each["colorway"], each["object"]) == key]
        assert int(row["views"]) == 2 and sum(int(each["pixels"]) for each in own) == int(row["pixels"]) > 5
        for each in own:
            assert bool(each["cannot_be_reached_because"]) == (float(each["reached_ciede2000"]) > 2)
            assert key[0] != "Violet" or "no sRGB picture" in each["cannot_be_reached_because"]


def test_resume_keeps_finished_pictures_and_redoes_changed_colors(rendered, learned, tmp_path):
    out = shutil.copytree(rendered, tmp_path / "out")
    sheet, before = write_sheet(tmp_path, SHEET.replace("#808080", "#707070")), times(out)
    (out / "Green" / "test_r_1.png").unlink()
    (out / "Violet" / "test_r_0.png").write_bytes(b"cut off")
    asked = iter(range(3))
    options = {"views": "test", "threads": 1, "device": "cpu"}
    with pytest.raises(Cancelled):
        karf.colorways(learned.project, sheet, out, **options, should_stop=lambda: next(asked, None) is None)
    run(learned.project, sheet, out)
    rendered_again = {path for path, time in times(out).items() if before[path] != time}
    changed = {f"Grey _ matt/test_r_{number}.png" for number in range(2)}
    assert rendered_again == changed | {"Green/test_r_1.png", "Violet/test_r_0.png"}
    assert table(out)["Green", "ball"]["views"] == "2"


def test_edit_file_is_a_colorway_regardless_of_locks(model, learned, tmp_path):
    edit = model.edit()
    for colors in edit.colors.values():
        colors[1:] = 0.3
    write_edit(tmp_path / "edits" / "gray.json", edit)
    sheet = tmp_path / "looks.json"
    sheet.write_text('[{"colorway": "Gray", "edit": "edits/gray.json"}]')
    out = run(learned.project, sheet, tmp_path / "out", views="test_r_0")
    expected = model.recolor(model.capture.view("test_r_0"), edit)[..., :3]
    np.testing.assert_allclose(read_photo(out / "Gray" / "test_r_0.png"), expected, atol=0.51 / 255)
    (planned,) = plan_colorways(model.project, sheet, {model.objects[0]: [1]})
    assert not planned.predictions and (planned.edit.colors[model.objects[0]][1] == np.float32(0.3)).all()
    assert (out / "contact_sheet.png").exists()


def test_card_reports_colors_under_daylight(learned, tmp_path):
    card, brown = "#a08060", "#806050"
    sheet = write_sheet(tmp_path, f"colorway,object,hex\nBrown,block,{brown}\n")
    out = run(learned.project, sheet, tmp_path / "out", "--card", card)
    row, light = table(out)["Brown", "block"], ReferenceLight.of_card(hex_to_rgb(card))
    assert row["wanted"] == brown and {each["wanted"] for each in rows_of(out / "views.csv")} == {brown}
    difference = read_photo(out / "Brown" / "test_r_0.png") - light.photographed(hex_to_rgb(row["reached"]))
    assert np.abs(difference).max(-1).min() < 8 / 255  # of some pixel, under the photos' light
    for column in ("predicted", "reached"):
        left = ciede2000(srgb_to_lab(hex_to_rgb(row[column])), srgb_to_lab(hex_to_rgb(brown)))
        assert float(row[f"{column}_ciede2000"]) == pytest.approx(left, abs=0.6)  # of colors rounded to 8 bits


def test_colorways_use_the_edges_of_an_edit(model, learned, sheet, tmp_path):
    edged = model.edit().edge("ball", choke=3, feather=4)
    write_edit(tmp_path / "edges.json", edged)
    out = run(learned.project, sheet, tmp_path / "out", "--edges", tmp_path / "edges.json", views="test_r_0")
    cameras = run(learned.project, sheet, tmp_path / "cameras", views=cameras_file(tmp_path / "path.json", 2, 24))
    assert sorted(path.name for path in (cameras / "Green").iterdir()) == ["frame_0.png", "frame_1.png"]
    plain = {plan.colorway.name: plan.edit for plan in plan_colorways(model.project, sheet)}["Green"]
    view, written = model.capture.view("test_r_0"), read_photo(out / "Green" / "test_r_0.png")
    np.testing.assert_allclose(written, model.recolor(view, replace(plain, edges=edged.edges)), atol=0.51 / 255)
    assert np.abs(written - model.recolor(view, plain)).max() > 0.1


def test_plan_needs_no_tensors_keeps_locks_and_names_unknown_objects(copy, model, sheet, tmp_path):
    for path in copy.folder.rglob("*.safetensors"):
        path.unlink()
    free, _, _ = plan_colorways(copy, sheet)
    kept, _, _ = plan_colorways(copy, sheet, {"ball": [1]})
    learned_color = model.edit().colors["ball"][1]
    assert np.array_equal(kept.edit.colors["ball"][1], learned_color)
    assert not np.array_equal(free.edit.colors["ball"][1], learned_color)
    with pytest.raises(BadRequest, match="no swatch 9 of 'ball'"):
        plan_colorways(copy, sheet, {"ball": [9]})
    with pytest.raises(DataError, match=r"line 3: there is no object 'lid'.*ball, block"):
        plan_colorways(Project(copy.folder), write_sheet(tmp_path, SHEET.replace("block,,70", "lid,,70")))
