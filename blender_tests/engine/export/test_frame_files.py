"""Frames of new cameras as files and videos, and the record in an output folder."""

import sys

import imageio.v2 as imageio
import numpy as np
import OpenEXR
import pytest

from blender_tests.engine.reference.no_files import NO_FILES
from karf_engine.errors import BadRequest, DataError, MissingDependency
from karf_engine.export.file_names import file_paths, tokens_of
from karf_engine.export.finished_frames import RECORD_NAME, FinishedFrames
from karf_engine.export.frame_files import write_frame
from karf_engine.export.frame_options import FORMATS
from karf_engine.export.video import write_video
from karf_engine.io.color import srgb_to_linear
from karf_engine.io.files import file_digest
from karf_engine.io.images import read_photo

COLOR = np.random.default_rng(0).uniform(0, 1, (6, 5, 3)).astype(np.float32)
ALPHA = np.linspace(0.25, 1, 30, dtype=np.float32).reshape(6, 5, 1)
CLEAR = np.concatenate([COLOR, ALPHA], -1)
STEP = {"png8": 1 / 255, "png16": 1 / 65535, "exr16": 2e-3, "exr32": 1e-6}
SHADES = [(0.8, 0.2, 0.2), (0.2, 0.8, 0.2), (0.2, 0.2, 0.8)]


@pytest.mark.parametrize("kind", FORMATS)
@pytest.mark.parametrize("color", [COLOR, CLEAR], ids=["opaque", "alpha"])
def test_frames_round_trip_in_every_format(tmp_path, kind, color):
    path = tmp_path / f"frame{FORMATS[kind]}"
    write_frame(path, color, kind)
    # premultiplied colors come back less exactly
    np.testing.assert_allclose(read_photo(path), color, atol=STEP[kind] * (4 if "exr" in kind else 1))


def test_exr_holds_premultiplied_linear_light(tmp_path):
    write_frame(tmp_path / "a.exr", CLEAR, "exr32")
    channels = OpenEXR.File(str(tmp_path / "a.exr")).channels()
    np.testing.assert_allclose(channels["RGBA"].pixels[..., :3], srgb_to_linear(COLOR) * ALPHA, atol=1e-6)


def test_invalid_lines_of_a_record_are_skipped(tmp_path):
    lines = ["[" * 100_000, "{", "3", '{"frame": "b"}', '{"frame": "a", "made_from": "x", "files": {}}']
    (tmp_path / RECORD_NAME).write_text("\n".join(lines))
    assert list(FinishedFrames.read(tmp_path).frames) == ["a"]


@pytest.mark.parametrize(
    ("pattern", "paths"),
    [
        ("recolor/{view}", ["recolor/photo_07", "recolor/lid"]),
        ("{look}/pot.{frame}", ["Warm/pot.07", "Warm/pot.lid"]),
        ("{view}_{look}", ["photo_07_Warm", "lid_Warm"]),
    ],
)
def test_file_names_replace_tokens(pattern, paths):
    assert file_paths(pattern, [{"look": "Warm", **tokens_of(view)} for view in ("photo_07", "lid")]) == paths


@pytest.mark.parametrize(
    ("pattern", "words"),
    [
        ("{look}/{view}", "'{look}/{view}'.*{view}, {frame}"),
        ("../{view}", "'../{view}'"),
        ("Masks/{view}", "'Masks/{view}'.*begin with render, masks"),
        ("all", "two pictures the path 'all'"),
        ("{frame}", "two pictures the path"),  # of a_1 and b_1
    ],
)
def test_file_names_that_leave_the_folder_or_meet_are_refused(pattern, words):
    with pytest.raises(BadRequest, match=words):
        file_paths(pattern, [tokens_of(view) for view in ("a_1", "b_1")])


@pytest.mark.parametrize("make", NO_FILES)
@pytest.mark.parametrize("read", [lambda path: FinishedFrames.read(path.parent), file_digest])
def test_record_that_is_not_a_file_is_rejected(make, read, tmp_path):
    make(tmp_path / RECORD_NAME)
    with pytest.raises(DataError, match="not a file"):
        read(tmp_path / RECORD_NAME)


def frames(size=(48, 64)):
    return (np.full((*size, 3), color, np.float32) for color in SHADES for _ in range(4))


@pytest.mark.parametrize(("suffix", "size"), [(".mp4", (48, 64)), (".mkv", (48, 64)), (".mp4", (47, 63))])
def test_video_keeps_frames_in_order(tmp_path, suffix, size):
    pytest.importorskip("imageio_ffmpeg")
    path = tmp_path / f"turn{suffix}"
    write_video(path, frames(size), fps=12)
    with imageio.get_reader(path, format="FFMPEG") as reader:
        found = [frame.mean((0, 1)) / 255 for frame in reader]
        assert reader.get_meta_data()["fps"] == 12
    assert len(found) == 12
    np.testing.assert_allclose(found[::4], SHADES, atol=0.05)


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("turn.gif", frames(), "not the name of a video"),
        ("turn.mp4", [], "given no frames"),
        ("turn.mp4", [np.zeros((8, 8, 3)), np.zeros((8, 9, 3))], "frames is"),
    ],
)
def test_impossible_video_is_rejected_and_leaves_no_file(tmp_path, name, given, words):
    pytest.importorskip("imageio_ffmpeg")
    with pytest.raises(BadRequest, match=words):
        write_video(tmp_path / name, given)
    assert not list(tmp_path.iterdir())


def test_missing_encoder_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "imageio_ffmpeg", None)
    with pytest.raises(MissingDependency, match="imageio_ffmpeg") as caught:
        write_video(tmp_path / "turn.mp4", frames())
    assert "karf[video]" in caught.value.hint
