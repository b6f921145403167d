"""Reading COLMAP's sparse models: compared with pycolmap, and found in every common folder layout."""

import shutil

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from blender_tests.engine.reference.capture_files import (
    ColmapModel,
    put,
    put_photos,
    random_rig,
    write_colmap,
)
from karf_engine.capture import open_capture
from karf_engine.capture.colmap_model import PARAMETERS
from karf_engine.errors import DataError

NAMES = [f"{number:03d}.png" for number in range(9)]
CAMERAS = random_rig(11)
MODELS = {  # distortion that does not fold within the picture
    "SIMPLE_PINHOLE": [],
    "PINHOLE": [],
    "SIMPLE_RADIAL": [0.05],
    "RADIAL": [-0.1, 0.02],
    "OPENCV": [0.08, -0.02, 0.004, -0.003],
    "FULL_OPENCV": [0.1, -0.05, 0.002, 0.003, 0.01, 0.04, -0.01, 0.002],
    "SIMPLE_FISHEYE": [],
    "FISHEYE": [],
    "SIMPLE_RADIAL_FISHEYE": [0.03],
    "RADIAL_FISHEYE": [0.03, -0.01],
    "OPENCV_FISHEYE": [0.03, -0.01, 0.004, -0.001],
    "THIN_PRISM_FISHEYE": [0.03, -0.01, 0.002, -0.003, 0.004, -0.001, 0.005, -0.004],
    "RAD_TAN_THIN_PRISM_FISHEYE": [0.04, -0.05, 0.1, 0.09, -0.1, 0.03, 0.002, -0.001, 0.003, -0.0005, -0.002, 0.0004],
}


def assert_agrees(capture, model):
    """Assert that every camera, pose and point equals that of pycolmap's Reconstruction."""
    by_name = {model.images[number].name: model.images[number] for number in model.reg_image_ids()}
    folder = capture.views[0].image.parent
    assert len(capture.views) == len(by_name)
    points = capture.points
    own_rows = np.concatenate([points.positions, points.colors, points.errors[:, None]], 1)
    rows = np.array([[*point.xyz, *point.color, point.error] for point in model.points3D.values()])
    in_order = [table[np.lexsort(table.T[:6])] for table in (own_rows, rows)]
    assert_allclose(*in_order, rtol=1e-6)
    for index, view in enumerate(capture.views):
        image = by_name[str(view.image.relative_to(folder).as_posix())]
        camera, theirs = view.camera, model.cameras[image.camera_id]
        matrix = np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        assert_allclose(np.diag([1, -1, -1, 1]) @ camera.world_to_camera, matrix, atol=1e-9)
        assert (camera.width, camera.height) == (theirs.width, theirs.height)
        assert_array_equal(theirs.calibration_matrix()[:2], [[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy]])
        observed = [point for point in image.points2D if point.has_point3D()]
        own = points.view == index
        assert_allclose(points.pixels[own], np.reshape([point.xy for point in observed], (-1, 2)), rtol=1e-6)
        positions = [model.points3D[point.point3D_id].xyz for point in observed]
        assert_array_equal(points.positions[points.point[own]], np.reshape(positions, (-1, 3)))
    assert len(points.view) == model.compute_num_observations()


@pytest.mark.opens("capture", "COLMAP 3 and 4, also rigs", "`.bin` or `.txt`", "perspective and fisheye lenses, points")
@pytest.mark.parametrize("suffix", [".bin", ".txt"])
@pytest.mark.parametrize("model", MODELS)
def test_models_are_read_as_pycolmap_reads_them(tmp_path, model, suffix):
    pycolmap = pytest.importorskip("pycolmap")
    pycolmap.set_random_seed(1)
    options = pycolmap.SyntheticDatasetOptions()
    options.num_cameras_per_rig = 2  # so that poses are relative to a rig
    options.camera_model_id = getattr(pycolmap.CameraModelId, model)
    focal = [700.0] if PARAMETERS[model].startswith("f ") else [700.0, 720.0]
    options.camera_params = [*focal, 512.0, 384.0, *MODELS[model]]
    written = pycolmap.synthesize_dataset(options)
    sparse = tmp_path / "sparse" / "0"
    sparse.mkdir(parents=True)
    (written.write_binary if suffix == ".bin" else written.write_text)(sparse)
    put_photos(tmp_path / "images", [image.name for image in written.images.values()], (1024, 768))
    assert (sparse / f"frames{suffix}").exists()  # is ignored
    capture = open_capture(tmp_path)
    assert capture.warnings == ()
    assert capture.views[0].camera.fisheye == ("FISHEYE" in model)
    assert_agrees(capture, pycolmap.Reconstruction(sparse))


@pytest.mark.parametrize("place", [".", "sparse", "sparse/0", "colmap/sparse/0", "dense/sparse"])
@pytest.mark.parametrize("suffix", [".bin", ".txt"])
def test_models_are_found_in_common_folders(tmp_path, place, suffix):
    put_photos(tmp_path / "images", NAMES, CAMERAS)
    ColmapModel(CAMERAS, NAMES).write(tmp_path / place, suffix)
    for chosen in (tmp_path, tmp_path / place, tmp_path / place / f"cameras{suffix}"):
        capture = open_capture(chosen)
        assert capture.format == "colmap" and capture.warnings == ()
        assert [view.image for view in capture.views] == [tmp_path / "images" / name for name in NAMES]
        assert len(capture.points) == 6


def test_model_with_the_most_photos_is_read(tmp_path):
    write_colmap(tmp_path, CAMERAS[:3], NAMES[:3])
    put_photos(tmp_path / "images", NAMES, CAMERAS)
    ColmapModel(CAMERAS, NAMES).write(tmp_path / "sparse" / "1")
    put(tmp_path / "sparse" / "2" / "cameras.bin", b"")
    put(tmp_path / "sparse" / "2" / "images.bin", b"\xff" * 80)  # claims more images than fit
    capture = open_capture(tmp_path)
    assert len(capture.views) == 9
    best = tmp_path / "sparse" / "1"
    assert capture.warnings == (f"3 sparse models were found; {best} has the most photos, 9, and was read.",)


def test_model_without_points_is_read_with_a_warning(tmp_path):
    write_colmap(tmp_path, CAMERAS, NAMES)
    (tmp_path / "sparse" / "0" / "points3D.bin").unlink()
    capture = open_capture(tmp_path)
    assert capture.points is None and "points3D.bin" in capture.warnings[0]


def test_every_photo_can_have_its_own_lens(tmp_path):
    cameras = [random_rig(seed, 1)[0] for seed in range(9)]
    write_colmap(tmp_path, cameras, NAMES, one_lens=False)
    for view, camera in zip(open_capture(tmp_path).views, cameras, strict=True):
        assert_allclose([view.camera.fx, view.camera.cy, view.camera.width], [camera.fx, camera.cy, camera.width])


def test_missing_last_feature_line_means_no_features(tmp_path):
    """An editor may strip the blank line of an image without features at the end of the file."""
    model = ColmapModel(CAMERAS, NAMES)
    model.images = [(*image[:4], []) for image in model.images]
    model.points = []
    put_photos(tmp_path / "images", NAMES, CAMERAS)
    model.write(tmp_path, ".txt")
    put(tmp_path / "images.txt", model.images_text().rstrip())
    capture = open_capture(tmp_path)
    assert len(capture.views) == 9 and capture.points is None


IN_TWO_FOLDERS = [f"cam{number % 2}/{name}" for number, name in enumerate(NAMES)]


@pytest.mark.parametrize(
    ("in_model", "folder", "on_disk"),
    [
        *((NAMES, folder, NAMES) for folder in ("images", "input", "images_4", "rgb", ".")),
        (IN_TWO_FOLDERS, "images", IN_TWO_FOLDERS),
        (IN_TWO_FOLDERS, "images", NAMES),
        ([name.replace(".png", ".JPG") for name in NAMES], "images_8", NAMES),
    ],
    ids=["images", "input", "images_4", "rgb", "here", "subfolders", "flattened", "other suffix"],
)
def test_photos_are_found_in_common_folders(tmp_path, in_model, folder, on_disk):
    write_colmap(tmp_path, CAMERAS, in_model)
    shutil.rmtree(tmp_path / "images")
    put_photos(tmp_path / folder, on_disk, CAMERAS)
    capture = open_capture(tmp_path)
    found = {view.image: view.camera for view in capture.views}
    assert set(found) == {tmp_path / folder / name for name in on_disk}
    for name, camera in zip(on_disk, CAMERAS, strict=True):
        assert_allclose(found[tmp_path / folder / name].camera_to_world, camera.camera_to_world, atol=1e-9)
    assert len({view.name for view in capture.views}) == 9
    assert not capture.warnings


def test_ambiguous_photo_names_are_not_guessed(tmp_path):
    write_colmap(tmp_path, CAMERAS, [f"cam{number}/000.png" for number in range(9)])
    shutil.rmtree(tmp_path / "images")
    put_photos(tmp_path / "images", ["000.png"])
    with pytest.raises(DataError, match="none of its 9 photos"):
        open_capture(tmp_path)


def test_photos_nearest_to_the_model_are_used(tmp_path):
    """Undistorted photos are beside their model, the originals of the same names above."""
    put_photos(tmp_path / "images", NAMES)
    put_photos(tmp_path / "dense" / "images", NAMES, CAMERAS)
    ColmapModel(CAMERAS, NAMES).write(tmp_path / "dense" / "sparse")
    assert open_capture(tmp_path).views[0].image == tmp_path / "dense" / "images" / NAMES[0]


def test_missing_and_unposed_photos_are_skipped_with_warnings(tmp_path):
    write_colmap(tmp_path, CAMERAS, NAMES)
    complete = open_capture(tmp_path)
    (tmp_path / "images" / NAMES[0]).unlink()
    put_photos(tmp_path / "images", ["x.png", "y.png"])
    capture = open_capture(tmp_path)
    assert capture.warnings == (
        "1 of 9 photos are missing and were skipped; the first is 000.png.",
        f"2 photos in {tmp_path / 'images'} have no pose in the model and were left out.",
    )
    assert [view.name for view in capture.views] == [view.name for view in complete.views[1:]]
    kept = complete.points.view > 0
    assert 0 < kept.sum() < len(kept)
    assert_array_equal(capture.points.view, complete.points.view[kept] - 1)
    assert_array_equal(capture.points.pixels, complete.points.pixels[kept])
    assert_array_equal(capture.points.point, complete.points.point[kept])
