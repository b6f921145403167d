"""Captures from photos without poses: correct cameras, rejected input, and no half-written results."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("pycolmap")

import cv2
from PIL import Image

from blender_tests.engine.commands.conftest import Events
from blender_tests.engine.conftest import ROOT
from karf_engine.capture import open_capture
from karf_engine.capture.structure_from_motion import SfmResult, _sampson_errors, write_sharpest_frames
from karf_engine.cli import main
from karf_engine.commands import poses
from karf_engine.commands.dispatch import run_command
from karf_engine.commands.options import PosesOptions
from karf_engine.errors import BadRequest, Cancelled, DataError, MissingDependency
from karf_engine.io.color import to_bytes
from karf_engine.io.image_size import image_header
from karf_engine.io.images import read_photo, resize, write_png


def run(photos, out, should_stop=lambda: False, **options):
    """Run the stage with one thread; returns its events."""
    events = Events()
    run_command(PosesOptions.of(photos=photos, out=out, threads=1, **options), events, should_stop)
    return events


def pose_errors(found, truth):
    """Rotation errors in degrees and position errors relative to the camera path's radius, after Umeyama alignment."""
    true = [truth[view.stem] for view in found.views]
    here = np.array([view.camera.position for view in found.views])
    there = np.array([camera.position for camera in true])
    here, there = here - here.mean(0), there - there.mean(0)
    u, singular, vt = np.linalg.svd(there.T @ here)
    signs = np.array([1, 1, np.sign(np.linalg.det(u @ vt))])
    rotation, scale = u * signs @ vt, (singular * signs).sum() / (here**2).sum()
    cosines = [
        (np.trace(camera.camera_to_world[:3, :3].T @ rotation @ view.camera.camera_to_world[:3, :3]) - 1) / 2
        for view, camera in zip(found.views, true, strict=True)
    ]
    distances = np.linalg.norm(there - scale * here @ rotation.T, axis=1)
    return np.degrees(np.arccos(np.clip(cosines, -1, 1))), distances / np.linalg.norm(there, axis=1).max()


def write_noise(folder, count, size=128):
    """Write pictures that show nothing in common."""
    folder.mkdir()
    random = np.random.default_rng(0)
    for number in range(count):
        write_png(folder / f"{number}.png", random.integers(0, 256, size=(size, size, 3), dtype=np.uint8))
    return folder


def test_demo_photos_are_placed_near_their_true_poses(tmp_path):
    (tmp_path / "photos").mkdir()
    for photo in (ROOT / "demo" / "train").glob("*.jpg"):  # at half size, as it takes much less time
        write_png(tmp_path / "photos" / f"{photo.stem}.png", to_bytes(resize(read_photo(photo), 256, 256)))
    events = run(tmp_path / "photos", tmp_path / "capture")
    capture = open_capture(tmp_path / "capture")
    truth = {view.stem: view.camera for view in open_capture(ROOT / "demo").split("train")}
    rotations, positions = pose_errors(capture, truth)
    assert len(capture.views) >= 57 and np.mean(rotations) < 2 and np.mean(positions) < 0.03
    assert len(capture.points) > 100
    assert sorted(path.name for path in tmp_path.iterdir()) == ["capture", "photos"]
    assert sorted(path.name for path in (tmp_path / "capture").iterdir()) == ["images", "sparse"]
    last = {values["stage"]: values for kind, values in events.recorded if kind == "progress"}
    assert list(last)[-3:] == ["features", "matching", "mapping"]
    assert all(values["step"] == values["total"] for values in last.values())
    assert events.recorded[-1] == ("artifact", {"kind": "capture", "path": str(tmp_path / "capture")})


def test_rotated_photos_are_copied_upright_and_others_linked(tmp_path):
    (tmp_path / "out").mkdir()
    pixels = np.random.default_rng(1).integers(0, 256, size=(16, 32, 3), dtype=np.uint8)
    exif = Image.Exif()
    exif[0x0112] = 3
    Image.fromarray(pixels).save(tmp_path / "turned.jpg", exif=exif, quality=100)
    Image.fromarray(pixels).save(tmp_path / "turned.tif", tiffinfo={0x0112: 6})
    write_png(tmp_path / "plain.png", pixels)
    for name in ("turned.jpg", "turned.tif", "plain.png"):
        taken = tmp_path / "out" / poses._add_photo(tmp_path / name, tmp_path / "out")
        assert image_header(taken).orientation == 1
        np.testing.assert_allclose(read_photo(taken), read_photo(tmp_path / name), atol=0.2)
    assert (tmp_path / "out" / "plain.png").samefile(tmp_path / "plain.png")


def write_video(path, count):
    """Write a film of a moving pattern; every fourth frame is sharp."""
    pattern = np.random.default_rng(2).integers(0, 256, size=(120, 400, 3), dtype=np.uint8)
    pattern = cv2.resize(pattern[::6, ::6], (400, 120), interpolation=cv2.INTER_NEAREST)
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 25, (160, 120))
    for number in range(count):
        frame = pattern[:, number : number + 160]
        writer.write(frame if number % 4 == 1 else cv2.GaussianBlur(frame, (0, 0), 3))
    writer.release()
    return pattern


def test_video_gives_its_sharpest_frames(tmp_path, monkeypatch):
    pattern = write_video(tmp_path / "film.mp4", 40)
    monkeypatch.setattr("karf_engine.capture.structure_from_motion.MOST_FRAMES", 10)
    names = write_sharpest_frames(tmp_path / "film.mp4", tmp_path / "frames", lambda: False)
    assert names == [f"frame_{number:04d}.png" for number in range(1, 11)]
    for number, name in enumerate(names):
        sharp = pattern[:, 4 * number + 1 : 4 * number + 161, ::-1] / 255
        assert np.abs(read_photo(tmp_path / "frames" / name) - sharp).mean() < 0.06


def test_unrelated_photos_are_rejected_with_a_hint(tmp_path):
    with pytest.raises(DataError, match=r"Only 0 of the 5 photos of .*photos could be placed") as caught:
        run(write_noise(tmp_path / "photos", 5), tmp_path / "capture")
    assert "overlap" in caught.value.hint and "texture" in caught.value.hint
    assert [path.name for path in tmp_path.iterdir()] == ["photos"]


@pytest.mark.parametrize(
    ("placed", "share", "warning"),
    [
        *((placed, 1.0, f"{placed} of the 100 photos") for placed in (30, 89)),
        (90, 1.0, None),
        (100, 0.63, "Only 63% of the matches"),
    ],
)
def test_unplaced_photos_or_bad_matches_give_a_warning(events, placed, share, warning):
    poses._judge(Path("p"), SfmResult(placed, share), 100, events)
    assert [kind for kind, _ in events.recorded] == (["warning"] if warning else [])
    assert all(warning in sentence for sentence in events.values("warning", "sentence"))


def test_too_few_placed_photos_are_rejected(events):
    with pytest.raises(DataError, match="Only 29 of the 100 photos of p could be placed"):
        poses._judge(Path("p"), SfmResult(29, 1.0), 100, events)


def test_sampson_error_is_the_shift_from_the_epipolar_line():
    random = np.random.default_rng(3)
    points = random.uniform(-1, 1, size=(200, 3)) + (0, 0, 5)
    motion = np.eye(3, 4)
    motion[:, 3] = (1, 0, 0)  # sideways: epipolar lines are the rows
    moved = points + motion[:, 3]
    first, second = points / points[:, 2:], moved / moved[:, 2:]
    np.testing.assert_allclose(_sampson_errors(motion, first, second), 0, atol=1e-12)
    # Sampson's distance shares a shift between the two pictures
    shifted = second + (0.2, 0.01, 0)
    np.testing.assert_allclose(_sampson_errors(motion, first, shifted), 0.01 / np.sqrt(2), rtol=1e-9)


def test_invalid_requests_are_rejected_before_writing(tmp_path, capsys):
    photos, damaged, film = write_noise(tmp_path / "photos", 2, 8), tmp_path / "damaged", tmp_path / "film.mp4"
    write_noise(damaged, 2, 8).joinpath("damaged.jpg").write_bytes(b"")
    film.write_bytes(b"no film at all")
    before, capture = sorted(tmp_path.rglob("*")), tmp_path / "capture"
    for error, message, options in (
        (DataError, r"damaged\.jpg is empty", {"photos": damaged}),
        (DataError, "holds 2 photos; poses need at least 3", {}),
        (DataError, r"film\.mp4 is not a video that can be read", {"photos": film}),
        (DataError, "nowhere does not exist", {"photos": tmp_path / "nowhere"}),
        (BadRequest, "already exists and is not empty", {"out": photos}),
        (BadRequest, "matching = 'all' is unknown", {"matching": "all"}),
    ):
        with pytest.raises(error, match=message):
            run(**{"photos": photos, "out": capture} | options)
    with pytest.raises(BadRequest, match="was given no out"):
        run_command(PosesOptions.of(photos=photos), Events(), lambda: False)
    assert main(["poses", str(photos), "--out", str(capture)]) == 4
    printed = capsys.readouterr().err
    assert "error: " in printed and "poses need at least 3" in printed
    assert sorted(tmp_path.rglob("*")) == before


def test_missing_pycolmap_names_the_install_command(tmp_path, monkeypatch):
    monkeypatch.setattr(poses, "find_spec", lambda _: None)
    with pytest.raises(MissingDependency, match="has no package 'pycolmap'") as caught:
        run(write_noise(tmp_path / "photos", 3, size=8), tmp_path / "capture")
    assert caught.value.hint == f"Install it there: {sys.executable} -m pip install pycolmap"


@pytest.mark.parametrize("at", ["reading photos", "reading frames", "features"])
def test_cancelled_job_leaves_nothing(tmp_path, at):
    if at == "reading frames":
        write_video(source := tmp_path / "film.mp4", 8)
    else:
        source = write_noise(tmp_path / "photos", 12 if at == "features" else 3, size=200)
    events = Events()

    def should_stop():
        return at != "features" or "features" in events.values("progress", "stage")

    with pytest.raises(Cancelled):
        options = PosesOptions.of(photos=source, out=tmp_path / "capture", threads=1)
        run_command(options, events, should_stop)
    assert list(tmp_path.iterdir()) == [source]
