"""A splat of another program becomes a capture: with photos, or with views of itself; it is shown as it came."""

import json
import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")
pytest.importorskip("numba")

import karf_engine as karf
from karf_engine.capture import open_capture, write_cameras
from karf_engine.errors import BadRequest, Cancelled, DataError
from karf_engine.io.images import alpha_composite, read_photo
from karf_engine.metrics.images import psnr
from karf_engine.project import Project
from karf_engine.splats import fit
from karf_engine.splats.files import load_gaussians
from karf_engine.splats.formats.registry import read_splats, write_splats
from karf_engine.splats.formats.splat_file import SplatFile
from karf_engine.splats.kernels.arrays import ANTIALIASED_FILTER, PLAIN_FILTER
from karf_engine.splats.rasterizer import rasterize

SMALL = {"views": 6, "size": 64, "up": "z"}


@pytest.fixture(scope="module")
def table(learned):
    """The still life's own splats."""
    return load_gaussians(Project(learned.project).splats_file).table


@pytest.fixture
def splat(tmp_path, table):
    write_splats(tmp_path / "still.ply", SplatFile(table))
    return tmp_path / "still.ply"


def test_without_photos_its_views_show_it_from_around(splat, table, tmp_path):
    karf.import_splat(splat, tmp_path / "capture", **SMALL)
    capture = open_capture(tmp_path / "capture")
    assert len(capture.views) == 6 and capture.warnings == ()
    assert_array_equal((tmp_path / "capture" / "splat.ply").read_bytes(), splat.read_bytes())
    middle = np.median(table[:, :3], 0)
    for view in capture.views:
        assert (view.camera.width, view.camera.height) == (64, 64)
        pixels, depth = view.camera.project(middle[None])
        assert depth > 0 and np.abs(pixels - 32).max() < 32
        photo = read_photo(view.image)
        assert photo.std() > 0.02, f"{view.name} shows nothing"


@pytest.mark.parametrize("name", ["still.gltf", "still.glb", "still.spz", "still.compressed.ply"])
def test_other_kinds_of_files_are_imported_whole(table, tmp_path, name):
    """A .gltf lies in two files, of which the capture keeps what they hold."""
    write_splats(tmp_path / "theirs" / name, SplatFile(table))
    karf.import_splat(tmp_path / "theirs" / name, tmp_path / "capture", **SMALL)
    shutil.rmtree(tmp_path / "theirs")
    assert len(read_splats(open_capture(tmp_path / "capture").splats.path)) == len(table)


def test_what_stands_in_the_void_gets_alpha(splat, tmp_path):
    karf.import_splat(splat, tmp_path / "capture", **SMALL)
    photo = read_photo(open_capture(tmp_path / "capture").views[0].image)
    assert photo.shape[2] == 4 and photo[0, 0, 3] == 0 and photo[..., 3].max() == 1


def test_views_of_ones_own_come_first(splat, tmp_path, still_life):
    own = karf.open_capture(still_life.capture).views[:2]
    write_cameras(tmp_path / "own.json", own)
    karf.import_splat(splat, tmp_path / "capture", **SMALL, cameras=tmp_path / "own.json")
    views = open_capture(tmp_path / "capture").views
    assert len(views) == 8
    assert_allclose(views[0].camera.camera_to_world, own[0].camera.camera_to_world)
    shown = read_photo(views[0].image)
    assert psnr(alpha_composite(shown[..., :3], shown[..., 3], 0), alpha_composite(*color_and_alpha(own[0]), 0)) > 20


def color_and_alpha(view):
    photo = read_photo(view.image)
    return photo[..., :3], photo[..., 3] if photo.shape[2] == 4 else None


def test_the_cameras_that_were_written_beside_it_are_taken(splat, tmp_path):
    entry = {"width": 128, "height": 64, "fx": 100, "fy": 100, "rotation": np.diag([1.0, -1, -1]).tolist()}
    content = [entry | {"position": [0, 0, 4 + number / 10]} for number in range(9)]
    (tmp_path / "cameras.json").write_text(json.dumps(content))
    karf.import_splat(splat, tmp_path / "capture", **SMALL)
    cameras = [view.camera for view in open_capture(tmp_path / "capture").views]
    assert len(cameras) == 6 and {(camera.width, camera.height) for camera in cameras} == {(64, 32)}
    assert_allclose([cameras[0].position, cameras[-1].position], [[0, 0, 4], [0, 0, 4.8]])


def warnings_of(splat, out, **options):
    """What an import warns of, by its code."""
    found = {}

    def emit(event_kind, **event):
        if event_kind == "warning":
            found[event["code"]] = event["sentence"]

    karf.import_splat(splat, out, **options, emit=emit)
    return found


@pytest.mark.parametrize("content", ['{"frames": []}', "[]", "[1]", "{"])
def test_a_cameras_json_of_something_else_is_told_of_and_passed_over(splat, tmp_path, content):
    (tmp_path / "cameras.json").write_text(content)
    warnings = warnings_of(splat, tmp_path / "capture", **SMALL)
    assert "cameras.json" in warnings["cameras"]
    assert len(open_capture(tmp_path / "capture").views) == 6


def test_photos_that_lie_around_it_are_told_of(tmp_path, table, still_life):
    folder = tmp_path / "scene"
    shutil.copytree(still_life.capture, folder)
    (folder / "splats").mkdir()
    write_splats(folder / "splats" / "still.ply", SplatFile(table))
    warnings = warnings_of(folder / "splats" / "still.ply", tmp_path / "capture", **SMALL)
    assert str(folder) in warnings["photos"] and "--photos" in warnings["photos"]
    with_photos = warnings_of(folder / "splats" / "still.ply", tmp_path / "with_photos", photos=folder)
    assert "photos" not in with_photos


def test_views_that_were_made_of_it_are_not_taken_for_photos(splat, tmp_path):
    karf.import_splat(splat, tmp_path / "capture", **SMALL)
    assert warnings_of(tmp_path / "capture" / "splat.ply", tmp_path / "again", **SMALL) == {}


def test_with_photos_they_are_the_views(splat, tmp_path, still_life):
    karf.import_splat(splat, tmp_path / "capture", photos=still_life.capture)
    before, after = open_capture(still_life.capture), open_capture(tmp_path / "capture")
    assert [view.image.resolve() for view in after.views] == [view.image.resolve() for view in before.views]
    assert [view.split for view in after.views] == [view.split for view in before.views]
    assert after.splats.path == tmp_path / "capture" / "splat.ply"


def test_photos_that_it_does_not_show_are_refused(tmp_path, still_life, table):
    elsewhere = table.copy()
    elsewhere[:, :3] += 5
    write_splats(tmp_path / "elsewhere.ply", SplatFile(elsewhere))
    with pytest.raises(DataError, match="dB only") as caught:
        karf.import_splat(tmp_path / "elsewhere.ply", tmp_path / "capture", photos=still_life.capture)
    assert "poses" in caught.value.hint and not (tmp_path / "capture").exists()


@pytest.mark.parametrize(
    "option", [{"views": 5}, {"size": 100}, {"up": "y"}, {"cameras": "own.json"}], ids=lambda option: next(iter(option))
)
def test_options_that_mean_nothing_beside_photos_are_refused(splat, tmp_path, still_life, option):
    with pytest.raises(BadRequest, match=f"With photos.*'{next(iter(option))}'"):
        karf.import_splat(splat, tmp_path / "capture", photos=still_life.capture, **option)


@pytest.mark.parametrize("is_antialiased", [True, False])
@pytest.mark.parametrize(("better", "told"), [(0.3, None), (-0.3, None), (2.0, True), (-2.0, False)])
def test_photos_tell_the_screen_filter_only_where_they_clearly_do(
    table, tmp_path, still_life, monkeypatch, is_antialiased, better, told
):
    """better: how many dB better the antialiased filter shows the photos."""
    write_splats(tmp_path / "still.ply", SplatFile(table, is_antialiased))
    monkeypatch.setattr(
        fit, "psnr", lambda gaussians, photos: 30 + better * (gaussians.screen_filter == ANTIALIASED_FILTER)
    )
    karf.import_splat(tmp_path / "still.ply", tmp_path / "capture", photos=still_life.capture)
    assert open_capture(tmp_path / "capture").splats.is_antialiased is (is_antialiased if told is None else told)


@pytest.mark.parametrize(("antialiased", "screen_filter"), [(False, PLAIN_FILTER), (True, ANTIALIASED_FILTER)])
def test_learned_it_is_shown_as_it_came(splat, table, tmp_path, antialiased, screen_filter):
    karf.import_splat(splat, tmp_path / "capture", **SMALL, antialiased=antialiased)
    small = ["geometry.long_side=32", 'geometry.levels=[{"voxels": 24, "iterations": 20, "step": 1.0}]']
    karf.learn_geometry(tmp_path / "capture", project=tmp_path / "project", overrides=small, threads=1)
    karf.learn_splats(tmp_path / "project", threads=1)
    shown = load_gaussians(Project(tmp_path / "project").splats_file)
    assert_array_equal(shown.table, table)
    assert shown.screen_filter == screen_filter
    model = karf.Model.load(tmp_path / "project", "cpu")
    camera = model.capture.views[0].camera
    assert_array_equal(model.render(camera).base, rasterize(shown, camera).picture())


def test_another_file_makes_the_splats_outdated(splat, table, tmp_path):
    karf.import_splat(splat, tmp_path / "capture", **SMALL)
    small = ["geometry.long_side=32", 'geometry.levels=[{"voxels": 24, "iterations": 20, "step": 1.0}]']
    karf.learn_geometry(tmp_path / "capture", project=tmp_path / "project", overrides=small, threads=1)
    karf.learn_splats(tmp_path / "project", threads=1)
    changed = table.copy()
    changed[0, 11] += 1
    write_splats(tmp_path / "capture" / "splat.ply", SplatFile(changed))
    karf.learn_splats(tmp_path / "project", threads=1)
    assert_array_equal(load_gaussians(Project(tmp_path / "project").splats_file).table, changed)


def test_a_folder_that_holds_something_is_not_written_to(splat, tmp_path):
    (tmp_path / "capture").mkdir()
    (tmp_path / "capture" / "mine.txt").write_text("x")
    with pytest.raises(BadRequest, match="not empty"):
        karf.import_splat(splat, tmp_path / "capture", **SMALL)


@pytest.mark.parametrize("views", range(3))
def test_too_few_views_are_refused(splat, tmp_path, views):
    with pytest.raises(BadRequest, match="views are too few") as caught:
        karf.import_splat(splat, tmp_path / "capture", **SMALL | {"views": views})
    assert caught.value.hint and not (tmp_path / "capture").exists()


def test_cancelling_leaves_nothing(splat, tmp_path):
    with pytest.raises(Cancelled):
        karf.import_splat(splat, tmp_path / "capture", **SMALL, should_stop=lambda: True)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["still.ply"]


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(DataError, match=r"gone\.ply"):
        karf.import_splat(tmp_path / "gone.ply", tmp_path / "capture", **SMALL)
