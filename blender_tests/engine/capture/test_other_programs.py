"""Cameras of photogrammetry programs and phone apps, written here from their formats' descriptions, come back."""

import json
from dataclasses import replace
from pathlib import PurePosixPath

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from blender_tests.engine.reference.capture_files import RIGHT_DOWN_FORWARD, put, put_json, put_photos, random_rig
from karf_engine.capture import open_capture
from karf_engine.capture.distortion import distort
from karf_engine.capture.radial_lenses import division, field_of_view, fit_fisheye, polynomial, unified
from karf_engine.errors import DataError

NAMES = [f"IMG_{number}.jpg" for number in range(5)]
Y_UP = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0]])  # from axes with z up


def world_to_camera(camera):
    """Rotation and translation to axes right, down, forward."""
    rotation = RIGHT_DOWN_FORWARD @ camera.camera_to_world[:3, :3].T
    return rotation, -rotation @ camera.camera_to_world[:3, 3]


def numbers(values):
    return " ".join(repr(float(value)) for value in np.ravel(values))


# -------------------------------------------------------------------------------------------------------------- writers
def write_metashape(folder, rig, component=None):
    lens, fisheye = rig[0], rig[0].fisheye
    k1, k2, third, fourth, k3 = (*lens.distortion, 0, 0, 0, 0, 0)[:5]
    own = (
        {"k1": k1, "k2": k2, "k3": third, "k4": fourth}
        if fisheye
        else {"k1": k1, "k2": k2, "k3": k3, "p1": fourth, "p2": third}
    )
    own |= {"f": lens.fy, "b1": lens.fx - lens.fy, "cx": lens.cx - lens.width / 2, "cy": lens.cy - lens.height / 2}
    size = f'<resolution width="{lens.width}" height="{lens.height}"/>'
    values = "".join(f"<{name}>{value!r}</{name}>" for name, value in own.items())
    calibration = f'<calibration class="adjusted">{size}{values}</calibration>'
    kind = "fisheye" if fisheye else "frame"
    rotation, translation, scale = component or (np.eye(3), np.zeros(3), 1.0)
    cameras = ""
    for name, camera in zip(NAMES, rig, strict=True):
        pose = np.eye(4)
        pose[:3, :3] = rotation.T @ camera.camera_to_world[:3, :3] @ RIGHT_DOWN_FORWARD
        pose[:3, 3] = rotation.T @ (camera.camera_to_world[:3, 3] - translation) / scale
        cameras += f'<camera sensor_id="0" component_id="0" label="{name[:-4]}"><transform>{numbers(pose)}</transform></camera>'
    cameras += '<camera sensor_id="0" label="IMG_9"/>'
    text = (
        f'<document version="2.0"><chunk label="Chunk"><sensors><sensor id="0" type="{kind}">{size}<calibration>{size}'
        f"<f>1</f></calibration>{calibration}</sensor></sensors><components><component id='0'><transform><rotation>"
        f"{numbers(rotation)}</rotation><translation>{numbers(translation)}</translation><scale>{scale}</scale></transform>"
        f"</component></components><cameras><group>{cameras}</group></cameras></chunk></document>"
    )
    put(folder / "cameras.xml", text.encode())


def write_moved_metashape(folder, rig):
    write_metashape(folder, rig, (Rotation.from_rotvec([0.3, -0.2, 0.5]).as_matrix(), np.array([1.0, -2.0, 3.0]), 2.5))


def realityscan_lens(camera):
    side = max(camera.width, camera.height)
    center = (camera.cx - camera.width / 2) / side, (camera.cy - camera.height / 2) / side
    k1, k2, p1, p2, k3 = (*camera.distortion, 0, 0, 0, 0, 0)[:5]
    return camera.fx / side * 36, center, (k1, k2, k3, 0, p2, p1)


def write_xmp(folder, rig, as_elements=False):
    for name, camera in zip(NAMES, rig, strict=True):
        rotation, _ = world_to_camera(camera)
        focal, (u, v), coefficients = realityscan_lens(camera)
        fields = {
            "DistortionModel": "brown3",
            "DistortionCoeficients": numbers(coefficients),
            "FocalLength35mm": repr(focal),
        }
        fields |= {"PrincipalPointU": repr(u), "PrincipalPointV": repr(v), "Rotation": numbers(rotation)}
        elements = {"Position": numbers(camera.position)} | (
            {"Rotation": fields.pop("Rotation")} if as_elements else {}
        )
        attributes = " ".join(f'xcr:{key}="{value}"' for key, value in fields.items())
        inner = "".join(f"<xcr:{key}>{value}</xcr:{key}>" for key, value in elements.items())
        text = (
            f'<x:xmpmeta><rdf:Description xmlns:xcr="http://www.capturingreality.com/ns/xcr/1.1#" {attributes}>{inner}'
        )
        put(folder / "images" / f"{name[:-4]}.xmp", (text + "</rdf:Description></x:xmpmeta>").encode())


def write_xmp_elements(folder, rig):
    write_xmp(folder, rig, as_elements=True)


def write_csv(folder, rig):
    lines = ["#name,x,y,alt,heading,pitch,roll,f,px,py,k1,k2,k3,k4,t1,t2"]
    for name, camera in zip(NAMES, rig, strict=True):
        heading, pitch, roll = Rotation.from_matrix(camera.camera_to_world[:3, :3]).as_euler("ZXY", degrees=True)
        focal, (u, v), coefficients = realityscan_lens(camera)
        values = [*camera.position, -heading, pitch, roll, focal, u, v, *coefficients]
        lines.append(",".join([name, *map(repr, map(float, values))]))
    put(folder / "cameras.csv", "\n".join(lines).encode())


def write_opensfm(folder, rig):
    lens, side = rig[0], max(rig[0].width, rig[0].height)
    camera = {"width": lens.width, "height": lens.height, "k1": 0.0, "k2": 0.0}
    if lens.fisheye:
        camera |= {
            "projection_type": "fisheye_opencv",
            **dict(zip(("k1", "k2", "k3", "k4"), lens.distortion, strict=False)),
        }
    else:
        keys = ("k1", "k2", "p1", "p2", "k3")
        camera |= {"projection_type": "brown", **dict(zip(keys, lens.distortion, strict=False))}
    camera |= {"focal_x": lens.fx / side, "focal_y": lens.fy / side}
    camera |= {"c_x": (lens.cx - lens.width / 2) / side, "c_y": (lens.cy - lens.height / 2) / side}
    shots = {}
    for name, own in zip(NAMES, rig, strict=True):
        rotation, translation = world_to_camera(own)
        vector = Rotation.from_matrix(rotation).as_rotvec()
        shots[name] = {"camera": "v2", "rotation": vector.tolist(), "translation": translation.tolist()}
    parts = [{"cameras": {}, "shots": {}}, {"cameras": {"v2": camera}, "shots": shots, "points": {}}]
    put_json(folder / "opensfm" / "reconstruction.json", parts)


def write_polycam(folder, rig):
    for name, camera in zip(NAMES, rig, strict=True):
        pose = Y_UP @ camera.camera_to_world[:3]
        content = {f"t_{row}{column}": pose[row, column] for row in range(3) for column in range(4)}
        content |= {"fx": camera.fx, "fy": camera.fy, "cx": camera.cx, "cy": camera.cy}
        content |= {"width": camera.width, "height": camera.height, "blur_score": 100}
        put_json(folder / "keyframes" / "corrected_cameras" / f"{name[:-4]}.json", content)


def write_record3d(folder, rig):
    lens, poses = rig[0], []
    for camera in rig:
        rotation = Y_UP @ camera.camera_to_world[:3, :3]
        poses.append([*Rotation.from_matrix(rotation).as_quat(), *(Y_UP @ camera.position)])
    matrix = np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]])
    content = {"w": lens.width, "h": lens.height, "K": matrix.T.ravel().tolist(), "poses": np.array(poses).tolist()}
    put(folder / "metadata", json.dumps(content).encode())


BROWN, FISHEYE = (0.05, -0.01, 0.003, -0.002, 0.004), (0.02, -0.005, 0.002, -0.001)
PROGRAMS = [  # who writes, format, where the photos are, their names, lenses that it knows
    (write_metashape, "metashape", "", NAMES, [(BROWN, False), (FISHEYE, True), ((), False)]),
    (write_moved_metashape, "metashape", "photos", NAMES, [((), False)]),
    (write_xmp, "realityscan", "images", NAMES, [(BROWN, False), ((), False)]),
    (write_xmp_elements, "realityscan", "images", NAMES, [((), False)]),
    (write_csv, "realityscan", "", NAMES, [(BROWN, False), ((), False)]),
    (write_opensfm, "opensfm", "images", NAMES, [(BROWN, False), (FISHEYE, True), ((), False)]),
    (write_polycam, "polycam", "keyframes/corrected_images", NAMES, [((), False)]),
    (write_record3d, "record3d", "rgb", [f"{number}.jpg" for number in range(5)], [((), False)]),
]
CASES = [(*program[:4], *lens) for program in PROGRAMS for lens in program[4]]


def rig_of(distortion, fisheye, has_one_focal):
    rig = random_rig(17, 5, distortion, fisheye)
    return [
        replace(camera, width=400, height=300, fx=350.0, fy=350.0 if has_one_focal else 355.0, cx=205.0, cy=147.0)
        for camera in rig
    ]


@pytest.mark.opens("capture", "Metashape 1.5 to 2.2", "XML of *Export Cameras*", "frame and fisheye lenses")
@pytest.mark.opens("capture", "RealityScan, RealityCapture", "`.xmp` beside the photos", "Brown and division lenses")
@pytest.mark.opens("capture", "RealityScan, RealityCapture", "CSV of internal/external parameters", "Brown lenses")
@pytest.mark.opens("capture", "OpenSfM, OpenDroneMap", "`reconstruction.json`", "perspective, Brown, fisheye lenses")
@pytest.mark.opens("capture", "Polycam", "raw data, `keyframes/`", "corrected cameras where there are some")
@pytest.mark.opens("capture", "Record3D", "`metadata` and `rgb/`", "one lens, or one for each photo")
@pytest.mark.parametrize(("write", "name", "place", "photos", "distortion", "fisheye"), CASES)
def test_cameras_round_trip(tmp_path, write, name, place, photos, distortion, fisheye):
    rig = rig_of(distortion, fisheye, name == "realityscan")
    put_photos(tmp_path / place, photos, rig)
    write(tmp_path, rig)
    capture = open_capture(tmp_path)
    assert capture.format == name and [view.image.name for view in capture.views] == photos
    for view, camera in zip(capture.views, rig, strict=True):
        assert_allclose(view.camera.camera_to_world, camera.camera_to_world, atol=1e-9)
        lens = (view.camera.fx, view.camera.fy, view.camera.cx, view.camera.cy)
        assert_allclose(lens, (camera.fx, camera.fy, camera.cx, camera.cy), rtol=1e-9)
        pixels = camera.pixel_centers()[::5000]
        assert_allclose(distort(view.camera, pixels), distort(camera, pixels), atol=1e-6)


@pytest.mark.parametrize(("write", "name", "place", "photos", "lenses"), PROGRAMS)
def test_missing_photo_is_left_out(tmp_path, write, name, place, photos, lenses):
    rig = rig_of((), False, name == "realityscan")
    put_photos(tmp_path / place, photos[1:], rig[1:])
    write(tmp_path, rig)
    capture = open_capture(tmp_path)
    assert len(capture.views) == 4
    assert any("1 of 5 photos are missing and were skipped" in text for text in capture.warnings)


def test_photos_not_aligned_by_metashape_are_left_out(tmp_path):
    rig = rig_of((), False, False)
    put_photos(tmp_path, NAMES, rig)
    write_metashape(tmp_path, rig)
    assert open_capture(tmp_path / "cameras.xml").warnings == ("1 of 6 photos are not aligned and were left out.",)


DAMAGES = [
    (write_metashape, "cameras.xml", lambda text: text[:300], "is no complete XML"),
    (write_metashape, "cameras.xml", lambda text: text.replace("transform", "t"), "holds no aligned cameras"),
    (write_metashape, "cameras.xml", lambda text: text.replace('type="frame"', 'type="RPC"'), "RPC"),
    (write_csv, "cameras.csv", lambda text: text.splitlines()[0], "holds no cameras"),
    (write_opensfm, "opensfm/reconstruction.json", lambda text: "[]", "holds no reconstruction with shots"),
    (write_opensfm, "opensfm/reconstruction.json", lambda text: text.replace("brown", "dual"), "a dual camera"),
    (write_record3d, "metadata", lambda text: text.replace("poses", "p"), "lacks a value of the scan"),
]


@pytest.mark.parametrize(("write", "file", "damage", "words"), DAMAGES)
def test_damage_is_named(tmp_path, write, file, damage, words):
    rig = rig_of((), False, True)
    write(tmp_path, rig)
    put_photos(tmp_path / "images", NAMES, rig)
    put_photos(tmp_path / "rgb", [f"{number}.jpg" for number in range(5)], rig)
    put(tmp_path / file, damage((tmp_path / file).read_text()).encode())
    with pytest.raises(DataError, match=f"{PurePosixPath(file).name}.*{words}"):
        open_capture(tmp_path / file)


# --------------------------------------------------------------------------------------------------------------- lenses
LENSES = {
    "FOV": (field_of_view(0.9), 1.0),
    "FOV of a flat lens": (field_of_view(1e-9), 1.2),
    "division": (division(-0.08), 1.0),
    "EUCM": (unified(0.6, 1.1), 1.1),
    "six fisheye terms": (polynomial((0.01, -0.004, 0.001, 0.0003, -0.0001, 0.00002)), 1.2),
}


@pytest.mark.parametrize("name", LENSES)
def test_radial_lenses_are_fisheye_lenses_to_a_fraction_of_a_pixel(name):
    distance, corner = LENSES[name]
    factor, coefficients = fit_fisheye("the lens", distance, corner)
    angles = np.linspace(0.01, np.pi / 2 * 0.9, 200)
    truth, found = distance(angles), factor * polynomial(coefficients)(angles)
    inside = truth <= corner
    assert np.abs(found - truth)[inside].max() * 2000 < 0.3  # pixels at a focal length of 2000
