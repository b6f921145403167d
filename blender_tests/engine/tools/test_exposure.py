"""The judge of exposures: photos that are darkened on purpose, and what it counts between views."""

import json

import imageio.v3 as iio
import numpy as np
import pytest

from karf_engine.capture.camera import Camera
from karf_engine.errors import BadRequest
from karf_engine.io.color import ciede2000, srgb_to_lab
from karf_engine.io.files import write_json
from tools.judging.exposed_captures import ExposedCapture, exposed
from tools.judging.exposure import between_views
from tools.metrics.consistency import DepthView

PAINT = np.random.default_rng(0).uniform(0.3, 0.7, (12, 12, 3))
TRAIN, TEST = [f"r_{number:03d}" for number in range(8)], ["r_000", "r_001"]


@pytest.fixture
def source(tmp_path):
    """A capture of eight training photos, the second of which is marked, and two test photos with true recolors."""
    folder = tmp_path / "source"
    photos = {"train": TRAIN, "test": TEST, "recolor/new/train": TRAIN[1:2], "recolor/new/test": TEST}
    for place, stems in (photos | {"coarse_masks/one/pot": TRAIN[1:2]}).items():
        (folder / place).mkdir(parents=True)
        for stem in stems:
            iio.imwrite(folder / place / f"{stem}.png", np.rint(255 * PAINT).astype(np.uint8))
    for split, stems in (("train", TRAIN), ("test", TEST)):
        frames = [{"file_path": f"./{split}/{stem}"} for stem in stems]
        write_json(folder / f"transforms_{split}.json", {"camera_angle_x": 0.7, "frames": frames})
    return folder


def stems_of(folder, split):
    frames = json.loads((folder / f"transforms_{split}.json").read_text())["frames"]
    return [frame["file_path"] for frame in frames]


def test_photos_and_true_recolors_are_exposed_alike_and_by_the_gains_that_are_told(source, tmp_path):
    changed = ExposedCapture(source, tmp_path / "changed", seed=3)
    gains = changed.gains["test/r_001"]
    assert gains.max() < 1.16 and np.ptp([each[1] for each in changed.gains.values()]) > 0.1
    for place in ("test/r_001", "train/t_r_001", "recolor/new/test/r_001"):
        photo = iio.imread(changed.folder / f"{place}.png") / 255
        np.testing.assert_allclose(photo, exposed(PAINT, gains), atol=0.006)
    known = changed.known_gains(source)
    np.testing.assert_allclose(np.prod(list(known.values()), axis=0), 1)
    ratio = np.divide(known["t_r_001"], known["r_001"])
    told = exposed(np.full(3, 0.5), gains) / exposed(np.full(3, 0.5), changed.gains["train/r_001"])
    np.testing.assert_allclose(ratio, told, atol=0.02)


def test_photos_with_true_recolors_are_learned_from_and_no_marked_one_is_held_out(source, tmp_path):
    changed = ExposedCapture(source, tmp_path / "changed", seed=None)
    assert changed.recolored == ["t_r_000", "t_r_001"]
    assert stems_of(changed.folder, "test") == ["./train/r_000", "./train/r_006"]
    kept = [stem for stem in TRAIN if stem not in ("r_000", "r_006")]
    assert stems_of(changed.folder, "train") == [f"./train/{stem}" for stem in (*kept, *changed.recolored)]
    np.testing.assert_array_equal(
        iio.imread(changed.folder / "train" / "t_r_000.png"), iio.imread(source / "test" / "r_000.png")
    )


def test_photos_with_a_matte_are_refused(source, tmp_path):
    iio.imwrite(source / "train" / "r_003.png", np.zeros((12, 12, 4), np.uint8))
    with pytest.raises(BadRequest, match="has a matte"):
        ExposedCapture(source, tmp_path / "changed", seed=3)


def wall_from(x):
    """A camera that looks at a wall at distance 2, from beside."""
    pose = np.eye(4)
    pose[0, 3] = x
    camera = Camera(12, 12, 12.0, 12.0, 6.0, 6.0, pose)
    return DepthView(camera, np.full((12, 12), 2.0), np.ones((12, 12), bool))


def test_the_difference_of_two_views_is_that_of_the_means_of_what_both_show():
    walls = [wall_from(x) for x in (0.0, 0.5, 1.8)]  # of which the first two share nine columns
    red, dark = np.array([0.6, 0.2, 0.2]), np.array([0.5, 0.16, 0.16])
    pictures = [np.broadcast_to(color, (12, 12, 3)).copy() for color in (red, dark)]
    pictures[0][:, 0] = 0  # which the second view does not show
    expected = ciede2000(srgb_to_lab(red), srgb_to_lab(dark))
    assert between_views(walls[:2], pictures) == pytest.approx(expected, abs=1e-6)
    assert between_views(walls[:2], [pictures[1]] * 2) == pytest.approx(0, abs=1e-6)
    with_white = [*pictures, np.ones_like(PAINT)]
    assert between_views(walls, with_white) == pytest.approx(expected, abs=1e-6)  # which shares too little
