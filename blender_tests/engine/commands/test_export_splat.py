"""Splats go out with an edit baked in: what it does not reach keeps its bits, whatever the kind of file."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")
pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.splats.formats.files import write_text
from karf_engine.cli import main
from karf_engine.commands import export_splat
from karf_engine.errors import BadRequest, DataError
from karf_engine.project import Project
from karf_engine.splats.files import load_gaussians
from karf_engine.splats.formats import ply
from karf_engine.splats.formats.registry import read_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.kernels.arrays import COLOR

QUICK = ["geometry.long_side=32", 'geometry.levels=[{"voxels": 24, "iterations": 20, "step": 1.0}]']


@pytest.fixture(scope="module")
def model(learned):
    return karf.load(learned.project, "cpu")


@pytest.fixture(scope="module")
def own(learned):
    return load_gaussians(Project(learned.project).splats_file)


@pytest.fixture
def edit_file(model, tmp_path):
    """The ball's second swatch becomes blue."""
    edit = model.edit()
    edit.colors["ball"][1] = (0.1, 0.2, 0.9)
    karf.write_edit(tmp_path / "edit.json", edit)
    return tmp_path / "edit.json"


def changed_rows(table, before):
    return (table != before).any(1)


def test_as_learned_every_bit_leaves(learned, own, tmp_path):
    karf.export_splat(learned.project, tmp_path / "scene.ply")
    found = read_splats(tmp_path / "scene.ply")
    assert_array_equal(found.table, own.table)
    assert found.is_antialiased and not found.columns


def test_an_edit_that_changes_nothing_gives_the_same_bytes(learned, model, tmp_path):
    karf.write_edit(tmp_path / "none.json", model.edit())
    karf.export_splat(learned.project, tmp_path / "scene.ply")
    karf.export_splat(learned.project, tmp_path / "same.ply", edit=tmp_path / "none.json")
    assert (tmp_path / "same.ply").read_bytes() == (tmp_path / "scene.ply").read_bytes()


def test_an_edit_reaches_the_colors_of_its_object_alone(learned, model, own, edit_file, tmp_path):
    karf.export_splat(learned.project, tmp_path / "blue.ply", edit=edit_file)
    table = read_splats(tmp_path / "blue.ply").table
    rows = changed_rows(table, own.table)
    of_ball = model.splatted.shares[:, model.objects.index("ball")] > 0
    assert rows.any() and not rows[~of_ball].any()
    assert_array_equal(table[:, :COLOR], own.table[:, :COLOR])


@pytest.mark.parametrize("name", ["scene.compressed.ply", "scene.spz", "scene.glb", "scene.gltf", "scene.usdc"])
def test_other_kinds_of_files_hold_the_same_scene(learned, own, edit_file, tmp_path, name):
    karf.export_splat(learned.project, tmp_path / "scene.ply", edit=edit_file)
    karf.export_splat(learned.project, tmp_path / name, edit=edit_file)
    wanted, found = read_splats(tmp_path / "scene.ply").table, read_splats(tmp_path / name).table
    assert len(found) == len(wanted)
    assert_allclose(np.median(found[:, :3], 0), np.median(wanted[:, :3], 0), atol=0.02)
    assert_allclose(found[:, COLOR : COLOR + 3].mean(0), wanted[:, COLOR : COLOR + 3].mean(0), atol=0.05)


def test_an_object_is_cut_out(learned, model, own, tmp_path):
    karf.export_splat(learned.project, tmp_path / "ball.ply", objects=["ball"])
    table = read_splats(tmp_path / "ball.ply").table
    mine = model.splatted.shares[:, model.objects.index("ball")] > 0.5
    assert 0 < mine.sum() < own.n_foreground
    assert_array_equal(table, own.table[mine])


def test_the_shell_behind_the_scene_can_be_left_out(learned, own, tmp_path):
    karf.export_splat(learned.project, tmp_path / "solid.ply", solid=True)
    assert_array_equal(read_splats(tmp_path / "solid.ply").table, own.table[: own.n_foreground])


def test_attributes_say_what_each_gaussian_is_of(learned, model, own, tmp_path):
    karf.export_splat(learned.project, tmp_path / "told.ply", attributes=True)
    columns = read_splats(tmp_path / "told.ply").columns
    longest = max(len(palette.colors) for palette in model.palettes)
    assert set(columns) == {"karf_object", "karf_probability", *(f"karf_weight_{n}" for n in range(longest))}
    number = 1 + model.objects.index("ball")
    mine = model.splatted.shares[:, number - 1] > 0.5
    assert_array_equal(columns["karf_object"] == number, mine & (model.splatted.shares.argmax(1) == number - 1))
    weights = np.stack([columns[f"karf_weight_{n}"] for n in range(longest)], 1)
    assert_allclose(weights[columns["karf_object"] > 0].sum(1), 1, atol=1e-5)
    assert not weights[columns["karf_object"] == 0].any()


def test_a_sheet_gives_a_file_for_each_colorway(learned, model, tmp_path):
    (tmp_path / "sheet.csv").write_text("colorway,object,hex\nsea,ball,#1040d0\nrust,ball,#b04010\n")
    karf.export_splat(learned.project, tmp_path / "scene.ply", sheet=tmp_path / "sheet.csv")
    tables = [read_splats(tmp_path / f"scene_{name}.ply").table for name in ("sea", "rust")]
    assert not (tmp_path / "scene.ply").exists()
    rows = model.splatted.shares[:, model.objects.index("ball")] > 0.5
    sea, rust = (table[rows, COLOR : COLOR + 3].mean(0) for table in tables)
    assert sea[2] > rust[2] and sea[0] < rust[0]


def test_a_matrix_moves_it_all(learned, own, tmp_path):
    matrix = np.diag([2.0, 2, 2, 1])
    matrix[:3, 3] = 1, 2, 3
    karf.export_splat(learned.project, tmp_path / "moved.ply", matrix=tuple(matrix.ravel()))
    table = read_splats(tmp_path / "moved.ply").table
    assert_allclose(table[:, :3], 2 * own.table[:, :3] + (1, 2, 3), rtol=1e-5, atol=1e-5)
    assert_allclose(table[:, 3:6], own.table[:, 3:6] + np.log(2), atol=1e-5)


# ------------------------------------------------------------------------------------------------- splats of others
@pytest.fixture(scope="module")
def foreign(tmp_path_factory, own, still_life):
    """A project of a splat that another program wrote, with columns of its own, marked in the photos."""
    folder = tmp_path_factory.mktemp("foreign")
    columns = {"confidence": np.arange(len(own), dtype=np.float64), "flags": (np.arange(len(own)) % 7).astype(np.uint8)}
    ply.write(folder / "theirs.ply", SplatFile(own.table, None, columns))
    karf.import_splat(folder / "theirs.ply", folder / "capture", photos=still_life.capture)
    project = folder / "project"
    assert main(replace(still_life, capture=folder / "capture").command(project)) == 0
    return folder


def test_a_splat_of_others_comes_back_byte_by_byte(foreign, tmp_path):
    karf.export_splat(foreign / "project", tmp_path / "back.ply")
    assert (tmp_path / "back.ply").read_bytes() == (foreign / "theirs.ply").read_bytes()


def test_recolored_it_keeps_every_byte_of_the_other_rows_and_columns(foreign, tmp_path):
    model = karf.load(foreign / "project", "cpu")
    edit = model.edit()
    edit.colors["ball"][1:] = edit.colors["ball"][1:] * 0.5 + 0.2
    karf.write_edit(tmp_path / "edit.json", edit)
    karf.export_splat(foreign / "project", tmp_path / "back.ply", edit=tmp_path / "edit.json")
    before, after = read_splats(foreign / "theirs.ply"), read_splats(tmp_path / "back.ply")
    rows = changed_rows(after.table, before.table)
    assert 0 < rows.mean() < 1
    assert_array_equal(after.table[:, :COLOR], before.table[:, :COLOR])
    assert after.columns.keys() == before.columns.keys()
    for name, column in before.columns.items():
        assert_array_equal(after.columns[name], column)
        assert after.columns[name].dtype == column.dtype


@pytest.fixture
def changeable(foreign, tmp_path):
    """That project in another folder, with nothing where it was: its files may be changed."""
    shutil.copytree(foreign, tmp_path / "foreign")
    aside = foreign.rename(foreign.with_name("aside"))
    yield tmp_path / "foreign"
    aside.rename(foreign)


def test_a_file_of_text_comes_back_as_numbers(changeable, own, tmp_path):
    source = changeable / "capture" / "splat.ply"
    write_text(source, own.table)
    karf.learn_splats(changeable / "project", threads=1)
    karf.export_splat(changeable / "project", tmp_path / "back.ply")
    assert b"format binary" in (tmp_path / "back.ply").read_bytes()[:100]
    assert_array_equal(read_splats(tmp_path / "back.ply").table, own.table)


def test_a_cut_out_of_it_keeps_its_columns_too(foreign, tmp_path):
    karf.export_splat(foreign / "project", tmp_path / "ball.ply", objects=["ball"], attributes=True)
    columns = read_splats(tmp_path / "ball.ply").columns
    assert {"confidence", "flags", "karf_object"} <= set(columns)
    assert (columns["flags"] == columns["confidence"] % 7).all()


@pytest.mark.parametrize(
    "changed",
    [lambda found: found.table[::-1], lambda found: found.table[:-5]],
    ids=["another order", "fewer"],
)
def test_a_file_that_has_changed_since_gives_its_columns_to_no_row(changeable, own, tmp_path, changed):
    source = changeable / "capture" / "splat.ply"
    found = ply.read(source)
    table = changed(found)
    columns = {name: column[: len(table)] for name, column in found.columns.items()}
    ply.write(source, SplatFile(np.ascontiguousarray(table), None, columns))
    for options in ({}, {"objects": ["ball"]}):
        with pytest.raises(DataError, match=r"splat\.ply has been changed since") as caught:
            karf.export_splat(changeable / "project", tmp_path / "back.ply", **options)
        assert "again" in caught.value.hint and not (tmp_path / "back.ply").exists()
    karf.export_splat(changeable / "project", tmp_path / "back.glb")
    assert_array_equal(read_splats(tmp_path / "back.glb").table[:, :3], own.table[:, :3])
    karf.learn_splats(changeable / "project", threads=1)
    karf.export_splat(changeable / "project", tmp_path / "back.ply")
    assert (tmp_path / "back.ply").read_bytes() == source.read_bytes()


def test_where_the_file_is_missing_other_kinds_are_written(changeable, own, tmp_path):
    (changeable / "capture" / "splat.ply").unlink()
    with pytest.raises(DataError, match=r"splat\.ply, from which the splats come, is missing"):
        karf.export_splat(changeable / "project", tmp_path / "back.ply")
    karf.export_splat(changeable / "project", tmp_path / "back.glb")
    assert len(read_splats(tmp_path / "back.glb")) == len(own)


@pytest.mark.parametrize("options", [{}, {"objects": ["ball"]}], ids=["whole", "cut out"])
def test_weights_of_an_earlier_export_with_more_colors_do_not_stay(changeable, tmp_path, options):
    source = changeable / "capture" / "splat.ply"
    found = ply.read(source)
    earlier = {"karf_weight_99": np.ones(len(found), np.float32)}
    ply.write(source, SplatFile(found.table, None, {**found.columns, **earlier}))
    karf.export_splat(changeable / "project", tmp_path / "back.ply", attributes=True, **options)
    columns = read_splats(tmp_path / "back.ply").columns
    assert not columns["karf_weight_99"].any() and columns["karf_weight_0"].any() + columns["karf_weight_1"].any()
    assert "confidence" in columns


# ------------------------------------------------------------------------------------------------------- what is refused
def test_an_object_of_which_there_is_no_gaussian_is_named(learned, tmp_path, monkeypatch):
    monkeypatch.setattr(export_splat, "MIN_PROBABILITY", 1.1)
    with pytest.raises(BadRequest, match="No Gaussian is of 'ball'"):
        karf.export_splat(learned.project, tmp_path / "ball.compressed.ply", objects=["ball"])
    assert not (tmp_path / "ball.compressed.ply").exists()


@pytest.mark.parametrize(
    ("options", "says"),
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
def test_what_cannot_be_written_so_is_refused(learned, tmp_path, options, says):
    out = tmp_path / options.pop("out", "scene.ply")
    with pytest.raises(BadRequest, match=says) as caught:
        karf.export_splat(learned.project, out, **options)
    assert caught.value.hint and not out.exists()


def test_a_project_without_splats_says_what_to_run(tmp_path, still_life):
    karf.learn_geometry(still_life.capture, project=tmp_path / "project", overrides=QUICK, threads=1, device="cpu")
    with pytest.raises(BadRequest, match="splats"):
        karf.export_splat(tmp_path / "project", tmp_path / "scene.ply")
