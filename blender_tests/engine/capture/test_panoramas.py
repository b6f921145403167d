"""360-degree photos of every program become cube faces that equal pinhole photos of the same scene."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose
from PIL import Image
from scipy.ndimage import maximum_filter, minimum_filter
from scipy.spatial.transform import Rotation

import karf_engine as karf
from blender_tests.engine.reference import still_life
from blender_tests.engine.reference.capture_files import RIGHT_DOWN_FORWARD, put, put_json
from karf_engine.capture import open_capture
from karf_engine.capture.panoramas import FACES
from karf_engine.capture.transforms import camera_from_json
from karf_engine.errors import BadRequest, DataError
from karf_engine.io.images import read_photo, write_png

WIDTH, HEIGHT = 512, 256
SIDE = WIDTH // 4
POSE = np.eye(4)  # over the slab, between ball and block, tilted
POSE[:3, :3] = Rotation.from_euler("ZXY", [25, 70, 15], degrees=True).as_matrix()
POSE[:3, 3] = (-0.05, -0.6, 0.45)


def directions_of(pixels):
    """Directions in axes right, down, forward at pixels [n, 2] of an equirectangular picture."""
    longitude = (pixels[:, 0] / WIDTH - 0.5) * 2 * np.pi
    down = (pixels[:, 1] / HEIGHT - 0.5) * np.pi
    return np.stack([np.sin(longitude) * np.cos(down), np.sin(down), np.cos(longitude) * np.cos(down)], 1)


@pytest.fixture(scope="module")
def picture():
    color = np.zeros((HEIGHT * WIDTH, 3))
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    offsets = (np.arange(3) + 0.5) / 3
    for du in offsets:
        for dv in offsets:
            local = directions_of(np.stack([u.ravel() + du, v.ravel() + dv], 1))
            world = local @ RIGHT_DOWN_FORWARD @ POSE[:3, :3].T
            color += still_life._trace(np.broadcast_to(POSE[:3, 3], world.shape), world, sky=True)[0] / 9
    return color.reshape(HEIGHT, WIDTH, 3)


def world_to_camera():
    rotation = RIGHT_DOWN_FORWARD @ POSE[:3, :3].T
    return rotation, -rotation @ POSE[:3, 3]


def write_colmap(folder):
    rotation, translation = world_to_camera()
    quaternion = np.roll(Rotation.from_matrix(rotation).as_quat(), 1)
    pose = " ".join(repr(float(value)) for value in (*quaternion, *translation))
    put(folder / "sparse" / "cameras.txt", f"1 EQUIRECTANGULAR {WIDTH} {HEIGHT} {WIDTH} {HEIGHT}".encode())
    put(folder / "sparse" / "images.txt", f"1 {pose} 1 pano.png\n\n".encode())
    put(folder / "sparse" / "points3D.txt", b"# none")


def write_metashape(folder):
    pose = POSE.copy()
    pose[:3, :3] = pose[:3, :3] @ RIGHT_DOWN_FORWARD
    text = (
        f'<document><chunk><sensors><sensor id="0" type="spherical"><resolution width="{WIDTH}" height="{HEIGHT}"/></sensor>'
        f'</sensors><cameras><camera sensor_id="0" label="pano"><transform>{" ".join(map(repr, pose.ravel().tolist()))}'
        "</transform></camera></cameras></chunk></document>"
    )
    put(folder / "cameras.xml", text.encode())


def write_opensfm(folder, kind="spherical"):
    rotation, translation = world_to_camera()
    vector = Rotation.from_matrix(rotation).as_rotvec().tolist()
    shot = {"camera": "360", "rotation": vector, "translation": translation.tolist()}
    camera = {"projection_type": kind, "width": WIDTH, "height": HEIGHT}
    put_json(folder / "reconstruction.json", [{"cameras": {"360": camera}, "shots": {"pano.png": shot}}])


def write_equirectangular_opensfm(folder):
    write_opensfm(folder, "equirectangular")


def write_nerfstudio(folder, **more):
    frame = {"file_path": "images/pano.png", "transform_matrix": POSE.tolist()}
    lens = {"camera_model": "EQUIRECTANGULAR", "w": WIDTH, "h": HEIGHT, "fl_x": WIDTH / 2, "fl_y": HEIGHT}
    put_json(folder / "transforms.json", {**lens, "frames": [frame], **more})


GPANO = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf GPano:ProjectionType="equirectangular"/></x:xmpmeta>'
PROGRAMS = [write_colmap, write_metashape, write_opensfm, write_equirectangular_opensfm, write_nerfstudio]


def psnr_away_from_edges(found, expected):
    spread = maximum_filter(expected, (5, 5, 1)) - minimum_filter(expected, (5, 5, 1))
    is_flat = spread.max(-1) < 0.05
    assert is_flat.mean() > 0.5
    return -10 * np.log10(np.mean((found - expected)[is_flat] ** 2))


@pytest.mark.opens(
    "capture", "COLMAP, Metashape, OpenSfM, nerfstudio", "360-degree photos", "converted by `karf pinhole`"
)
@pytest.mark.parametrize("write", PROGRAMS)
def test_faces_are_pinhole_photos_of_the_same_scene(tmp_path, picture, write):
    write(tmp_path / "360")
    write_png(tmp_path / "360" / "images" / "pano.png", picture)
    karf.convert_panoramas(tmp_path / "360", tmp_path / "out")
    capture = open_capture(tmp_path / "out")
    assert [view.name for view in capture.views] == [f"pano_{face}" for face in FACES]
    for view in capture.views:
        assert (view.camera.width, view.camera.height, view.camera.is_pinhole) == (SIDE, SIDE, True)
        expected = still_life.take_photo(view.camera, sky=True).color
        assert psnr_away_from_edges(read_photo(view.image), expected) > 35
        assert np.abs(read_photo(view.image) - expected).mean() < 0.01


def test_reference_projection_equals_colmaps():
    pycolmap = pytest.importorskip("pycolmap")
    camera = pycolmap.Camera(model="EQUIRECTANGULAR", width=WIDTH, height=HEIGHT, params=[WIDTH, HEIGHT])
    pixels = np.random.default_rng(0).uniform([0, 0], [WIDTH, HEIGHT], (200, 2))
    assert_allclose(camera.img_from_cam(directions_of(pixels)), pixels, atol=1e-6)


@pytest.mark.parametrize("side", [16, 20, 300])
def test_small_and_large_faces_are_averaged_and_interpolated(tmp_path, picture, side):
    write_nerfstudio(tmp_path / "360")
    write_png(tmp_path / "360" / "images" / "pano.png", picture)
    karf.convert_panoramas(tmp_path / "360", tmp_path / "out", faces="back,down", size=side)
    views = open_capture(tmp_path / "out").views
    assert [view.name for view in views] == ["pano_back", "pano_down"]
    for view in views:
        parts = 8 if side < 100 else 1
        fine = still_life.take_photo(view.camera.scaled(parts * side, parts * side), sky=True).color
        expected = fine.reshape(side, parts, side, parts, 3).mean((1, 3))
        assert np.abs(read_photo(view.image) - expected).mean() < 0.02


@pytest.mark.parametrize("write", PROGRAMS)
def test_direct_opening_names_the_command(tmp_path, picture, write):
    write(tmp_path)
    write_png(tmp_path / "images" / "pano.png", picture)
    with pytest.raises(DataError, match=r'are 360-degree photos.* karf pinhole ".*" --out'):
        open_capture(tmp_path)


def put_mixed(folder, picture):
    pinhole = {"file_path": "images/plain.png", "transform_matrix": np.eye(4).tolist(), "camera_model": "OPENCV"}
    frames = [
        {"file_path": "images/pano.png", "transform_matrix": POSE.tolist()},
        {**pinhole, "fl_x": 40.0, "w": 64, "h": 48},
    ]
    write_nerfstudio(folder, frames=frames, train_filenames=["images/plain.png"], test_filenames=["images/pano.png"])
    write_png(folder / "images" / "pano.png", picture)
    write_png(folder / "images" / "plain.png", np.zeros((48, 64, 3)))


def test_panoramas_among_other_photos_are_left_out(tmp_path, picture):
    put_mixed(tmp_path, picture)
    capture = open_capture(tmp_path)
    assert [view.name for view in capture.views] == ["plain"]
    assert any("1 of 2 photos were left out" in remark and "karf pinhole" in remark for remark in capture.warnings)


def test_other_photos_and_splits_are_kept(tmp_path, picture):
    put_mixed(tmp_path / "360", picture)
    karf.convert_panoramas(tmp_path / "360", tmp_path / "out", faces="front")
    front, plain = open_capture(tmp_path / "out").views
    assert (front.name, front.split, plain.name, plain.split) == ("pano_front", "test", "plain", "train")
    assert plain.image.resolve() == tmp_path / "360" / "images" / "plain.png"


def save_jpeg(path, colors, profile):
    exif = Image.Exif()
    exif[0x0112] = 3  # upside down
    Image.fromarray(colors[::-1, ::-1]).save(path, quality=95, exif=exif, icc_profile=profile, xmp=GPANO)


def test_jpeg_stays_upright_jpeg_with_its_profile(tmp_path, picture):
    from PIL import ImageCms

    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    write_nerfstudio(tmp_path / "360", frames=[{"file_path": "pano.jpg", "transform_matrix": POSE.tolist()}])
    save_jpeg(tmp_path / "360" / "pano.jpg", np.rint(picture * 255).astype(np.uint8), profile)
    karf.convert_panoramas(tmp_path / "360", tmp_path / "out", faces="left")
    (view,) = open_capture(tmp_path / "out").views
    assert b"GPano" in (tmp_path / "360" / "pano.jpg").read_bytes() and b"GPano" not in view.image.read_bytes()
    assert view.image.name == "pano_left.jpg" and Image.open(view.image).info["icc_profile"] == profile
    assert psnr_away_from_edges(read_photo(view.image), still_life.take_photo(view.camera, sky=True).color) > 35


def test_sixteen_bits_are_kept(tmp_path, picture):
    import cv2

    write_nerfstudio(tmp_path / "360")
    (tmp_path / "360" / "images").mkdir()
    cv2.imwrite(str(tmp_path / "360" / "images" / "pano.png"), np.rint(picture[..., ::-1] * 65535).astype(np.uint16))
    karf.convert_panoramas(tmp_path / "360", tmp_path / "out", faces="right")
    face = cv2.imread(str(tmp_path / "out" / "images" / "pano_right.png"), cv2.IMREAD_UNCHANGED)
    assert face.dtype == np.uint16 and len(np.unique(face % 257)) > 200


@pytest.mark.parametrize("shape", [(100, 512), (256, 256)])
def test_partial_panorama_is_rejected(tmp_path, shape):
    write_nerfstudio(tmp_path)
    write_png(tmp_path / "images" / "pano.png", np.zeros((*shape, 3)))
    with pytest.raises(DataError, match=r"pano.png.*not of the whole sphere"):
        karf.convert_panoramas(tmp_path, tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_unknown_faces_and_captures_without_panoramas_are_rejected(tmp_path):
    with pytest.raises(BadRequest, match="top"):
        karf.convert_panoramas(tmp_path, tmp_path / "out", faces="front,top")
    write_nerfstudio(tmp_path, camera_model="OPENCV")
    write_png(tmp_path / "images" / "pano.png", np.zeros((HEIGHT, WIDTH, 3)))
    with pytest.raises(DataError, match="has no 360-degree photos"):
        karf.convert_panoramas(tmp_path, tmp_path / "out")


def test_bare_panorama_camera_is_rejected():
    fields = {"camera_model": "EQUIRECTANGULAR", "w": WIDTH, "h": HEIGHT, "transform_matrix": POSE.tolist()}
    with pytest.raises(DataError, match="EQUIRECTANGULAR"):
        camera_from_json(json.loads(json.dumps(fields)), "the camera")
