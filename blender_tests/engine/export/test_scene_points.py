"""Points on the surface of a learned scene, with its colors or those of an edit."""

from dataclasses import replace

import numpy as np
import pytest

import karf_engine as karf
from blender_tests.engine.conftest import of_field, run_engine
from karf_engine.capture.sparse_points import read_points as read_ply
from karf_engine.errors import BadRequest, DataError
from karf_engine.export.scene_points import read_points, write_points

COUNT = 2000


@pytest.fixture(scope="module")
def model(learned):
    return of_field(karf.load(learned.project, device="cpu"))


@pytest.fixture(scope="module")
def points(learned, tmp_path_factory):
    out = tmp_path_factory.mktemp("points") / "scene.npz"
    done = run_engine("points", learned.project, "--out", out, "--count", COUNT, "--threads", 1)
    assert done.returncode == 0, done.stderr
    return read_points(out)


def test_points_match_the_pixels_of_a_held_out_view(model, points):
    assert 0.6 * COUNT < len(points) < 1.2 * COUNT
    np.testing.assert_allclose(np.linalg.norm(points.normals, axis=1), 1, atol=1e-3)
    np.testing.assert_allclose(points.palette_weights.sum(2), points.probabilities, atol=5e-3)
    camera = model.capture.split("test")[0].camera
    frame, (pixels, depth) = model.render(camera), camera.project(points.positions.astype(float))
    column, row = np.floor(pixels).astype(int).T
    index = np.flatnonzero((column >= 0) & (column < camera.width) & (row >= 0) & (row < camera.height) & (depth > 0))
    row, column, depth = row[index], column[index], depth[index]
    there = frame.depth[row, column]
    assert ((there > 1.1 * depth) | (there == 0)).mean() < 0.05  # few points hang in empty space
    shown = (there > 0) & (np.abs(there - depth) < 0.03 * there)
    index, row, column = index[shown], row[shown], column[shown]
    assert len(index) > 100
    assert np.median(np.abs(points.colors[index] / 255 - frame.color[row, column])) < 0.05
    for k in range(len(model.objects)):
        own = frame.probabilities[k][row, column]
        assert np.corrcoef(own, points.probabilities[index, k])[0, 1] > 0.8
    towards = camera.position - points.positions[index]
    assert (np.sum(points.normals[index] * towards, 1) > 0).mean() > 0.8


def test_ply_has_the_edited_colors(learned, model, points, tmp_path):
    edit = model.edit().becomes("ball", "#d92619", "#1f5fbf")
    edit.save(tmp_path / "edit.json")
    karf.write_points(learned.project, tmp_path / "s.ply", count=COUNT, edit=tmp_path / "edit.json", threads=1)
    written = read_ply(tmp_path / "s.ply")
    np.testing.assert_allclose(written.positions, points.positions, atol=1e-6)
    ball = points.probabilities[:, model.objects.index("ball")] > 0.9
    assert (written.colors[ball].astype(int) - points.colors[ball])[:, 2].mean() > 50
    apart = points.probabilities[:, model.objects.index("ball")] == 0
    np.testing.assert_array_equal(written.colors[apart], points.colors[apart])


@pytest.mark.parametrize(
    ("out", "more", "words"),
    [
        ("scene.obj", {}, "no file to write"),
        ("scene.npz", {"edit": "edit.json"}, "cannot be written with the edit"),
        ("scene.ply", {"count": 10}, "10 points cannot be made"),
    ],
)
def test_impossible_outputs_are_rejected(learned, tmp_path, out, more, words):
    with pytest.raises(BadRequest, match=words):
        karf.write_points(learned.project, tmp_path / out, threads=1, **more)


def test_damaged_files_are_rejected_and_older_ones_have_no_edges(points, model, tmp_path):
    write_points(tmp_path / "cut.npz", replace(points, sizes=points.sizes[:-1]))
    (tmp_path / "none.npz").write_bytes(b"PK")
    for name, words in (("cut", "contradict each other"), ("none", "surface points")):
        with pytest.raises(DataError, match=words):
            read_points(tmp_path / f"{name}.npz")
    write_points(tmp_path / "old.npz", replace(points, borders=None))
    old = read_points(tmp_path / "old.npz")
    assert old.borders is None
    with pytest.raises(DataError, match="how far"):
        old.with_edges(model.palettes, model.edit().edge(model.objects[0], choke=1).edges)


def test_edges_of_an_edit_shrink_and_grow_points(points, model):
    name, own = model.objects[0], points.probabilities.astype(float)
    edges = [model.edit().edge(name, choke=choke).edges for choke in (3, -3)]
    choked, grown = (points.with_edges(model.palettes, {name: each[name]}) for each in edges)
    assert choked.probabilities[:, 0].sum() < own[:, 0].sum() < grown.probabilities[:, 0].sum()
    for each in (choked, grown):
        np.testing.assert_allclose(each.palette_weights[:, 0].sum(1), each.probabilities[:, 0], atol=0.01)
        np.testing.assert_array_equal(each.palette_weights[:, 1:], points.palette_weights[:, 1:])
    assert points.with_edges(model.palettes, {}) is points
