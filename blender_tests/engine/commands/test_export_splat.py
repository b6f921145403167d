"""Export of splats with an edit baked in: everything else keeps its bits, in every file format."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.conftest import finish_again
from karf_engine.cli import main
from karf_engine.commands import export_splat
from karf_engine.errors import BadRequest, DataError
from karf_engine.project import Project
from karf_engine.splats.files import load_gaussians
from karf_engine.splats.formats import ply
from karf_engine.splats.formats.registry import read_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.kernels.arrays import COLOR


@pytest.fixture(scope="module")
def own(learned):
    return load_gaussians(Project(learned.project).splats_file)


@pytest.fixture(scope="module")
def ball_share(model):
    """Each Gaussian's probability of belonging to the ball."""
    return model.splatted.shares[:, model.objects.index("ball")]


@pytest.fixture
def edit_file(model, tmp_path):
    """The ball's second swatch becomes blue."""
    edit = model.edit()
    edit.colors["ball"][1] = (0.1, 0.2, 0.9)
    karf.write_edit(tmp_path / "edit.json", edit)
    return tmp_path / "edit.json"


@pytest.fixture
def exported(learned, tmp_path):
    """Export the learned splats; returns the file's content."""

    def exported(name="scene.ply", **options):
        karf.export_splat(learned.project, tmp_path / name, **options)
        return read_splats(tmp_path / name)

    return exported


def test_unchanged_export_keeps_every_bit(exported, model, own, tmp_path):
    found = exported()
    assert_array_equal(found.table, own.table)
    assert found.is_antialiased and not found.columns
    karf.write_edit(tmp_path / "none.json", model.edit())
    exported("same.ply", edit=tmp_path / "none.json")
    assert (tmp_path / "same.ply").read_bytes() == (tmp_path / "scene.ply").read_bytes()


def test_edit_changes_only_colors_of_its_object(exported, own, ball_share, edit_file):
    table = exported(edit=edit_file).table
    rows = (table != own.table).any(1)
    assert rows.any() and not rows[ball_share == 0].any()
    assert_array_equal(table[:, :COLOR], own.table[:, :COLOR])


@pytest.mark.parametrize("name", ["scene.compressed.ply", "scene.spz", "scene.glb", "scene.gltf", "scene.usdc"])
def test_other_formats_hold_the_same_scene(exported, edit_file, name):
    wanted, found = exported(edit=edit_file).table, exported(name, edit=edit_file).table
    assert len(found) == len(wanted)
    assert_allclose(np.median(found[:, :3], 0), np.median(wanted[:, :3], 0), atol=0.02)
    assert_allclose(found[:, COLOR : COLOR + 3].mean(0), wanted[:, COLOR : COLOR + 3].mean(0), atol=0.05)


def test_export_cuts_out_objects_or_omits_the_background(exported, own, ball_share):
    assert 0 < (ball_share > 0.5).sum() < own.n_foreground
    assert_array_equal(exported(objects=["ball"]).table, own.table[ball_share > 0.5])
    assert_array_equal(exported(solid=True).table, own.table[: own.n_foreground])


def test_attributes_name_the_object_of_each_gaussian(exported, model, ball_share):
    columns = exported(attributes=True).columns
    longest = max(len(palette.colors) for palette in model.palettes)
    assert set(columns) == {"karf_object", "karf_probability", *(f"karf_weight_{n}" for n in range(longest))}
    number = 1 + model.objects.index("ball")
    is_ball = (ball_share > 0.5) & (model.splatted.shares.argmax(1) == number - 1)
    assert_array_equal(columns["karf_object"] == number, is_ball)
    weights = np.stack([columns[f"karf_weight_{n}"] for n in range(longest)], 1)
    assert_allclose(weights[columns["karf_object"] > 0].sum(1), 1, atol=1e-5)
    assert not weights[columns["karf_object"] == 0].any()


def test_sheet_writes_a_file_per_colorway(learned, ball_share, tmp_path):
    (tmp_path / "sheet.csv").write_text("colorway,object,hex\nsea,ball,#1040d0\nrust,ball,#b04010\n")
    karf.export_splat(learned.project, tmp_path / "scene.ply", sheet=tmp_path / "sheet.csv")
    tables = [read_splats(tmp_path / f"scene_{name}.ply").table for name in ("sea", "rust")]
    assert not (tmp_path / "scene.ply").exists()
    sea, rust = (table[ball_share > 0.5, COLOR : COLOR + 3].mean(0) for table in tables)
    assert sea[2] > rust[2] and sea[0] < rust[0]


def test_matrix_transforms_every_gaussian(exported, own):
    matrix = np.diag([2.0, 2, 2, 1])
    matrix[:3, 3] = 1, 2, 3
    table = exported(matrix=tuple(matrix.ravel())).table
    assert_allclose(table[:, :3], 2 * own.table[:, :3] + (1, 2, 3), rtol=1e-5, atol=1e-5)
    assert_allclose(table[:, 3:6], own.table[:, 3:6] + np.log(2), atol=1e-5)


@pytest.fixture(scope="module")
def foreign(tmp_path_factory, own, still_life):
    """A project of another program's splat, with extra columns, masked in the photos."""
    folder = tmp_path_factory.mktemp("foreign")
    numbers = np.arange(len(own))
    columns = {"confidence": numbers.astype(np.float64), "flags": (numbers % 7).astype(np.uint8)}
    ply.write(folder / "theirs.ply", SplatFile(own.table, None, columns))
    karf.import_splat(folder / "theirs.ply", folder / "capture", photos=still_life.capture)
    command = replace(still_life, capture=folder / "capture").command(folder / "project", "recoloring.iterations=10")
    assert main(command) == 0
    return folder


def test_foreign_splat_changes_only_where_recolored(foreign, tmp_path):
    theirs, back, recolored = foreign / "theirs.ply", tmp_path / "back.ply", tmp_path / "recolored.ply"
    karf.export_splat(foreign / "project", back)
    assert back.read_bytes() == theirs.read_bytes()
    edit = karf.load(foreign / "project", "cpu").edit()
    edit.colors["ball"][1:] = edit.colors["ball"][1:] * 0.5 + 0.2
    karf.write_edit(tmp_path / "edit.json", edit)
    karf.export_splat(foreign / "project", recolored, edit=tmp_path / "edit.json")
    before, after = read_splats(theirs), read_splats(recolored)
    assert 0 < (after.table != before.table).any(1).mean() < 1
    assert_array_equal(after.table[:, :COLOR], before.table[:, :COLOR])
    assert after.columns.keys() == before.columns.keys()
    for name, column in before.columns.items():
        assert_array_equal(after.columns[name], column, strict=True)


@pytest.fixture
def changeable(foreign, tmp_path):
    """A copy of the foreign project, which is moved away, and the copy's splat file."""
    shutil.copytree(foreign, tmp_path / "foreign")
    aside = foreign.rename(foreign.with_name("aside"))
    yield tmp_path / "foreign" / "project", tmp_path / "foreign" / "capture" / "splat.ply"
    aside.rename(foreign)


@pytest.mark.parametrize("kept", [slice(None, None, -1), slice(-5), None], ids=["reordered", "fewer", "missing"])
def test_changed_source_is_rejected_until_splats_are_learned_again(changeable, own, tmp_path, kept):
    project, source = changeable
    found, back, is_missing = ply.read(source), tmp_path / "back.ply", kept is None
    source.unlink()
    if not is_missing:
        table = np.ascontiguousarray(found.table[kept])
        columns = {name: column[: len(table)] for name, column in found.columns.items()}
        ply.write(source, SplatFile(table, None, columns))
    message = "from which the splats come, is missing" if is_missing else r"splat\.ply has been changed since"
    for options in ({}, {"objects": ["ball"]}):
        with pytest.raises(DataError, match=message) as caught:
            karf.export_splat(project, back, **options)
        assert (is_missing or "again" in caught.value.hint) and not back.exists()
    karf.export_splat(project, tmp_path / "back.glb")  # has no columns
    assert_array_equal(read_splats(tmp_path / "back.glb").table[:, :3], own.table[:, :3])
    if not is_missing:
        karf.learn_splats(project, threads=1)
        karf.export_splat(project, back)
        assert back.read_bytes() == source.read_bytes()


def test_cut_out_keeps_columns_and_clears_earlier_weights(changeable, tmp_path):
    project, source = changeable
    found = ply.read(source)
    earlier = {"karf_weight_99": np.ones(len(found), np.float32)}
    ply.write(source, SplatFile(found.table, None, found.columns | earlier))
    karf.export_splat(project, tmp_path / "back.ply", attributes=True, objects=["ball"])
    columns = read_splats(tmp_path / "back.ply").columns
    assert not columns["karf_weight_99"].any() and columns["karf_weight_0"].any() + columns["karf_weight_1"].any()
    assert columns["karf_object"].any() and (columns["flags"] == columns["confidence"] % 7).all()


def test_erased_rows_are_left_out_with_their_columns_and_come_back(changeable, own, tmp_path):
    project, source = changeable
    kept = ~((own.table[:, :3] > (0, -9, -9)) & (own.table[:, :3] < (18, 9, 9))).all(1)
    karf.erase_splats(project, boxes=[(9, 0, 0, 9, 0, 9, 0, 0, 0, 0, 9, 0, 0, 0, 0, 1)])
    for options in ({}, {"attributes": True}):
        karf.export_splat(project, tmp_path / "half.ply", **options)
        found = read_splats(tmp_path / "half.ply")
        assert_array_equal(found.table, own.table[kept])
        assert_array_equal(found.columns["confidence"], np.flatnonzero(kept))
    karf.erase_splats(project, restore=True)
    karf.export_splat(project, tmp_path / "back.ply")
    assert (tmp_path / "back.ply").read_bytes() == source.read_bytes()


def test_unusable_rows_and_filters_come_back_byte_by_byte(changeable, own, tmp_path):
    project, source = changeable
    table = own.table.copy()
    table[[3, 8], 0] = np.nan
    ply.write(source, SplatFile(table, None, {"filter_3D": np.full(len(table), 0.01, np.float32)}))
    events = Events()
    karf.learn_splats(project, threads=1, emit=events)
    assert any(f"2 of {len(table)} rows are no Gaussians" in str(text) for text in events.values("warning", "sentence"))
    karf.export_splat(project, tmp_path / "back.ply")
    assert (tmp_path / "back.ply").read_bytes() == source.read_bytes()
    karf.export_splat(project, tmp_path / "ball.ply", objects=["ball"])
    cut, whole = read_splats(tmp_path / "ball.ply"), read_splats(source)
    assert "filter_3D" not in cut.columns, "its scales already have it"
    assert set(map(bytes, cut.table)) <= set(map(bytes, whole.table))


def test_object_without_gaussians_is_rejected(learned, tmp_path, monkeypatch):
    monkeypatch.setattr(export_splat, "MIN_PROBABILITY", 1.1)
    with pytest.raises(BadRequest, match="No Gaussian is of 'ball'"):
        karf.export_splat(learned.project, tmp_path / "ball.compressed.ply", objects=["ball"])
    assert not (tmp_path / "ball.compressed.ply").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"out": "scene.obj"}, "none of the ends"),
        ({"out": "scene.splat"}, "none of the ends"),
        ({"objects": ["vase"]}, "no object 'vase'"),
        ({"out": "scene.spz", "attributes": True}, "no attributes"),
        ({"matrix": (1.0,) * 16}, "uniform scale"),
        ({"edit": "a.json", "sheet": "b.csv"}, "both"),
    ],
    ids=str,
)
def test_impossible_export_is_rejected(learned, tmp_path, options, message):
    out = tmp_path / options.get("out", "scene.ply")
    with pytest.raises(BadRequest, match=message) as caught:
        karf.export_splat(learned.project, **options | {"out": out})
    assert caught.value.hint and not out.exists()


def test_project_without_splats_names_the_missing_stage(copy, tmp_path):
    finish_again(copy.folder, "geometry")
    with pytest.raises(BadRequest, match="splats"):
        karf.export_splat(copy.folder, tmp_path / "scene.ply")
