"""Inspecting a capture before training: flaws are found, named and drawn, without false alarms."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from blender_tests.engine.reference import still_life
from karf_engine import KarfError, inspect_capture, open_capture
from karf_engine.capture.advice import advise
from karf_engine.capture.inspection import inspect_capture as inspect_opened
from karf_engine.capture.inspection import solve_exposures
from karf_engine.capture.placement import measure_placement
from karf_engine.cli import main
from karf_engine.io.images import read_photo, write_png
from karf_engine.worker.queries import QUERIES
from karf_engine.worker.queries.session import Session

SIZE = 120


def textured(points):
    """Smooth noise as color of points on a ball, with features to match."""
    random = np.random.default_rng(3)
    waves = random.normal(0, 9, (40, 3)), random.uniform(0, 6, 40), random.uniform(-1, 1, (40, 3))
    return (0.5 + 0.08 * np.sin(points @ waves[0].T + waves[1]) @ waves[2]).clip(0.05, 0.95)


def photo(camera):
    """The unit ball at the origin in front of gray, [H, W, 3]."""
    origins, along = camera.rays(camera.pixel_centers())
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    middle = -(origins * along).sum(1)
    inside = 1 - ((origins + middle[:, None] * along) ** 2).sum(1)
    hit = inside > 0
    color = np.full((len(along), 3), 0.5)
    color[hit] = textured(origins[hit] + (middle - np.sqrt(inside.clip(0)))[hit, None] * along[hit])
    return color.reshape(camera.height, camera.width, 3)


def write(folder, cameras, photos):
    frames = []
    for n, (camera, picture) in enumerate(zip(cameras, photos, strict=True)):
        frames.append({"file_path": f"p_{n:02d}.png", "transform_matrix": camera.camera_to_world.tolist()})
        write_png(folder / f"p_{n:02d}.png", picture)
    lens = {"fl_x": cameras[0].fx, "fl_y": cameras[0].fy, "w": SIZE, "h": SIZE, "cx": SIZE / 2, "cy": SIZE / 2}
    (folder / "transforms.json").write_text(json.dumps(lens | {"frames": frames}))
    return folder


@pytest.fixture(scope="module")
def cameras():
    return [still_life.camera_at(2 * np.pi * n / 20, 0.4, SIZE) for n in range(20)]


@pytest.fixture(scope="module")
def photos(cameras):
    return [photo(camera) for camera in cameras]


@pytest.fixture(scope="module")
def ring(cameras, photos, tmp_path_factory):
    return write(tmp_path_factory.mktemp("ring"), cameras, photos)


def test_good_ring_has_no_findings(ring):
    advice = inspect_capture(ring)
    assert not advice.is_poor and not advice.findings and advice.psnr > 28
    assert advice.sentence.startswith("20 photos: new views will have about")


def test_blurred_photo_is_named(cameras, photos, tmp_path):
    blurred = [cv2.GaussianBlur(each, (0, 0), 2.0) if n == 7 else each for n, each in enumerate(photos)]
    (finding,) = inspect_capture(write(tmp_path, cameras, blurred)).findings
    assert finding.values["names"] == "p_07" and "sharp" in finding


def test_query_names_blurred_photos_until_they_are_left_out(cameras, photos, tmp_path):
    blurred = [cv2.GaussianBlur(each, (0, 0), 2.0) if n == 7 else each for n, each in enumerate(photos)]
    capture = str(write(tmp_path, cameras, blurred))
    for without, named in (([], ["p_07"]), (["p_07"], [])):
        answer = QUERIES["inspect"](Session(tmp_path), {"capture": capture, "without": without})
        assert answer["blurred"] == named


def test_darker_and_warmer_photos_are_named(cameras, photos, tmp_path):
    changed = list(photos)
    changed[3] = photos[3] * 0.75
    changed[12] = photos[12] * (1.1, 1.0, 0.85)
    findings = inspect_capture(write(tmp_path, cameras, changed)).findings
    names = {each.key.split(":")[0]: each.values["names"] for each in findings}
    assert names["Exposed otherwise than the rest, by up to {stops} stops"] == "p_03"
    assert "p_12" in names["Of another white balance than the rest"]


def test_solved_exposures_match_the_given_ones():
    wanted = np.array([[0.5, 0.4, 0.6], [-0.2, 0.0, -0.1], [-0.3, -0.4, -0.5]])
    pairs = [(0, 1), (1, 2), (0, 2)]
    stops = np.array([wanted[b] - wanted[a] for a, b in pairs])
    np.testing.assert_allclose(solve_exposures(3, pairs, stops), wanted, atol=1e-3)


def test_widest_hole_is_where_photos_are_missing(cameras):
    placement = measure_placement(cameras[:4] + cameras[7:], np.zeros((0, 3)))
    width, middle = placement.hole
    assert width == pytest.approx(72 * np.cos(0.4), rel=0.1)  # four steps of 18 degrees, at this elevation
    missing = cameras[5].position / np.linalg.norm(cameras[5].position)
    assert middle @ missing > np.cos(np.radians(6))
    assert placement.beside_hole() in ([3, 4], [4, 3])


def test_suggested_photos_narrow_the_holes(cameras):
    placement = measure_placement(cameras[:12], np.zeros((0, 3)))
    extended = placement.extended(4)
    assert extended.spacing < 0.9 * placement.spacing and extended.hole[0] < placement.hole[0]


def test_one_sided_capture_counts_as_open(cameras):
    placement = measure_placement(cameras[:6], np.zeros((0, 3)))
    assert placement.is_open and placement.hole[0] < 25
    assert not measure_placement(cameras, np.zeros((0, 3))).is_open


def test_wrong_poses_lower_the_agreement(ring):
    capture = open_capture(ring)
    moved = np.random.default_rng(0).permutation(len(capture.views))
    mixed = tuple(replace(view, camera=capture.views[n].camera) for view, n in zip(capture.views, moved, strict=True))
    right, wrong = (inspect_opened(each) for each in (capture, replace(capture, views=mixed)))
    assert wrong.agreed < 0.5 < 0.7 < right.agreed and advise(wrong).is_poor


def test_thin_marks_are_named(ring, tmp_path):
    for name, width in (("wire", 2), ("pot", 40)):
        mask = np.zeros((SIZE, SIZE), bool)
        mask[20:100, 30 : 30 + width] = True
        write_png(tmp_path / name / "p_01.png", mask)
    (finding,) = inspect_capture(ring, masks=tmp_path).findings
    assert finding.values["name"] == "wire" and finding.values["share"] == "100"


def test_command_and_query_agree_and_write_the_map(ring, tmp_path, capsys):
    assert main(["inspect", str(ring), "--out", str(tmp_path)]) == 0
    printed = capsys.readouterr().out.splitlines()
    content = json.loads((tmp_path / "inspection.json").read_text())
    assert printed == [content["sentence"], *content["findings"]] and len(content["figures"]["sharpness"]) == 20
    answer = QUERIES["inspect"](Session(tmp_path), {"capture": str(ring)})
    assert len(answer["advice"]) == len(printed) and not answer["is_poor"]
    drawn = read_photo(tmp_path / "more_photos.png")
    orange = (drawn[..., 0] - drawn[..., 2] > 0.6).sum()
    assert (read_photo(Path(answer["picture"])) == drawn).all() and orange > 500


def test_missing_masks_and_too_few_photos_are_rejected(ring, cameras, photos, tmp_path):
    with pytest.raises(KarfError, match="is no folder of masks"):
        inspect_capture(ring, masks=tmp_path / "none")
    with pytest.raises(KarfError, match="has 2 photos"):
        inspect_capture(write(tmp_path, cameras[:2], photos[:2]))
