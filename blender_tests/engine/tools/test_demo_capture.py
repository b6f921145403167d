"""The demo capture has the photos, labels, depth, true recolors and coarse masks that its README states."""

import json

import imageio.v3 as iio
import numpy as np
import pytest

from blender_tests.engine.conftest import ROOT

DEMO = ROOT / "demo"
VIEWS = {"train": 60, "test": 12}
SIZE = 512
MASKS = sorted((DEMO / "coarse_masks").glob("*/*/*.png"))


def read_json(name):
    return json.loads((DEMO / name).read_text(encoding="utf-8"))


def read_labels(split, stem):
    return iio.imread(DEMO / "labels" / split / f"{stem}.png", mode="P")


FRAMES = {split: read_json(f"transforms_{split}.json")["frames"] for split in VIEWS}
POSES = {split: np.array([frame["transform_matrix"] for frame in FRAMES[split]]) for split in VIEWS}
NAMES = read_json("labels/names.json")


@pytest.mark.parametrize("split", VIEWS)
def test_every_frame_has_a_photo_and_labels(split):
    stems = [f"r_{number:03d}" for number in range(VIEWS[split])]
    assert [frame["file_path"] for frame in FRAMES[split]] == [f"./{split}/{stem}" for stem in stems]
    for stem in stems:
        photo, labels = iio.imread(DEMO / split / f"{stem}.jpg"), read_labels(split, stem)
        assert photo.shape == (SIZE, SIZE, 3) and photo.dtype == np.uint8
        assert labels.shape == (SIZE, SIZE) and labels.max() <= 3
    assert len(list((DEMO / split).iterdir())) == len(list((DEMO / "labels" / split).iterdir())) == VIEWS[split]


def test_cameras_face_the_scene_and_test_views_are_held_out():
    for poses in POSES.values():
        rotation, position, back = poses[:, :3, :3], poses[:, :3, 3], poses[:, :3, 2]
        np.testing.assert_allclose(rotation.swapaxes(1, 2) @ rotation - np.eye(3), 0, atol=1e-5)
        assert (np.linalg.det(rotation) > 0).all()
        closest = position - back * (position * back).sum(1, keepdims=True)
        assert np.linalg.norm(closest, axis=1).max() < 0.5
    nearest = np.degrees(np.arccos(np.clip(POSES["test"][:, :3, 2] @ POSES["train"][:, :3, 2].T, -1, 1))).min(1)
    assert nearest.min() > 3.0 and nearest.max() < 30.0


def test_objects_are_visible_in_most_views():
    assert NAMES == {"pot": 1, "mug": 2, "apple": 3}
    labels = np.array([read_labels("train", f"r_{number:03d}") for number in range(VIEWS["train"])])
    for object_id in NAMES.values():
        assert np.mean((labels == object_id).sum((1, 2)) > 1200) > 0.9


def test_depth_unprojects_onto_the_table():
    focal = 0.5 * SIZE / np.tan(0.5 * read_json("transforms_test.json")["camera_angle_x"])
    rows, columns = np.mgrid[:SIZE, :SIZE] + 0.5
    for frame, pose in zip(FRAMES["test"], POSES["test"], strict=True):
        steps = iio.imread(DEMO / "depth" / f"{frame['file_path']}.png")
        assert steps.dtype == np.uint16 and (steps == 65535).any()
        depth = steps * 0.001
        point = np.stack([(columns - SIZE / 2) / focal, (SIZE / 2 - rows) / focal, -np.ones_like(depth)]) * depth
        height = (np.tensordot(pose[2, :3], point, 1) + pose[2, 3])[steps < 65535]
        assert height.min() > -0.09 and height.max() < 1.0
        assert np.mean(np.abs(height) < 0.002) > 0.2


@pytest.mark.parametrize("path", MASKS, ids=lambda path: f"{path.parent.name}-{path.stem}")
def test_coarse_mask_roughly_overlaps_the_truth(path):
    mask = iio.imread(path)
    assert mask.shape == (SIZE, SIZE) and set(np.unique(mask)) == {0, 255}
    truth = read_labels("train", path.stem) == NAMES[path.parent.name]
    overlap = ((mask > 0) & truth).sum() / ((mask > 0) | truth).sum()
    assert 0.75 <= overlap <= 0.9


@pytest.mark.parametrize("name", NAMES)
def test_single_mask_is_among_the_three(name):
    folders = [DEMO / "coarse_masks" / number / name for number in ("one", "three")]
    one, three = ({path.name: path.read_bytes() for path in folder.iterdir()} for folder in folders)
    assert (len(one), len(three)) == (1, 3) and one.items() <= three.items()


@pytest.mark.parametrize("edit", ["pot_to_blue", "mug_and_apple"])
def test_true_recolor_changes_only_its_objects(edit):
    facts = read_json("edits.json")["edits"][edit]
    folder = DEMO / "recolor" / edit
    recolored = [*(folder / "test").iterdir(), folder / "train" / f"{facts['reference_view']}.jpg"]
    assert len(recolored) == VIEWS["test"] + 1
    for path in recolored:
        before, after = (iio.imread(each).astype(float) for each in (DEMO / path.relative_to(folder), path))
        change, labels = np.abs(after - before).max(-1), read_labels(path.parent.name, path.stem)
        objects = [NAMES[name] for name in facts["objects"]]
        for object_id in objects:
            # the mug's cream stays, which is most of what views from above show
            assert np.percentile(change[labels == object_id], 90) > 40
        assert np.median(change[~np.isin(labels, objects)]) <= 2


def test_demo_capture_is_below_eight_megabytes():
    assert sum(path.stat().st_size for path in DEMO.rglob("*") if path.is_file()) <= 8_000_000
