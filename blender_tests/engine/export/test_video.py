"""A video shows the pictures that it was given."""

import builtins

import numpy as np
import pytest

pytest.importorskip("imageio_ffmpeg")

import imageio.v2 as imageio

from karf_engine.errors import BadRequest, MissingDependency
from karf_engine.export.video import write_video

COLORS = [(0.8, 0.2, 0.2), (0.2, 0.8, 0.2), (0.2, 0.2, 0.8)]


def frames(size=(48, 64)):
    return (np.full((*size, 3), color, np.float32) for color in COLORS for _ in range(4))


@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
def test_frames_come_back_in_order(tmp_path, suffix):
    path = tmp_path / f"turn{suffix}"
    write_video(path, frames(), fps=12)
    with imageio.get_reader(path, format="FFMPEG") as reader:
        found = [frame.mean((0, 1)) / 255 for frame in reader]
        assert reader.get_meta_data()["fps"] == 12
    assert len(found) == 12
    np.testing.assert_allclose(found[::4], COLORS, atol=0.05)


def test_odd_sizes_are_written(tmp_path):
    write_video(tmp_path / "odd.mp4", frames((47, 63)))
    assert (tmp_path / "odd.mp4").stat().st_size > 0


@pytest.mark.parametrize(
    ("name", "given", "words"),
    [
        ("turn.gif", frames(), "not the name of a video"),
        ("turn.mp4", [], "given no frames"),
        ("turn.mp4", [np.zeros((8, 8, 3)), np.zeros((8, 9, 3))], "frames is"),
    ],
)
def test_what_is_no_video_is_refused_and_leaves_no_file(tmp_path, name, given, words):
    with pytest.raises(BadRequest, match=words):
        write_video(tmp_path / name, given)
    assert not list(tmp_path.iterdir())


def test_a_missing_encoder_is_named(tmp_path, monkeypatch):
    known = builtins.__import__

    def without(name, *rest, **more):
        if name == "imageio_ffmpeg":
            raise ImportError
        return known(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(MissingDependency, match="imageio_ffmpeg") as caught:
        write_video(tmp_path / "turn.mp4", frames())
    assert "karf[video]" in caught.value.hint
