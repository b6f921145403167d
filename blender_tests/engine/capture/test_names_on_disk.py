"""Photos, masks and models are found although disks, programs and archives write their names differently."""

import unicodedata

import numpy as np
import pytest
from PIL import Image

from blender_tests.engine.reference.capture_files import (
    frames_of,
    put_json,
    put_photos,
    random_rig,
    write_colmap,
    write_transforms,
)
from karf_engine.capture import open_capture
from karf_engine.errors import DataError
from karf_engine.io.matching import mask_stems
from karf_engine.segmentation.coarse_masks import find_masks

NAMES = [f"IMG_{number}.jpg" for number in range(6)]
RIG = random_rig(3, 6)


def decomposed(name):
    return unicodedata.normalize("NFD", name)


def write_capture(folder, layout, names, on_disk):
    """Write a capture whose camera file has `names` and whose photos are `on_disk`, paths below the folder."""
    if layout == "colmap":
        write_colmap(folder / "written", RIG, names)
        (folder / "written" / "sparse").rename(folder / "sparse")
    else:
        put_json(folder / "transforms.json", {"fl_x": 30.0, "frames": frames_of([f"images/{n}" for n in names], RIG)})
    put_photos(folder, on_disk, RIG)


ON_DISK = {  # what the disk calls the photo that the camera file calls NAME
    "as it is": lambda name: f"images/{name}",
    "another case": lambda name: f"images/{name.upper()}",
    "a folder of another case": lambda name: f"Images/{name}",
    "another format": lambda name: f"images/{name.replace('.jpg', '.png')}",
    "another format and case": lambda name: f"images/{name.lower().replace('.jpg', '.PNG')}",
    "reduced copies alone": lambda name: f"images_4/{name}",
    "decomposed letters": lambda name: f"images/{decomposed(name)}",
}


@pytest.mark.parametrize("layout", ["colmap", "transforms"])
@pytest.mark.parametrize("on_disk", ON_DISK.values(), ids=ON_DISK)
def test_every_photo_gets_its_own_pose(tmp_path, layout, on_disk):
    # in decomposed form the first two sort after the others
    names = ["Église.jpg", "Vitré.jpg", *NAMES[2:]]
    write_capture(tmp_path, layout, names, [on_disk(name) for name in names])
    capture = open_capture(tmp_path)
    assert len(capture.views) == 6
    found = {view.stem.lower(): view.camera.camera_to_world for view in capture.views}
    for name, camera in zip(names, RIG, strict=True):
        np.testing.assert_allclose(found[name[:-4].lower()], camera.camera_to_world, atol=1e-9)


@pytest.mark.parametrize("layout", ["colmap", "transforms"])
def test_exact_name_wins_over_similar_ones(tmp_path, layout):
    write_capture(tmp_path, layout, NAMES, [f"images/{name}" for name in NAMES])
    put_photos(tmp_path / "images", ["img_0.jpg", "IMG_0.png", "IMG_0.JPG"])
    assert sorted(view.image.name for view in open_capture(tmp_path).views) == NAMES


@pytest.mark.parametrize("layout", ["colmap", "transforms"])
@pytest.mark.parametrize("similar", [("img_0.jpg", "Img_0.JPG"), ("IMG_0.png", "IMG_0.tif")])
def test_two_similar_names_are_rejected_by_name(tmp_path, layout, similar):
    write_capture(tmp_path, layout, NAMES, [f"images/{name}" for name in (*NAMES[1:], NAMES[1])])
    put_photos(tmp_path / "images", similar)
    with pytest.raises(DataError, match=f"IMG_0.jpg may be {min(similar)} or {max(similar)}. Remove or rename one"):
        open_capture(tmp_path)


def test_photos_are_never_paired_by_order_alone(tmp_path):
    write_capture(tmp_path, "colmap", NAMES, [f"images_4/image{number:03d}.png" for number in range(6)])
    with pytest.raises(DataError, match="none of its 6 photos was found, the first are IMG_0"):
        open_capture(tmp_path)


@pytest.mark.parametrize("layout", ["colmap", "transforms"])
@pytest.mark.parametrize("suffix", [".HEIC", ".CR2", ".dng"])
def test_jpeg_beside_a_heic_or_raw_photo_is_used(tmp_path, layout, suffix):
    names = [name.replace(".jpg", suffix) for name in NAMES]
    write_capture(tmp_path, layout, names, [f"images/{name}" for name in NAMES])
    for name in names:
        (tmp_path / "images" / name).write_bytes(b"no program needs to read it")
    assert [view.image.suffix for view in open_capture(tmp_path).views] == [".jpg"] * 6


def test_names_of_model_files_may_have_another_case(tmp_path):
    write_colmap(tmp_path, RIG, NAMES)
    (tmp_path / "sparse").rename(tmp_path / "Sparse")
    for path in (tmp_path / "Sparse" / "0").iterdir():
        path.rename(path.with_name(path.name.capitalize()))
    assert len(open_capture(tmp_path).views) == 6 and len(open_capture(tmp_path).points) == 6
    (tmp_path / "nerf").mkdir()
    write_transforms(tmp_path / "nerf", RIG, NAMES)
    (tmp_path / "nerf" / "transforms.json").rename(tmp_path / "nerf" / "Transforms.JSON")
    assert open_capture(tmp_path / "nerf").format == "transforms"


# ---------------------------------------------------------------------------------------------------------------- masks
@pytest.mark.parametrize(
    ("name", "stems"),
    [
        ("img.png", ["img"]),
        ("img.jpg.png", ["img.jpg", "img"]),
        ("img_mask.png", ["img_mask", "img"]),
        ("img.mask.jpg", ["img.mask", "img"]),
        ("img-Mask.jpg.png", ["img-Mask.jpg", "img-Mask", "img"]),
        ("frame.0001.png", ["frame.0001"]),
        ("_mask.png", ["_mask"]),
    ],
)
def test_mask_names_give_photo_names(name, stems):
    assert mask_stems(name) == stems


@pytest.mark.parametrize("mask", ["IMG_2.png", "IMG_2.jpg.png", "img_2_MASK.png", "IMG_2.mask.webp", "m_002.png"])
def test_mask_finds_its_photo(tmp_path, mask):
    frames = frames_of([f"images/{name}" for name in NAMES], RIG)
    frames[2]["mask_path"] = "masks/m_002.png"
    put_json(tmp_path / "transforms.json", {"fl_x": 30.0, "frames": frames})
    put_photos(tmp_path / "images", NAMES, RIG)
    (tmp_path / "marks" / "pot").mkdir(parents=True)
    Image.fromarray(np.full((RIG[0].height, RIG[0].width), 255, np.uint8)).save(tmp_path / "marks" / "pot" / mask)
    assert [found.view.name for found in find_masks(tmp_path / "marks", open_capture(tmp_path))] == ["IMG_2"]


def test_mask_belongs_to_the_closest_photo_name(tmp_path):
    names = ["a.png", "a_mask.png", "b.png", "c.png", "d.png", "e.png"]
    write_capture(tmp_path, "transforms", names, [f"images/{name}" for name in names])
    (tmp_path / "marks" / "pot").mkdir(parents=True)
    Image.fromarray(np.full((RIG[0].height, RIG[0].width), 255, np.uint8)).save(
        tmp_path / "marks" / "pot" / "a_mask.png"
    )
    assert [found.view.name for found in find_masks(tmp_path / "marks", open_capture(tmp_path))] == ["a_mask"]
