"""Photos in another color space than sRGB: learned as what they show, and recolored in their own space."""

import shutil

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("PyOpenColorIO")

from karf_engine.cli import main
from karf_engine.io.color_spaces import color_space
from karf_engine.io.images import encode_image, read_photo
from karf_engine.project import Project
from karf_engine.project.contents import read_capture
from karf_engine.recolor.photos import open_photo

SPACE = "sRGB Encoded P3-D65"


@pytest.fixture(scope="module")
def wide(still_life, tmp_path_factory):
    """The still life with photos of 16 bits in a wide gamut."""
    folder = shutil.copytree(still_life.capture, tmp_path_factory.mktemp("wide") / "capture")
    for path in folder.rglob("*.png"):
        stored = color_space(SPACE).from_srgb(read_photo(path)[..., :3])
        path.write_bytes(encode_image(".png", np.rint(np.clip(stored, 0, 1) * 65535).astype(np.uint16)))
    return folder


def test_an_unknown_space_is_told_before_anything_is_learned(wide, tmp_path, capsys):
    project = tmp_path / "project"
    assert main(["geometry", str(wide), "--project", str(project), "--photo-space", "P3 sRGB"]) == 2
    told = capsys.readouterr().err
    assert "no color space 'P3 sRGB'" in told and "Nearest: " in told and SPACE in told and not project.exists()


def test_such_photos_are_recolored_as_those_in_srgb_are(still_life, learned, wide, tmp_path, capsys):
    project, edit = tmp_path / "project", tmp_path / "edit.json"
    _, _, *words = still_life.command(project, "splats.iterations=1", "recoloring.iterations=20")
    assert main(["all", str(wide), *words, "--photo-space", SPACE]) == 0
    assert {view.space.name for view in read_capture(Project(project)).views} == {SPACE}
    pictures = []
    for each, space in ((learned.project, None), (project, color_space(SPACE))):
        out = tmp_path / f"of {each.parent.name}"
        pair = ("--object", "ball", "--from", "#d92619", "--to", "#1f5fbf", "--out", edit)
        assert main(["match", *map(str, (each, *pair))]) == 0
        assert main(["render", *map(str, (each, "--views", "test_r_0", "--edit", edit, "--out", out))]) == 0
        pictures.append(read_photo(out / "recolor" / "test_r_0.png", space=space)[..., :3])
    assert np.abs(pictures[0] - pictures[1]).mean() < 0.01
    assert np.abs(pictures[0] - pictures[1]).max() < 0.1
    before, after = open_photo(wide / "test" / "r_0.png"), open_photo(out / "recolor" / "test_r_0.png")
    assert after.pixels.dtype == np.uint16
    assert 0.5 < (before.pixels == after.pixels).all(-1).mean() < 0.99
    capsys.readouterr()
    # without the option a project stays as it was learned
    settings = words[words.index("--set") :]
    assert main(["geometry", str(wide), "--project", str(project), "--threads", "1", *settings]) == 0
    assert "already done" in capsys.readouterr().err
