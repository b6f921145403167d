"""Gaussians in other axes look the same from there: centers, shapes and the colors of every direction."""

import numpy as np
import pytest

pytest.importorskip("numba")

from blender_tests.engine.splats.formats.files import unit_cloud
from karf_engine.splats import similarity
from karf_engine.splats.formats.splat_file import upright
from karf_engine.splats.similarity import transform_table


def random_rotation(seed):
    rotation, triangle = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    rotation = rotation * np.sign(np.diag(triangle))
    return rotation * np.sign(np.linalg.det(rotation))


def shapes(table):
    """Covariances [n, 3, 3], by the formula of Kerbl et al."""
    w, x, y, z = (table[:, 6:10] / np.linalg.norm(table[:, 6:10], axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    axes = np.moveaxis(np.array(rows), 2, 0) * np.exp(table[:, None, 3:6])
    return axes @ axes.swapaxes(1, 2)


@pytest.mark.parametrize("seed", range(3))
def test_all_that_is_seen_turns(seed):
    table, rotation = unit_cloud(40).astype(np.float64), random_rotation(seed)
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = 2.5 * rotation, (1, 2, 3)
    found = transform_table(table, matrix)
    np.testing.assert_allclose(found[:, :3], 2.5 * table[:, :3] @ rotation.T + (1, 2, 3), atol=1e-12)
    np.testing.assert_allclose(shapes(found), 2.5**2 * rotation @ shapes(table) @ rotation.T, atol=1e-8)
    directions = np.random.default_rng(1).normal(size=(40, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for before, after in zip(table[:, 11:].reshape(40, 16, 3), found[:, 11:].reshape(40, 16, 3), strict=True):
        seen = similarity._harmonics(directions, 16) @ before
        np.testing.assert_allclose(similarity._harmonics(directions @ rotation.T, 16) @ after, seen, atol=3e-5)


def test_half_a_turn_is_exact():
    table = unit_cloud(40)
    there = upright(table)
    assert np.array_equal(there[:, :3], table[:, :3] * [1, -1, -1])
    assert np.array_equal(np.abs(there[:, 11:]), np.abs(table[:, 11:]))
    back = upright(there)
    back[:, 6:10] *= -1  # the same rotation
    assert np.array_equal(back, table)


@pytest.mark.parametrize(
    "matrix", [np.diag([1.0, 1, -1, 1]), np.diag([1.0, 2, 1, 1]), np.full((4, 4), np.nan), np.zeros((4, 4))]
)
def test_what_is_no_rotation_is_refused(matrix):
    with pytest.raises(ValueError, match="moved by a matrix"):
        transform_table(unit_cloud(3), matrix)
