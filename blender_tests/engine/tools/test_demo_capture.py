"""The committed demo capture holds what its README says: photos, labels, depth, true recolors and coarse masks."""

from __future__ import annotations

import json
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest

DEMO = Path(__file__).resolve().parents[3] / "demo"
VIEWS = {"train": 60, "test": 12}
SIZE = 256
EIGHT_MEGABYTES = 8 * 1000 * 1000


def read_json(name: str):
    return json.loads((DEMO / name).read_text(encoding="utf-8"))


def read_labels(split: str, stem: str) -> np.ndarray:
    return iio.imread(DEMO / "labels" / split / f"{stem}.png", mode="P")


def read_float(path: Path) -> np.ndarray:
    return iio.imread(path).astype(float)


def frames(split: str) -> list[dict]:
    return read_json(f"transforms_{split}.json")["frames"]


def coarse_masks() -> list[tuple[str, Path]]:
    return [(path.parent.name, path) for path in sorted((DEMO / "coarse_masks").glob("*/*/*.png"))]


@pytest.mark.parametrize("split", VIEWS)
def test_every_frame_has_a_photo_and_labels_of_the_stated_size(split):
    stems = [f"r_{number:03d}" for number in range(VIEWS[split])]
    assert [frame["file_path"] for frame in frames(split)] == [f"./{split}/{stem}" for stem in stems]
    for stem in stems:
        photo = iio.imread(DEMO / split / f"{stem}.png")
        assert photo.shape == (SIZE, SIZE, 3) and photo.dtype == np.uint8
        labels = read_labels(split, stem)
        assert labels.shape == (SIZE, SIZE) and labels.max() <= 3
    assert len(list((DEMO / split).iterdir())) == len(list((DEMO / "labels" / split).iterdir())) == VIEWS[split]


@pytest.mark.parametrize("split", VIEWS)
def test_cameras_are_rigid_and_look_at_the_still_life(split):
    for frame in frames(split):
        camera_to_world = np.array(frame["transform_matrix"])
        rotation, position = camera_to_world[:3, :3], camera_to_world[:3, 3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-5)
        assert np.linalg.det(rotation) > 0
        closest = position - rotation[:, 2] * (position @ rotation[:, 2])
        assert np.linalg.norm(closest) < 0.5


def test_no_test_direction_is_a_training_direction():
    sides = {split: np.array([f["transform_matrix"] for f in frames(split)])[:, :3, 2] for split in VIEWS}
    nearest = np.degrees(np.arccos(np.clip(sides["test"] @ sides["train"].T, -1, 1))).min(1)
    assert nearest.min() > 3.0 and nearest.max() < 30.0


def test_every_object_is_seen_in_most_views():
    names = read_json("labels/names.json")
    assert names == {"pot": 1, "mug": 2, "apple": 3}
    for object_id in names.values():
        seen = [(read_labels("train", f"r_{n:03d}") == object_id).sum() > 300 for n in range(VIEWS["train"])]
        assert np.mean(seen) > 0.9


def test_depth_unprojects_to_the_table_top_and_never_below_the_table():
    focal = 0.5 * SIZE / np.tan(0.5 * read_json("transforms_test.json")["camera_angle_x"])
    rows, columns = np.mgrid[:SIZE, :SIZE] + 0.5
    for frame in frames("test"):
        steps = iio.imread(DEMO / "depth" / f"{frame['file_path']}.png")
        assert steps.dtype == np.uint16 and (steps == 65535).any()
        depth = steps * 0.001
        point = np.stack([(columns - SIZE / 2) / focal, (SIZE / 2 - rows) / focal, -np.ones_like(depth)]) * depth
        camera_to_world = np.array(frame["transform_matrix"])
        height = (np.tensordot(camera_to_world[2, :3], point, 1) + camera_to_world[2, 3])[steps < 65535]
        assert height.min() > -0.09 and height.max() < 1.0
        assert np.mean(np.abs(height) < 0.002) > 0.2


@pytest.mark.parametrize(("name", "path"), coarse_masks(), ids=lambda value: getattr(value, "stem", value))
def test_coarse_mask_overlaps_the_truth_as_a_rough_annotation_does(name, path):
    mask = iio.imread(path)
    assert mask.shape == (SIZE, SIZE) and set(np.unique(mask)) == {0, 255}
    truth = read_labels("train", path.stem) == read_json("labels/names.json")[name]
    overlap = ((mask > 0) & truth).sum() / ((mask > 0) | truth).sum()
    assert 0.75 <= overlap <= 0.9


def test_each_object_has_one_mask_which_is_also_among_its_three():
    for name in read_json("labels/names.json"):
        one, three = (
            {p.name: p.read_bytes() for p in (DEMO / "coarse_masks" / s / name).iterdir()} for s in ("one", "three")
        )
        assert len(one) == 1 and len(three) == 3
        assert one.items() <= three.items()


@pytest.mark.parametrize("edit", ["pot_to_blue", "mug_and_apple"])
def test_a_true_recolor_changes_its_objects_and_nearly_nothing_else(edit):
    facts, names = read_json("edits.json")["edits"][edit], read_json("labels/names.json")
    reference = DEMO / "recolor" / edit / "train" / f"{facts['reference_view']}.png"
    recolored = [*sorted((DEMO / "recolor" / edit / "test").iterdir()), reference]
    assert len(recolored) == VIEWS["test"] + 1
    for path in recolored:
        split = path.parent.name
        change = np.abs(read_float(path) - read_float(DEMO / split / path.name)).max(-1)
        labels = read_labels(split, path.stem)
        for name in facts["objects"]:
            inside = labels == names[name]
            # The cream of the mug stays, and from above it is most of what one sees.
            assert np.percentile(change[inside], 90) > 40
        assert np.median(change[~np.isin(labels, [names[name] for name in facts["objects"]])]) <= 2


def test_the_whole_capture_stays_within_eight_megabytes():
    assert sum(path.stat().st_size for path in DEMO.rglob("*") if path.is_file()) <= EIGHT_MEGABYTES
