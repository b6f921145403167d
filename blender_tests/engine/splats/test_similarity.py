"""Similarity transforms of Gaussians keep the picture for a camera that moves along."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

pytest.importorskip("numba")

from blender_tests.engine.splats.clouds import BACKGROUND, GROUPS, NEAR, camera_ahead, cloud
from karf_engine.errors import BadRequest
from karf_engine.splats.formats.splat_file import upright
from karf_engine.splats.gaussians import Gaussians
from karf_engine.splats.rasterizer import rasterize
from karf_engine.splats.similarity import transform_gaussians


def similarity(scale=1.0, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0)):
    matrix = np.eye(4)
    matrix[:3, :3] = scale * Rotation.from_rotvec(turn).as_matrix()
    matrix[:3, 3] = shift
    return matrix


MOVES = {
    "rotated": similarity(turn=(0.3, -1.2, 2.0)),
    "half turn": similarity(turn=(0, np.pi, 0)),
    "scaled": similarity(2.5),
    "shifted": similarity(shift=(5, -3, 1)),
    "all": similarity(0.2, (-2.0, 0.5, 0.1), (1, 2, 3)),
}


@pytest.mark.parametrize("name", MOVES)
@pytest.mark.parametrize("degree", range(4))
def test_scene_and_camera_moved_together_render_the_same(name, degree):
    gaussians, matrix, camera = Gaussians(cloud(degree=degree), 3, BACKGROUND, NEAR), MOVES[name], camera_ahead()
    scale = np.cbrt(np.linalg.det(matrix[:3, :3]))
    pose = matrix @ camera.camera_to_world
    pose[:3, :3] /= scale
    there = rasterize(transform_gaussians(gaussians, matrix), replace(camera, camera_to_world=pose))
    here = rasterize(gaussians, camera)
    assert here.image[..., 3].min() < 0.5
    assert_allclose(there.image, here.image, atol=1e-4)
    seen = np.diff(here.offsets) > 0
    assert_allclose(there.depths[seen], scale * here.depths[seen], rtol=1e-4)


def test_identity_shift_and_half_turn_are_exact():
    gaussians, table = Gaussians(cloud(), 3, BACKGROUND, NEAR), cloud(40)
    assert transform_gaussians(gaussians, np.eye(4)) is gaussians
    assert_array_equal(transform_gaussians(gaussians, MOVES["shifted"]).table[:, 3:], gaussians.table[:, 3:])
    there = upright(table)
    assert_array_equal(there[:, :3], table[:, :3] * [1, -1, -1])
    assert_array_equal(np.abs(there[:, 11:]), np.abs(table[:, 11:]))
    back = upright(there)
    back[:, GROUPS["rotation"]] *= -1  # the same rotation
    assert_array_equal(back, table)


@pytest.mark.parametrize(
    "matrix",
    [
        np.diag([1.0, 1, -1, 1]),
        np.diag([1.0, 1, 2, 1]),
        np.zeros((4, 4)),
        np.full((4, 4), np.nan),
        np.eye(4) + 0.1 * np.eye(4, k=1),
    ],
    ids=["mirror", "unequal", "zero", "nan", "shear"],
)
def test_non_similarity_matrices_are_rejected(matrix):
    with pytest.raises(BadRequest, match="uniform scale"):
        transform_gaussians(Gaussians(cloud(), 3, BACKGROUND, NEAR), matrix)
