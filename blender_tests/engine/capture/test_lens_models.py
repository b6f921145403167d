"""Lenses of other programs agree with pycolmap and with their published equations, through the files that name them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from blender_tests.engine.reference.capture_files import put, put_json, put_photos, random_rig
from karf_engine.capture import Capture, View, open_capture
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import capture_from_json, capture_to_json
from karf_engine.capture.colmap_model import PARAMETERS
from karf_engine.capture.distortion import distort, undistort_points
from karf_engine.capture.radial_lenses import brown_distortion, division, field_of_view, fit_fisheye, unified
from karf_engine.capture.transforms import camera_from_json, camera_to_json
from karf_engine.errors import DataError

WIDTH, HEIGHT, FOCAL = 3000, 2000, 2000.0
THIN_PRISM = [0.03, -0.01, 0.002, -0.003, 0.004, -0.001, 0.005, -0.004]
RAD_TAN = [0.4, -0.5, 0.1, 0.9, -1.0, 0.3, 0.002, -0.001, 0.003, -0.0005, -0.002, 0.0004]  # as of an Aria headset
PRISMS = {
    "THIN_PRISM_FISHEYE": (0.03, -0.01, 0.004, -0.001, 0.002, -0.003, 0.005, 0.0, -0.004, 0.0),
    "RAD_TAN_THIN_PRISM_FISHEYE": (0.4, -0.5, 0.1, 0.9, -1.0, 0.3, -0.001, 0.002, 0.003, -0.0005, -0.002, 0.0004),
}
CASES = [  # camera model, parameters after focal length and principal point, largest error in pixels
    ("THIN_PRISM_FISHEYE", THIN_PRISM, 0.01),
    ("THIN_PRISM_FISHEYE", [0.03, -0.01, 0, 0, 0.004, -0.001, 0, 0], 0.01),
    ("RAD_TAN_THIN_PRISM_FISHEYE", RAD_TAN, 0.01),
    ("RAD_TAN_THIN_PRISM_FISHEYE", [*RAD_TAN[:6], *[0.0] * 6], 0.01),
    ("FOV", [1e-9], 0.3),
    ("FOV", [0.3], 0.3),
    ("FOV", [0.9], 0.3),
    ("FOV", [1.2], 0.3),
    ("SIMPLE_DIVISION", [-0.15], 0.3),
    ("DIVISION", [-0.5], 0.3),
    ("DIVISION", [-0.03], 0.3),
    ("DIVISION", [0.1], 0.3),
    ("EUCM", [0.0, 1.0], 0.3),
    ("EUCM", [0.3, 0.8], 0.3),
    ("EUCM", [0.6, 1.1], 0.3),
    ("EUCM", [0.9, 2.0], 0.3),
]


def write_model(folder, model, values):
    focal = [FOCAL] if PARAMETERS[model].startswith("f ") else [FOCAL, FOCAL * 1.01]
    parameters = [*focal, WIDTH / 2 + 20, HEIGHT / 2 - 15, *values]
    text = f"1 {model} {WIDTH} {HEIGHT} {' '.join(map(repr, map(float, parameters)))}"
    put(folder / "sparse" / "cameras.txt", text.encode())
    put(folder / "sparse" / "images.txt", b"1 1 0 0 0 0 0 0 1 a.png\n\n")
    put(folder / "sparse" / "points3D.txt", b"# none")
    return parameters


@pytest.mark.opens("capture", "COLMAP 4", "all other lenses", "FOV, division, EUCM, thin prism")
@pytest.mark.parametrize(("model", "values", "most"), CASES)
def test_every_colmap_lens_projects_as_colmap_does(tmp_path, model, values, most):
    pycolmap = pytest.importorskip("pycolmap")
    theirs = pycolmap.Camera(model=model, width=WIDTH, height=HEIGHT, params=write_model(tmp_path, model, values))
    camera = open_capture(tmp_path, photos=False).views[0].camera
    x, y = np.meshgrid(np.linspace(-1.2, 1.2, 81), np.linspace(-1.0, 1.0, 61))
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], 1)
    expected = theirs.img_from_cam(rays)
    inside = ((expected >= 0) & (expected <= (WIDTH, HEIGHT))).all(1)
    pixels = (camera.cx, camera.cy) + rays[:, :2] * (camera.fx, camera.fy)
    error = np.abs(distort(camera, pixels) - expected)[inside]
    assert inside.sum() > 1000 and error.max() < most


DEGENERATE = [
    ("FOV", [np.pi]),
    ("FOV", [3.0]),
    ("FOV", [4.0]),
    ("DIVISION", [1e3]),
    ("DIVISION", [-1e9]),
    ("DIVISION", [2.0]),
    ("EUCM", [1e6, 1.0]),
    ("EUCM", [-1e6, 1.0]),
    ("EUCM", [0.5, 1e12]),
    ("EUCM", [0.5, -1e6]),
    ("THIN_PRISM_FISHEYE", [1e9, *THIN_PRISM[1:]]),
]


@pytest.mark.parametrize(("model", "values"), DEGENERATE)
def test_degenerate_lenses_are_rejected_by_name(tmp_path, model, values):
    write_model(tmp_path, model, values)
    with pytest.raises(DataError, match=r"images\.txt, image 1 \('a\.png'\) has .*(lens|coefficient|focal)"):
        open_capture(tmp_path, photos=False)


def thin_prism_camera(model):
    lens = WIDTH, HEIGHT, FOCAL, FOCAL * 1.01, WIDTH / 2 + 20, HEIGHT / 2 - 15
    return Camera(*lens, random_rig(3, 1)[0].camera_to_world, PRISMS[model], True)


@pytest.mark.parametrize("model", PRISMS)
def test_thin_prism_lenses_round_trip_through_our_files(tmp_path, model):
    camera = thin_prism_camera(model)
    content = camera_to_json(camera)
    assert content["camera_model"] == model and camera_from_json(content, "it") == camera
    capture = Capture(tmp_path, "colmap", (View("a", "a", camera, None, "train"),))
    assert capture_from_json(capture_to_json(capture), tmp_path / "capture.json").views[0].camera == camera


@pytest.mark.parametrize("model", PRISMS)
def test_undistortion_inverts_thin_prisms(model):
    camera = thin_prism_camera(model)
    pixels = camera.pixel_centers()[:: WIDTH * 50 + 37]
    assert_allclose(distort(camera, undistort_points(camera, pixels)), pixels, atol=1e-3)


@pytest.mark.parametrize(
    "coefficients", [(-0.2, 0.1, -0.05, 0.02), (0.1, -0.05, 0.02, -0.004), (0.05, 0.01, 0.02, 0.03)]
)
def test_four_radial_terms_fit_a_rational_model_within_a_fraction_of_a_pixel(coefficients):
    found = brown_distortion("the lens", coefficients, (0.002, -0.003), 0.9)
    camera = Camera(WIDTH, HEIGHT, FOCAL, FOCAL, WIDTH / 2, HEIGHT / 2, np.eye(4), found)
    plane = np.stack(np.meshgrid(np.linspace(-0.7, 0.7, 21), np.linspace(-0.5, 0.5, 15)), -1).reshape(-1, 2)
    x, y = plane.T
    r2 = (plane**2).sum(1)
    radial = 1 + sum(k * r2 ** (n + 1) for n, k in enumerate(coefficients))
    dx, dy = 0.004 * x * y - 0.003 * (r2 + 2 * x**2), 0.002 * (r2 + 2 * y**2) - 0.006 * x * y
    expected = (WIDTH / 2, HEIGHT / 2) + FOCAL * (plane * radial[:, None] + np.stack([dx, dy], 1))
    distorted = distort(camera, (WIDTH / 2, HEIGHT / 2) + FOCAL * plane)
    inside = np.hypot(*(expected - (WIDTH / 2, HEIGHT / 2)).T) < 0.85 * FOCAL
    assert np.abs(distorted - expected)[inside].max() < 0.3


def test_lens_with_few_terms_stays_opencvs():
    for distance in (field_of_view(0.9), division(-0.1), unified(0.6, 1.1)):
        assert len(fit_fisheye("the lens", distance, 0.9)[1]) == 4


# ----------------------------------------------------------------------------------------------------- other programs
def test_metashape_tangential_fisheye_and_k4_are_read(tmp_path):
    calibration = "<f>2000</f><k1>0.03</k1><k2>-0.01</k2><k3>0.004</k3><k4>-0.001</k4><p1>-0.003</p1><p2>0.002</p2>"
    size = f'<resolution width="{WIDTH}" height="{HEIGHT}"/>'
    kinds = ("equidistant_fisheye", "fisheye", "frame")
    sensors = "".join(
        f'<sensor id="{n}" type="{kind}">{size}<calibration>{calibration}</calibration></sensor>'
        for n, kind in enumerate(kinds)
    )
    pose = " ".join(map(str, np.eye(4).ravel()))
    cameras = "".join(
        f'<camera sensor_id="{n}" label="{n}"><transform>{pose}</transform></camera>' for n in range(len(kinds))
    )
    text = f"<document><chunk><sensors>{sensors}</sensors><cameras>{cameras}</cameras></chunk></document>"
    put(tmp_path / "cameras.xml", text.encode())
    equidistant, fisheye, frame = (view.camera for view in open_capture(tmp_path, photos=False).views)
    expected = (0.03, -0.01, 0.004, -0.001, 0.002, -0.003, 0.0, 0.0, 0.0, 0.0)  # of the manual's equations
    assert equidistant.fisheye and equidistant.distortion == expected
    assert fisheye == equidistant
    assert not frame.fisheye and frame.distortion[2:4] == (0.002, -0.003)
    r = np.array([0.3, 0.6, 0.9])
    stored = distort(replace(frame, distortion=(*frame.distortion[:2], 0, 0, *frame.distortion[4:])),
                     np.stack([WIDTH / 2 + FOCAL * r, np.full(3, HEIGHT / 2)], 1))  # fmt: skip
    radial = 1 + 0.03 * r**2 - 0.01 * r**4 + 0.004 * r**6 - 0.001 * r**8
    assert_allclose(stored[:, 0], WIDTH / 2 + FOCAL * r * radial, atol=0.3)


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (["a", "a"], "has several photos called a"),
        (["1/a.png", "2/a.png"], "none of its 2 photos was found"),  # images/a.png is one of them only
    ],
)
def test_photos_with_equal_names_are_not_confused(tmp_path, labels, words):
    pose = " ".join(map(str, np.eye(4).ravel()))
    cameras = "".join(f'<camera sensor_id="0" label="{name}"><transform>{pose}</transform></camera>' for name in labels)
    sensor = '<sensor id="0"><calibration><f>200</f></calibration></sensor>'
    put(tmp_path / "cameras.xml", f"<d><chunk><s>{sensor}</s><c>{cameras}</c></chunk></d>".encode())
    put_photos(tmp_path / "images", ["a.png"], (300, 200))
    with pytest.raises(DataError, match=f"{tmp_path.name}.* {words}"):
        open_capture(tmp_path)


@pytest.mark.parametrize("lenses", [[[200, 200, 150]], [["a", 200, 150, 100]], [[200, 200, 150, 100]] * 2])
def test_malformed_record3d_lenses_are_named(tmp_path, lenses):
    content = {"w": 300, "h": 200, "K": [200, 0, 0, 0, 200, 0, 150, 100, 1], "poses": [[0, 0, 0, 1, 0, 0, 0]]}
    put_json(tmp_path / "metadata", content | {"perFrameIntrinsicCoeffs": lenses})
    put_photos(tmp_path / "rgb", ["0.png"], (300, 200))
    with pytest.raises(DataError, match="metadata lacks a value of the scan"):
        open_capture(tmp_path)


def test_realityscan_row_without_a_photo_is_named(tmp_path):
    put(tmp_path / "cameras.csv", b"x,y,alt,heading,pitch,roll,f,name\n0,0,0,0,0,0,24,a.png\n1,2\n")
    with pytest.raises(DataError, match=r"cameras\.csv, line 3 names no photo"):
        open_capture(tmp_path)


RS_HEADS = ["#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2", "#name,x,y,alt,yaw,pitch,roll,f_35mm,px_norm,py_norm,k1,k2,k3,k4,t1,t2"]  # fmt: skip


@pytest.mark.parametrize("head", RS_HEADS)
def test_realityscan_tables_have_normalized_centers_and_swapped_tangential_terms(tmp_path, head):
    put(tmp_path / "cameras.csv", f"{head}\na.png,0,0,0,0,0,0,24,0.01,-0.02,0.1,0.02,0.003,0,0.004,0.005\n".encode())
    put_photos(tmp_path, ["a.png"], (300, 200))
    camera = open_capture(tmp_path).views[0].camera
    assert_allclose([camera.fx, camera.cx, camera.cy], [200, 153, 94])
    assert camera.distortion == (0.1, 0.02, 0.005, 0.004, 0.003)


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ('xcr:DistortionModel="rationalP2D1" xcr:DistortionCoeficients="0.1 0 0 0 0 0"', "of the model rationalP2D1"),
        ('xcr:DistortionModel="brown3" xcr:AspectRatio="1.1"', "oblong pixels"),
        ('xcr:DistortionModel="brown3" xcr:Skew="0.01"', "skewed or oblong"),
        ('xcr:DistortionModel="division" xcr:DistortionCoeficients="1e6 0 0 0 0 0"', "lens"),
    ],
)
def test_unreadable_realityscan_lenses_are_rejected(tmp_path, attributes, words):
    pose = 'xcr:Rotation="1 0 0 0 1 0 0 0 1" xcr:Position="0 0 0" xcr:FocalLength35mm="24"'
    text = f'<rdf:Description xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" {pose} {attributes}/>'
    put(tmp_path / "a.xmp", text.encode())
    put_photos(tmp_path, ["a.png"], (300, 200))
    with pytest.raises(DataError, match=f"a.xmp.*{words}"):
        open_capture(tmp_path)
