"""Import of another program's splat as a capture, with photos or with rendered views of it."""

import json
import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

pytest.importorskip("numba")

import karf_engine as karf
from blender_tests.engine.commands.conftest import Events
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
TINY = ('geometry.levels=[{"voxels": 24, "iterations": 20, "step": 1.0}]', "geometry.long_side=32")


@pytest.fixture(scope="module")
def table(learned):
    """The still life's own splats."""
    return load_gaussians(Project(learned.project).splats_file).table


@pytest.fixture
def splat(tmp_path, table):
    write_splats(tmp_path / "still.ply", SplatFile(table))
    return tmp_path / "still.ply"


@pytest.fixture
def imported(tmp_path, splat):
    """Import a splat; returns the capture and the warnings' sentences by their codes."""

    def imported(source=splat, name="capture", **options):
        events = Events()
        karf.import_splat(source, tmp_path / name, **options, emit=events)
        warnings = zip(events.values("warning", "code"), events.values("warning", "sentence"), strict=True)
        return open_capture(tmp_path / name), dict(warnings)

    return imported


def test_import_without_photos_renders_views_from_around(imported, splat, table):
    capture, _ = imported(**SMALL)
    assert len(capture.views) == 6 and capture.warnings == ()
    assert capture.splats.path.read_bytes() == splat.read_bytes()
    middle = np.median(table[:, :3], 0)
    for view in capture.views:
        assert (view.camera.width, view.camera.height) == (64, 64)
        pixels, depth = view.camera.project(middle[None])
        assert depth > 0 and np.abs(pixels - 32).max() < 32
        assert read_photo(view.image).std() > 0.02, f"{view.name} shows nothing"
    photo = read_photo(capture.views[0].image)  # with alpha, as nothing is behind the splat
    assert photo.shape[2] == 4 and photo[0, 0, 3] == 0 and photo[..., 3].max() == 1


@pytest.mark.parametrize("name", ["still.gltf", "still.glb", "still.spz", "still.compressed.ply"])
def test_other_formats_are_imported_whole(imported, table, tmp_path, name):
    """Also a .gltf, which consists of two files."""
    write_splats(tmp_path / "theirs" / name, SplatFile(table))
    capture, _ = imported(tmp_path / "theirs" / name, **SMALL)
    shutil.rmtree(tmp_path / "theirs")
    assert len(read_splats(capture.splats.path)) == len(table)


def test_given_cameras_come_first(imported, tmp_path, still_life):
    def color_over_black(view):
        photo = read_photo(view.image)
        return alpha_composite(photo[..., :3], photo[..., 3] if photo.shape[2] == 4 else None, 0)

    own = karf.open_capture(still_life.capture).views[:2]
    write_cameras(tmp_path / "own.json", own)
    views = imported(**SMALL, cameras=tmp_path / "own.json")[0].views
    assert len(views) == 8
    assert_allclose(views[0].camera.camera_to_world, own[0].camera.camera_to_world)
    assert psnr(color_over_black(views[0]), color_over_black(own[0])) > 20


def test_cameras_json_beside_the_splat_is_used(imported, tmp_path):
    entry = {"width": 128, "height": 64, "fx": 100, "fy": 100, "rotation": np.diag([1.0, -1, -1]).tolist()}
    content = [entry | {"position": [0, 0, 4 + number / 10]} for number in range(9)]
    (tmp_path / "cameras.json").write_text(json.dumps(content))
    cameras = [view.camera for view in imported(**SMALL)[0].views]
    assert len(cameras) == 6 and {(camera.width, camera.height) for camera in cameras} == {(64, 32)}
    assert_allclose([cameras[0].position, cameras[-1].position], [[0, 0, 4], [0, 0, 4.8]])


@pytest.mark.parametrize("content", ['{"frames": []}', "[]", "[1]", "{"])
def test_unusable_cameras_json_gives_a_warning(imported, tmp_path, content):
    (tmp_path / "cameras.json").write_text(content)
    capture, warnings = imported(**SMALL)
    assert "cameras.json" in warnings["cameras"] and len(capture.views) == 6


def test_nearby_photos_give_a_warning(imported, tmp_path, table, still_life):
    folder = tmp_path / "scene"
    shutil.copytree(still_life.capture, folder)
    write_splats(folder / "splats" / "still.ply", SplatFile(table))
    capture, warnings = imported(folder / "splats" / "still.ply", **SMALL)
    assert str(folder) in warnings["photos"] and "--photos" in warnings["photos"]
    assert imported(capture.splats.path, "again", **SMALL)[1] == {}
    assert "photos" not in imported(folder / "splats" / "still.ply", "with photos", photos=folder)[1]


def test_given_photos_are_the_views(imported, tmp_path, still_life):
    before, (after, _) = open_capture(still_life.capture), imported(photos=still_life.capture)
    assert [view.image.resolve() for view in after.views] == [view.image.resolve() for view in before.views]
    assert [view.split for view in after.views] == [view.split for view in before.views]
    assert after.splats.path == tmp_path / "capture" / "splat.ply"


@pytest.mark.parametrize("is_antialiased", [True, False])
@pytest.mark.parametrize(("better", "chosen"), [(0.3, None), (-0.3, None), (2.0, True), (-2.0, False)])
def test_photos_choose_the_screen_filter_if_clear(
    imported, table, tmp_path, still_life, monkeypatch, is_antialiased, better, chosen
):
    """better: by how many dB the antialiased filter shows the photos better; chosen: None keeps that of the file."""
    write_splats(tmp_path / "filtered.ply", SplatFile(table, is_antialiased))
    quality = {ANTIALIASED_FILTER: 30 + better, PLAIN_FILTER: 30}
    monkeypatch.setattr(fit, "psnr", lambda gaussians, photos: quality[gaussians.screen_filter])
    capture, _ = imported(tmp_path / "filtered.ply", photos=still_life.capture)
    assert capture.splats.is_antialiased is (is_antialiased if chosen is None else chosen)


@pytest.mark.parametrize(("antialiased", "screen_filter"), [(False, PLAIN_FILTER), (True, ANTIALIASED_FILTER)])
def test_learned_splats_equal_the_file_and_follow_its_changes(imported, table, tmp_path, antialiased, screen_filter):
    capture, _ = imported(**SMALL, antialiased=antialiased)
    project = Project(tmp_path / "project")
    karf.learn_geometry(tmp_path / "capture", project=project.folder, overrides=TINY, threads=1)
    karf.learn_splats(project.folder, threads=1)
    shown = load_gaussians(project.splats_file)
    assert_array_equal(shown.table, table)
    assert shown.screen_filter == screen_filter
    model = karf.Model.load(project.folder, "cpu")
    camera = model.capture.views[0].camera
    assert_array_equal(model.render(camera).base, rasterize(shown, camera).picture())
    changed = table.copy()
    changed[0, 11] += 1
    write_splats(capture.splats.path, SplatFile(changed))
    karf.learn_splats(project.folder, threads=1)
    assert_array_equal(load_gaussians(project.splats_file).table, changed)


def test_photos_of_another_scene_are_rejected(imported, tmp_path, still_life, table):
    elsewhere = table.copy()
    elsewhere[:, :3] += 5
    write_splats(tmp_path / "elsewhere.ply", SplatFile(elsewhere))
    with pytest.raises(DataError, match="dB only") as caught:
        imported(tmp_path / "elsewhere.ply", photos=still_life.capture)
    assert "poses" in caught.value.hint and not (tmp_path / "capture").exists()


ONLY_WITHOUT_PHOTOS = {"views": 5, "size": 100, "up": "y", "cameras": "own.json"}
REJECTED = {
    **{name: (BadRequest, {name: value}, f"With photos.*'{name}'") for name, value in ONLY_WITHOUT_PHOTOS.items()},
    **{f"{views} views": (BadRequest, SMALL | {"views": views}, "views are too few") for views in range(3)},
    "missing": (DataError, SMALL | {"source": "gone.ply"}, r"gone\.ply"),
    "cancelled": (Cancelled, SMALL | {"should_stop": lambda: True}, ""),
}


@pytest.mark.parametrize("case", REJECTED)
def test_rejected_import_leaves_nothing(imported, splat, tmp_path, still_life, case):
    error, options, message = REJECTED[case]
    options = options | ({"photos": still_life.capture} if case in ONLY_WITHOUT_PHOTOS else {})
    with pytest.raises(error, match=message or None):
        imported(**options | {"source": tmp_path / options.get("source", splat.name)})
    assert sorted(path.name for path in tmp_path.iterdir()) == ["still.ply"]


def test_nonempty_folder_is_not_written_to(imported, tmp_path):
    (tmp_path / "capture").mkdir()
    (tmp_path / "capture" / "mine.txt").write_text("x")
    with pytest.raises(BadRequest, match="not empty"):
        imported(**SMALL)
