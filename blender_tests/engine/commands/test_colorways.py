"""Colorways times views, through the command line: named pictures, a table before and after, and going on."""

import csv
import shutil
from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("scipy")

import karf_engine as karf
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.capture import View
from karf_engine.cli import main
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.io.images import read_photo
from karf_engine.palettes.calibration import ReferenceLight
from karf_engine.palettes.colorways import plan_colorways
from karf_engine.palettes.palette import hex_to_rgb, rgb_to_hex, write_edit
from karf_engine.project import Project

SHEET = """colorway,object,hex,lab
Green,ball,#1ec040,
Green,block,,70 10 60
Violet,ball,,60 90 -90
Grey / matt,block,#808080,
"""
FOLDERS = ["Green", "Grey _ matt", "Violet"]


@pytest.fixture
def sheet(tmp_path):
    path = tmp_path / "sheet.csv"
    path.write_text(SHEET)
    return path


@pytest.fixture
def rendered(learned, sheet, tmp_path):
    """The sheet in the two held-out views."""
    assert main(command(learned.project, sheet, tmp_path / "out")) == 0
    return tmp_path / "out"


def command(project, sheet, out, *more, views="test"):
    options = ["--sheet", sheet, "--views", views, "--out", out, "--threads", 1, *more]
    return ["colorways", *map(str, (project, *options))]


def table(out):
    with (out / "colorways.csv").open(newline="") as stream:
        return {(row["colorway"], row["object"]): row for row in csv.DictReader(stream)}


def times(out):
    return {path.relative_to(out): path.stat().st_mtime_ns for path in out.rglob("test_*.png")}


def test_the_table_is_there_before_anything_is_rendered(learned, sheet, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(command(learned.project, sheet, out, "--predict-only")) == 0
    assert [path.name for path in out.iterdir()] == ["colorways.csv"]
    rows = table(out)
    assert len(rows) == 4 and not any(row["reached"] for row in rows.values())
    assert float(rows["Violet", "ball"]["predicted_ciede2000"]) > 3
    assert "no sRGB picture" in rows["Violet", "ball"]["cannot_be_reached_because"]
    assert "Violet, ball: cannot be reached, because no sRGB picture" in capsys.readouterr().err


def test_every_colorway_is_a_folder_of_all_views(rendered, learned):
    assert sorted(path.name for path in rendered.iterdir() if path.is_dir()) == FOLDERS
    for folder in FOLDERS:
        assert sorted(path.name for path in (rendered / folder).iterdir()) == ["test_r_0.png", "test_r_1.png"]
    model = karf.load(learned.project, device="cpu")
    for planned in plan_colorways(model.project, rendered.parent / "sheet.csv"):
        expected = model.recolor(model.capture.view("test_r_0"), planned.edit)[..., :3]
        written = read_photo(rendered / planned.colorway.folder / "test_r_0.png")
        np.testing.assert_allclose(written, expected, atol=0.51 / 255)


def test_an_edit_is_a_colorway_too_whatever_is_locked(learned, tmp_path):
    model = karf.load(learned.project, device="cpu")
    edit = model.edit()
    for colors in edit.colors.values():
        colors[1:] = 0.3
    write_edit(tmp_path / "edits" / "gray.json", edit)
    sheet = tmp_path / "looks.json"
    sheet.write_text('[{"colorway": "Gray", "edit": "edits/gray.json"}]')
    assert main(command(learned.project, sheet, tmp_path / "out", views="test_r_0")) == 0
    written = read_photo(tmp_path / "out" / "Gray" / "test_r_0.png")
    expected = model.recolor(model.capture.view("test_r_0"), edit)[..., :3]
    np.testing.assert_allclose(written, expected, atol=0.51 / 255)
    (planned,) = plan_colorways(model.project, sheet, {model.objects[0]: [1]})
    assert not planned.predictions and (planned.edit.colors[model.objects[0]][1] == np.float32(0.3)).all()
    assert (tmp_path / "out" / "contact_sheet.png").exists()


def test_what_is_measured_in_the_pictures_is_what_was_predicted(rendered):
    for row in table(rendered).values():
        assert int(row["views"]) == 2 and int(row["pixels"]) > 5
        # the objects of this hasty project are at most nine tenths sure
        assert abs(float(row["reached_ciede2000"]) - float(row["predicted_ciede2000"])) < 5


def test_each_view_says_what_was_reached_in_it_and_why_not_closer(rendered):
    with (rendered / "views.csv").open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [(row["colorway"], row["object"], row["view"]) for row in rows[:3]] == [
        ("Green", "ball", "test_r_0"),
        ("Green", "ball", "test_r_1"),
        ("Green", "block", "test_r_0"),
    ]
    assert len(rows) == 4 * 2
    for key, row in table(rendered).items():
        own = [each for each in rows if (each["colorway"], each["object"]) == key]
        assert sum(int(each["pixels"]) for each in own) == int(row["pixels"])
        for each in own:
            is_missed = float(each["reached_ciede2000"]) > 2
            assert bool(each["cannot_be_reached_because"]) == is_missed
    violet = [row for row in rows if row["colorway"] == "Violet"]
    assert all("no sRGB picture" in row["cannot_be_reached_because"] for row in violet)


def test_the_contact_sheet_shows_colorways_as_rows(rendered):
    height, width, _ = read_photo(rendered / "contact_sheet.png").shape
    assert height > 3 * 192 and width > 2 * 192


def test_finished_pictures_are_kept_and_a_changed_color_is_made_anew(rendered, learned, sheet):
    before = times(rendered)
    sheet.write_text(SHEET.replace("#808080", "#707070"))
    (rendered / "Green" / "test_r_1.png").unlink()
    (rendered / "Violet" / "test_r_0.png").write_bytes(b"cut off")
    assert main(command(learned.project, sheet, rendered)) == 0
    anew = {str(path) for path, time in times(rendered).items() if before[path] != time}
    assert anew == {
        "Green/test_r_1.png",
        "Violet/test_r_0.png",
        "Grey _ matt/test_r_0.png",
        "Grey _ matt/test_r_1.png",
    }
    assert table(rendered)["Green", "ball"]["views"] == "2"


def test_a_cancelled_job_goes_on_where_it_stopped(learned, sheet, tmp_path):
    out, asked = tmp_path / "out", []

    def stop_after_a_while():
        asked.append(None)
        return len(asked) > 3

    with pytest.raises(Cancelled):
        karf.colorways(
            learned.project, sheet, out, views="test", threads=1, device="cpu", should_stop=stop_after_a_while
        )
    finished = times(out)
    assert 0 < len(finished) < 6
    karf.colorways(learned.project, sheet, out, views="test", threads=1, device="cpu")
    assert len(times(out)) == 6 and finished.items() <= times(out).items()


def test_any_camera_shows_the_colorways_too(learned, sheet, tmp_path):
    camera = camera_at(1.0, 0.5, size=24)
    write_cameras(tmp_path / "path.json", [View(f"frame_{i}", f"frame_{i}", camera, None, "train") for i in range(2)])
    assert main(command(learned.project, sheet, tmp_path / "out", views=str(tmp_path / "path.json"))) == 0
    assert sorted(path.name for path in (tmp_path / "out" / "Green").iterdir()) == ["frame_0.png", "frame_1.png"]


def test_with_a_gray_card_wanted_and_reached_are_told_under_daylight(learned, sheet, tmp_path):
    sheet.write_text("colorway,object,hex\nBrown,block,#806050\n")
    card = "#a08060"
    assert main(command(learned.project, sheet, tmp_path / "out", "--card", card)) == 0
    light = ReferenceLight.of_card(hex_to_rgb(card))
    seen = rgb_to_hex(light.photographed(hex_to_rgb("#806050")))
    sheet.write_text(f"colorway,object,hex\nBrown,block,{seen}\n")
    assert main(command(learned.project, sheet, tmp_path / "seen")) == 0
    named, shown = (table(tmp_path / folder)["Brown", "block"] for folder in ("out", "seen"))
    assert (named["wanted"], shown["wanted"]) == ("#806050", seen)
    for column in ("predicted", "reached"):
        under = hex_to_rgb(named[column])
        np.testing.assert_allclose(light.photographed(under), hex_to_rgb(shown[column]), atol=3 / 255)
        left = ciede2000(srgb_to_lab(under), srgb_to_lab(hex_to_rgb("#806050")))
        assert float(named[f"{column}_ciede2000"]) == pytest.approx(left, abs=0.6)  # of colors rounded to 8 bits
    with (tmp_path / "out" / "views.csv").open(newline="") as stream:
        assert {row["wanted"] for row in csv.DictReader(stream)} == {"#806050"}


def test_an_unknown_object_is_named_with_its_line(learned, sheet, tmp_path):
    sheet.write_text(SHEET.replace("block,,70", "lid,,70"))
    with pytest.raises(DataError, match=r"line 3: there is no object 'lid'.*ball, block"):
        plan_colorways(Project(learned.project), sheet)


def test_a_locked_swatch_stays(learned, sheet):
    free, _, _ = plan_colorways(Project(learned.project), sheet)
    kept, _, _ = plan_colorways(Project(learned.project), sheet, {"ball": [1]})
    learned_colors = {p.name: p.colors for p in karf.load(learned.project, device="cpu").palettes}["ball"]
    assert np.array_equal(kept.edit.colors["ball"][1], learned_colors[1])
    assert not np.array_equal(free.edit.colors["ball"][1], learned_colors[1])
    with pytest.raises(BadRequest, match="no swatch 9 of 'ball'"):
        plan_colorways(Project(learned.project), sheet, {"ball": [9]})


def test_predicting_needs_no_tensors(learned, sheet, tmp_path):
    project = Project(shutil.copytree(learned.project, tmp_path / "project"))
    for path in project.folder.glob("*.safetensors"):
        path.unlink()
    assert len(plan_colorways(project, sheet)) == 3


def test_colorways_have_the_edges_of_an_edit(learned, sheet, tmp_path):
    model = karf.load(learned.project, device="cpu")
    edges = tmp_path / "edges.json"
    write_edit(edges, model.edit().edge("ball", choke=3, feather=4))
    out = tmp_path / "out"
    assert main(command(learned.project, sheet, out, "--edges", edges, views="test_r_0")) == 0
    planned = {plan.colorway.name: plan.edit for plan in plan_colorways(model.project, sheet)}
    plain, shaped = planned["Green"], model.edit().edge("ball", choke=3, feather=4).edges
    view, written = model.capture.view("test_r_0"), read_photo(out / "Green" / "test_r_0.png")
    np.testing.assert_allclose(written, model.recolor(view, replace(plain, edges=shaped)), atol=0.51 / 255)
    assert np.abs(written - model.recolor(view, plain)).max() > 0.1
