"""NeRFs of other programs are imported without running code, and aligned as their own loaders align them."""

import pickle
import re
import zipfile
from collections import OrderedDict
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from blender_tests.engine.reference import checkpoints
from blender_tests.engine.reference.checkpoints import OCTAVES, Trap, layers, vanilla_state, write_arrays
from blender_tests.engine.reference.memory import little_memory
from blender_tests.engine.reference.nerf import flexible, vanilla
from blender_tests.engine.reference.still_life import camera_at, cameras
from karf_engine.capture.capture import View
from karf_engine.errors import DataError
from karf_engine.fields.nerf.importing import candidate_alignments, read_nerf
from karf_engine.fields.rendering.rays import camera_rays
from karf_engine.project.settings import NerfSettings

POINT, DIRECTION = np.array([0.3, -0.7, 0.2]), np.array([0.6, 0.0, -0.8])


def flexible_state(seed, n_layers, skip_every=4, width=12):
    sizes = {"layer1": (checkpoints.N_POSITION, width)}
    for n in range(n_layers - 1):
        joins = n % skip_every == 0 and 0 < n < n_layers - 1
        sizes[f"layers_xyz.{n}"] = (width + checkpoints.N_POSITION * joins, width)
    sizes |= {"fc_feat": (width, width), "fc_alpha": (width, 1), "fc_rgb": (width // 2, 3)}
    return layers(sizes | {"layers_dir.0": (width + checkpoints.N_DIRECTION, width // 2)}, seed)


def assert_computes(network, reference, state, *arguments):
    """Raw density, features and color at the point are those of a reference program with these weights."""
    weights = {name: value.double().numpy() for name, value in state.items()}
    hidden = network.hidden(torch.from_numpy(POINT).float()[None])
    features = network.features(hidden)
    color = network.color(features, torch.from_numpy(DIRECTION).float()[None])
    found = network.raw_density(hidden)[0].item(), features[0].detach(), color[0].detach()
    for value, expected in zip(found, reference(weights, POINT, DIRECTION, OCTAVES, *arguments), strict=True):
        assert_allclose(value, expected, atol=1e-5)


def reject(path):
    with pytest.raises(DataError) as caught:
        read_nerf(path)
    assert str(path) in caught.value.sentence and caught.value.hint
    return caught.value


@pytest.mark.parametrize(
    ("zipped", "prefix", "has_fine"), [(True, "", True), (True, "module.", True), (False, "", True), (True, "", False)]
)
def test_nerf_pytorch_checkpoint_computes_as_that_program(tmp_path, zipped, prefix, has_fine):
    states = vanilla_state(1), vanilla_state(2 if has_fine else 1)  # a missing fine network is a copy of the coarse one
    optimizer = torch.optim.Adam([torch.nn.Parameter(torch.ones(3))])
    content = {"global_step": 200_000, "optimizer_state_dict": optimizer.state_dict()}
    for name, state in zip(("network_fn_state_dict", "network_fine_state_dict"), states, strict=True):
        content[name] = {prefix + key: value for key, value in state.items()}
    if not has_fine:
        content["network_fine_state_dict"] = None
    torch.save(content, tmp_path / "200000.tar", _use_new_zipfile_serialization=zipped)
    coarse, fine = read_nerf(tmp_path / "200000.tar")
    assert coarse is not fine
    for network, state in zip((coarse, fine), states, strict=True):
        assert network.shape.skips == (5,) and not network.shape.linear_first
        assert_computes(network, vanilla, state)


@pytest.mark.parametrize("n_layers", [4, 8])
def test_krrish94_checkpoint_computes_as_that_program(tmp_path, n_layers):
    states = flexible_state(1, n_layers), flexible_state(2, n_layers)
    content = {"iter": 5, "model_coarse_state_dict": states[0], "model_fine_state_dict": states[1]}
    content |= {"loss": torch.tensor(0.1), "psnr": np.float64(25.0)}  # its training script saves them too
    torch.save(content, tmp_path / "checkpoint5.ckpt")
    for network, state in zip(read_nerf(tmp_path / "checkpoint5.ckpt"), states, strict=True):
        assert_computes(network, flexible, state, n_layers, 4)


def test_malicious_checkpoints_are_rejected_and_run_no_code(tmp_path):
    trap = Trap(tmp_path / "sprung")
    for name, zipped in (("a.tar", True), ("b.ckpt", False)):
        content = {"network_fn_state_dict": vanilla_state(1), "evil": trap}
        torch.save(content, tmp_path / name, _use_new_zipfile_serialization=zipped)
        assert "cannot be read as a checkpoint of numbers alone" in reject(tmp_path / name).sentence
    (tmp_path / "c.tar").write_bytes(pickle.dumps(trap, 2))
    reject(tmp_path / "c.tar")
    write_arrays(tmp_path / "model_1.npy", [trap])
    error = reject(tmp_path / "model_1.npy")
    assert "as bmild/nerf writes" in error.sentence
    assert "python -m tools.convert_bmild MODEL.npy OUT.tar" in f"{error.sentence} {error.hint}"
    assert not trap.folder.exists()
    pickle.loads(pickle.dumps(trap))  # shows that the trap works
    assert trap.folder.exists()


class Bytes:
    def __reduce__(self):
        return bytearray, (3 << 30,)


def save_compressed_zeros(path):
    plain = path.with_suffix(".plain")
    torch.save({"network_fn_state_dict": {"a": torch.zeros(20_000_000)}}, plain)
    with zipfile.ZipFile(plain) as source, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed:
        for name in source.namelist():
            packed.writestr(name, source.read(name))
    plain.unlink()


def saver(content, name="network_fn_state_dict", **options):
    return lambda path: torch.save({name: content}, path, **options)


def save_cut_off(path):
    saver(vanilla_state(1))(path)
    path.write_bytes(path.read_bytes()[:-60])


def weights(value):
    return OrderedDict({f"{layer}_linears.0.weight": value for layer in ("pts", "views")})


BLIND = {name: value for name, value in vanilla_state(1).items() if "views" not in name}
DEEP = vanilla_state(1) | layers({"views_linears.1": (6, 6)}, 0)
INFINITE = vanilla_state(1) | {"rgb_linear.bias": torch.tensor([0, torch.inf, 0])}
BYTEARRAY = "asks for (__builtin__|builtins).bytearray"
REJECTED = [
    (Path.exists, "does not exist"),
    (lambda path: path.symlink_to("/dev/zero"), "is a pipe or a device, not a file"),
    (save_cut_off, "cannot be read"),
    (saver(torch.ones(3), "weights"), "no networks under a name known here"),
    (saver(BLIND), r"views_linears\.0\.weight"),
    (saver(DEEP), "a network of another kind"),
    (saver(INFINITE), "not finite"),
    (saver({"a": Bytes()}), BYTEARRAY),
    (saver({"a": Bytes()}, _use_new_zipfile_serialization=False), BYTEARRAY),
    (saver(weights(torch.zeros(1).expand(30_000, 30_000))), "repeat a few numbers"),
    (saver(weights(torch.zeros(60_000, 0))), "a network of another kind"),
    (save_compressed_zeros, "records are packed"),
]


@pytest.mark.parametrize(("make", "words"), REJECTED)
def test_invalid_checkpoints_are_rejected_with_little_memory(tmp_path, make, words):
    make(tmp_path / "a.tar")
    with little_memory():
        assert re.search(words, reject(tmp_path / "a.tar").sentence)


BOUNDS = (1.2, 30.0)
CORNERS = torch.tensor([0, 31, 32 * 23, 32 * 24 - 1])


def views_at(poses, shifts):
    """Views with these poses [4, 4], moved by these shifts [3]."""
    camera, views = replace(camera_at(0, 0), height=24), []
    for pose, shift in zip(poses, shifts, strict=True):
        pose[:3, 3] += shift
        views.append(View("v", "v", replace(camera, camera_to_world=pose), None, "train", BOUNDS))
    return views


AROUND = views_at([camera.camera_to_world for camera in cameras(9)], [(3.0, -1.0, 0.5)] * 9)
FRONT = views_at([np.eye(4) for _ in range(3)], [(0.4 * n, 0.1 * n, 0.05 * n) for n in range(3)])  # look along -z


def aligned(name, views=AROUND):
    return {alignment.name: alignment for alignment in candidate_alignments(views, NerfSettings())}[name]


def relative_to(up, z, center, poses):
    """Poses [n, 4, 4] in the frame at this center with this z axis and a y axis near up."""
    z = z / np.linalg.norm(z)
    x = np.cross(up, z)
    x /= np.linalg.norm(x)
    frame = np.eye(4)
    frame[:3] = np.stack([x, np.cross(z, x), z, center], 1)
    return np.linalg.inv(frame) @ poses


def recentered(poses):
    """LLFF's recentering of poses [n, 4, 4], scaled so that the nearest depth becomes 1 / 0.75."""
    scaled = poses.copy()
    scaled[:, :3, 3] /= 0.75 * BOUNDS[0]
    return relative_to(scaled[:, :3, 1].sum(0), scaled[:, :3, 2].sum(0), scaled[:, :3, 3].mean(0), scaled)


def spherified(poses):
    poses = recentered(poses)
    origins, axes = poses[:, :3, 3:], poses[:, :3, 2:3]
    projectors = np.eye(3) - axes * axes.transpose(0, 2, 1)
    center = np.linalg.solve(projectors.mean(0), (projectors @ origins).mean(0))[:, 0]
    result = relative_to([0.1, 0.2, 0.3], (poses[:, :3, 3] - center).mean(0), center, poses)
    result[:, :3, 3] /= np.sqrt((result[:, :3, 3] ** 2).sum(1).mean())
    return result


@pytest.mark.parametrize(("name", "reference"), [("LLFF recentered", recentered), ("LLFF spherified", spherified)])
def test_cameras_lie_where_llffs_loader_puts_them(name, reference):
    poses, space = reference(np.stack([view.camera.camera_to_world for view in AROUND])), aligned(name).space
    for view, pose in zip(AROUND, poses, strict=True):
        rays = camera_rays(view.camera)[CORNERS]
        expected = camera_rays(replace(view.camera, camera_to_world=pose))[CORNERS]
        origins, directions = space.to_grid_rays(rays)
        assert_allclose(origins, expected.origins, atol=1e-4)
        assert_allclose(space.rotate_directions(rays.viewdirs), expected.viewdirs, atol=1e-5)
        lengths = torch.linalg.norm(directions, dim=1)
        assert_allclose(lengths, lengths.mean().expand(4), rtol=1e-5)


def test_near_and_far_scale_with_the_world():
    for name in ("LLFF recentered", "LLFF spherified", "as it is, LLFF's bounds"):
        assert (aligned(name).near, aligned(name).far) == pytest.approx((0.9 * BOUNDS[0], BOUNDS[1]))
    scaled = aligned("scaled")
    _, directions = scaled.space.to_grid_rays(camera_rays(AROUND[0].camera)[CORNERS])
    length = float(torch.linalg.norm(directions[0]))
    assert (scaled.near * length, scaled.far * length) == pytest.approx((2, 6), rel=1e-5)


def test_ndc_follows_from_recentered_poses():
    """As in NeRF, appendix C, with the near plane at 1 after scaling."""
    poses = recentered(np.stack([view.camera.camera_to_world for view in FRONT]))
    space = aligned("LLFF in NDC", FRONT).space
    for view, pose in zip(FRONT, poses, strict=True):
        camera = view.camera
        first, step = space.to_grid_rays(camera_rays(camera)[CORNERS])
        rays = camera_rays(replace(camera, camera_to_world=pose))[CORNERS]
        origins, directions = rays.origins.double().numpy(), rays.viewdirs.double().numpy()
        origins = origins - ((1 + origins[:, 2]) / directions[:, 2])[:, None] * directions
        ox, oy, oz = origins.T
        dx, dy, dz = directions.T
        ax, ay = -2 * camera.fx / camera.width, -2 * camera.fy / camera.height
        assert_allclose(first, np.stack([ax * ox / oz, ay * oy / oz, 1 + 2 / oz], 1), atol=1e-4)
        expected = np.stack([ax * (dx / dz - ox / oz), ay * (dy / dz - oy / oz), -2 / oz], 1)
        assert_allclose(step, expected, atol=1e-4)
        # the points of the ray are on that line
        along = torch.from_numpy(camera.camera_to_world[:3, 3]).float() + 7.0 * camera_rays(camera)[CORNERS].viewdirs
        offset = space.to_grid(along) - first
        assert_allclose(torch.linalg.cross(offset, step), np.zeros((4, 3)), atol=1e-4)


def test_llff_alignments_require_depth_bounds():
    views = [replace(view, depth_bounds=None) for view in AROUND]
    alignments = candidate_alignments(views, NerfSettings(near=0.5, far=3.0))
    names = [alignment.name for alignment in alignments]
    assert names == ["as it is, near and far as set", "as it is, near 2 and far 6", "scaled"]
    assert alignments[0].far == 3.0
