"""Cameras that see nothing render the background, and masks of nothing give a warning or an error."""

import shutil
from dataclasses import replace

import numpy as np
import pytest
import torch

from blender_tests.engine.commands.conftest import run
from blender_tests.engine.reference.still_life import camera_at
from karf_engine.capture import write_cameras
from karf_engine.capture.camera import Camera
from karf_engine.capture.capture import View
from karf_engine.fields.nerf.field import NerfField, NerfNetwork, NerfSampling, NerfShape
from karf_engine.fields.rendering.space import Box, Contraction, Frustum
from karf_engine.fields.scene import Scene
from karf_engine.fields.voxels.field import VoxelField
from karf_engine.heads.fields import RecoloringField, SegmentationField
from karf_engine.heads.rendering import object_samples, segment_cache, weigh_cache
from karf_engine.io.images import read_mask, read_photo, write_png
from karf_engine.project.settings import RecoloringSettings, SegmentationSettings
from karf_engine.project.state import without_stage, write_state


def turned_away(distance=400.0):
    """A camera outside of the still life that looks away from it."""
    camera = camera_at(0.3, 0.5, 8, distance)
    pose = camera.camera_to_world.copy()
    pose[:3, [0, 2]] *= -1
    return replace(camera, camera_to_world=pose)


CAMERAS = {
    "looks away": turned_away(),
    "is inside": camera_at(0.3, 0.5, 8, 1e-3),
    "is near and looks away": turned_away(2.0),
    "has one pixel and looks away": Camera(1, 1, 9.0, 9.0, 0.5, 0.5, turned_away().camera_to_world),
}


def voxels(space, filled):
    occupied = torch.zeros(6, 6, 6, dtype=torch.bool)
    occupied[2:4, 2:4, 2:4] = True
    field = VoxelField(torch.tensor([-0.6, -0.6, -0.6]), 0.2, occupied, 4, space=space)
    field.raw_density.data += 9.0 if filled else -90.0
    return field


def nerf(space, filled):
    torch.manual_seed(0)
    shape = NerfShape(depth=2, width=8, skips=(), view_width=4)
    networks = [NerfNetwork(shape) for _ in range(2)]
    for network in networks:
        network.alpha_linear.bias.data.fill_(5.0 if filled else -50.0)
    return NerfField(*networks, NerfSampling(0.1, 1.0, coarse=6, fine=6), space, torch.tensor([[-1.0] * 3, [1.0] * 3]))


FRUSTUM = Frustum(torch.eye(4), torch.ones(2), 1.0, 0.5)
FIELDS = {
    "box": lambda filled: voxels(Box(), filled),
    "contraction": lambda filled: voxels(Contraction(torch.zeros(3), 1.0, 1.0, 0.1), filled),
    "frustum": lambda filled: voxels(FRUSTUM, filled),
    "NeRF": lambda filled: nerf(Box(), filled),
    "NeRF in NDC": lambda filled: nerf(FRUSTUM, filled),
}


@pytest.mark.parametrize("camera", CAMERAS.values(), ids=CAMERAS)
@pytest.mark.parametrize("filled", [True, False], ids=["scene", "emptiness"])
@pytest.mark.parametrize("make", FIELDS.values(), ids=FIELDS)
def test_every_camera_renders_every_space(make, filled, camera):
    field = make(filled).requires_grad_(False)
    picture = Scene(field, None, "white", 1.0).render(camera, 3)
    assert torch.isfinite(picture.color).all() and torch.isfinite(picture.depth).all()
    if not filled:
        assert len(picture.cache) == 0 and (picture.color == 1).all()
    boxes = torch.tensor([[[-0.5] * 3, [0.0] * 3], [[0.0] * 3, [0.5] * 3]])
    segmentation = SegmentationField(boxes, field.n_features, SegmentationSettings(width=8))
    recoloring = RecoloringField(segmentation.bounds, field.n_features, [3, 2], RecoloringSettings(width=8))
    classes = segment_cache(segmentation, field, picture.cache)
    assert classes.shape == (len(picture.cache), 3)
    planes = weigh_cache(recoloring, object_samples(segmentation, field, picture.cache), picture.cache)
    assert planes.shape == (len(picture.cache), 2, 3) and torch.isfinite(planes).all()


@pytest.mark.parametrize("last_stage", ["geometry", "segmentation", "recoloring"])
def test_camera_that_sees_nothing_does_not_end_a_render(copy, tmp_path, last_stage):
    later = {"geometry": "segmentation", "segmentation": "palette"}
    if last_stage in later:
        splats, state = copy.finished("splats"), without_stage(copy.state(), later[last_stage])
        write_state(copy.state_file, state | {"stages": state["stages"] | {"splats": splats}})
    views = [View(f"f{n}", f"f{n}", camera, None, "test") for n, camera in enumerate(CAMERAS.values())]
    write_cameras(tmp_path / "cameras.json", [*views, View("last", "last", camera_at(0.3, 0.5, 8), None, "test")])
    options = ["--views", tmp_path / "cameras.json", "--depth", "--out", tmp_path / "out", "--threads", 1]
    if last_stage == "recoloring":
        edit = tmp_path / "edit.json"
        assert run("match", copy.folder, "--object", "ball", "--from", "#c0221a", "--to", "#1ec040", "--out", edit) == 0
        options += ["--edit", edit, "--planes"]
    assert run("render", copy.folder, *options) == 0
    kind = "recolor" if last_stage == "recoloring" else "render"
    away, last = (read_photo(tmp_path / "out" / kind / f"{name}.png") for name in ("f0", "last"))
    assert (away == 0).all() and last.max() > 0.2  # the scene is before black
    if last_stage != "geometry":
        assert not read_mask(tmp_path / "out" / "masks" / "ball" / "f0.png").any()


@pytest.fixture
def misplaced(still_life, tmp_path):
    """Masks of the still life, with one pixel of the void as the ball."""
    masks = shutil.copytree(still_life.masks, tmp_path / "masks")
    shutil.rmtree(masks / "ball")
    mask = np.zeros((32, 32), bool)
    mask[0, 0] = True
    write_png(masks / "ball" / "r_0.png", mask)
    return masks


@pytest.mark.parametrize("labels", ["surface", "masks"])
def test_mask_of_nothing_leaves_other_objects_editable(still_life, misplaced, copy, tmp_path, capsys, labels):
    few = ("segmentation.iterations=40", "recoloring.iterations=10", f"segmentation.labels={labels}")
    assert run(*replace(still_life, masks=misplaced).command(copy.folder, *few)) == 0
    printed = capsys.readouterr().err
    assert "Nothing in the scene belongs to 'ball': mark it more generously, or in another view." in printed
    assert "'ball' shows only 0 pixels in all views" in printed

    edit, out = tmp_path / "edit.json", tmp_path / "out"
    colors = ("--from", "#808080", "--to", "#2ab450", "--out", edit)
    assert run("match", copy.folder, "--object", "block", *colors) == 0
    assert run("match", copy.folder, "--object", "ball", *colors, "--edit", edit) == 0
    assert run("render", copy.folder, "--views", "test", "--edit", edit, "--out", out, "--planes") == 0
    shown = {name: [read_mask(path).any() for path in (out / "masks" / name).iterdir()] for name in ("ball", "block")}
    assert any(shown["block"]) and not any(shown["ball"])


def test_masks_of_nothing_are_rejected(misplaced, copy, capsys):
    shutil.rmtree(misplaced / "block")
    assert run("segmentation", copy.folder, "--masks", misplaced) == 4
    assert "Nothing in the scene belongs to 'ball'." in capsys.readouterr().err
