"""Coarse seeds become clean labels, on point clouds whose truth is known."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

pytest.importorskip("scipy")

from karf_engine.io.color import srgb_to_lab
from karf_engine.segmentation.gaussian_mixtures import class_log_densities
from karf_engine.segmentation.label_propagation import (
    AGREED_WEIGHT,
    PATTERN,
    _Propagation,
    conjugate_gradients,
    has_seeds,
    neighbor_graph,
    propagate_labels,
)

VOXEL = 0.05
RED, GREEN, BLUE, WHITE, GRAY = (0.8, 0.15, 0.1), (0.15, 0.6, 0.2), (0.15, 0.25, 0.8), (0.9, 0.9, 0.88), (0.5, 0.5, 0.5)


def sphere(center, radius, count):
    """Even points on a sphere (Fibonacci) and their normals."""
    i = np.arange(count) + 0.5
    z, angle = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    normals = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], 1)
    return center + radius * normals, normals


def plane(height, half, spacing):
    grid = np.stack(np.meshgrid(*[np.arange(-half, half, spacing)] * 2), -1).reshape(-1, 2)
    return np.column_stack([grid, np.full(len(grid), height)]), np.tile([0.0, 0.0, 1.0], (len(grid), 1))


def cloud(*parts, random):
    """Join (positions, normals, sRGB color of each point or of all) with a little noise: positions, lab, normals."""
    positions = np.concatenate([p for (p, _), _ in parts])
    normals = np.concatenate([n for (_, n), _ in parts])
    rgb = np.concatenate([np.broadcast_to(color, p.shape) for (p, _), color in parts])
    lab = srgb_to_lab(np.clip(rgb + random.normal(scale=0.01, size=rgb.shape), 0, 1))
    return positions + random.normal(scale=0.1 * VOXEL, size=positions.shape), lab, normals


def seeds_from(coarse, n_classes, seen):
    """One vote a point that is seen, for its coarse label."""
    return np.eye(n_classes)[coarse], seen * 1.0


@pytest.fixture
def random():
    return np.random.default_rng(0)


@pytest.fixture
def two_balls(random):
    """A red and a green ball that touch, on gray ground: positions, lab, normals, truth, and sloppy coarse labels."""
    parts = [(sphere([-0.5, 0, 0], 0.5, 2600), RED), (sphere([0.5, 0, 0], 0.5, 2600), GREEN)]
    ground = (plane(-0.52, 2.0, 0.07), GRAY)
    positions, lab, normals = cloud(*parts, ground, random=random)
    truth = np.repeat([1, 2, 0], [2600, 2600, len(positions) - 5200])
    # the masks are drawn from the front (y < 0) and shifted: they spill over the borders and lack a strip
    coarse = np.zeros(len(truth), int)
    shifted = positions - [0.08, 0, 0.03]
    coarse[np.linalg.norm(shifted - [-0.5, 0, 0], axis=1) < 0.56] = 1
    coarse[np.linalg.norm(shifted - [0.5, 0, 0], axis=1) < 0.52] = 2
    coarse[(positions[:, 2] > 0.38) & (positions[:, 0] < 0)] = 0  # a missing piece
    seen = (normals @ [0, -1, 0.3]) > 0.1
    return positions, lab, normals, truth, coarse, seen


def test_touching_balls_are_told_apart_in_spite_of_spill_and_a_missing_piece(two_balls, random):
    positions, lab, normals, truth, coarse, seen = two_balls
    targets, confidence = seeds_from(coarse, 3, seen)
    assert (coarse[seen] == truth[seen]).mean() < 0.93
    labels = propagate_labels(positions, lab, normals, VOXEL, targets, confidence, 4, random)
    assert (labels.classes == truth).mean() >= 0.97
    assert_allclose(labels.probabilities.sum(1), np.ones(len(truth)), atol=1e-6)
    assert (labels.precision > 0.5).all()


def test_points_far_from_every_object_are_background(two_balls, random):
    positions, lab, normals, _, coarse, seen = two_balls
    targets, confidence = seeds_from(coarse, 3, seen)
    positions = np.concatenate([positions, [[9.0, 9.0, 9.0]]])
    lab, normals = np.concatenate([lab, lab[:1]]), np.concatenate([normals, normals[:1]])
    targets, confidence = np.concatenate([targets, [[0.0, 0.5, 0.5]]]), np.append(confidence, 0.0)
    labels = propagate_labels(positions, lab, normals, VOXEL, targets, confidence, 2, random)
    assert labels.probabilities[-1].tolist() == [1, 0, 0]


@pytest.mark.parametrize(
    "ground_color",
    [
        GRAY,
        pytest.param(
            WHITE, marks=pytest.mark.xfail(strict=True, reason="stripes of exactly the ground's color are lost to it")
        ),
    ],
)
def test_a_patterned_object_is_not_eaten_by_the_background(ground_color, random):
    points, normals = sphere([0, 0, 0], 0.5, 4000)
    stripes = np.where((np.floor(points[:, 2] / 0.125) % 2 == 0)[:, None], WHITE, RED)
    ground = plane(-0.52, 2.0, 0.06)
    positions, lab, normals = cloud(((points, normals), stripes), (ground, ground_color), random=random)
    truth = np.repeat([1, 0], [4000, len(ground[0])])
    coarse = np.where(np.linalg.norm(positions - [0.08, 0, 0], axis=1) < 0.53, 1, 0)
    seen = (normals @ [0.6, -0.6, 0.5]) > 0.1
    labels = propagate_labels(positions, lab, normals, VOXEL, *seeds_from(coarse, 2, seen), 4, random)
    assert (labels.classes[truth == 1] == 1).mean() >= 0.97
    assert (labels.classes[truth == 0] == 0).mean() >= 0.97


def unsaid(shape):
    """A propagation over points [p, K+1] of which masks say nothing."""
    blank = _Propagation(*[None] * 8)
    return replace(blank, seed_targets=np.full(shape, 1 / shape[1]), seed_confidence=np.zeros(shape[0]))


@pytest.mark.parametrize(("reliability", "confidence"), [([1, 1], 1.6), ([0.5, 1], 0.8), ([1, 0.25], 0.4), ([0, 1], 0)])
def test_color_moves_a_point_between_two_classes_only_as_far_as_both_are_reliable(reliability, confidence):
    labels, now = np.array([[0.9, 0.1]]), np.array([[0.2, 0.8]])
    assert unsaid(labels.shape)._color_confidence(labels, now, np.array([reliability])) == pytest.approx([confidence])


def test_color_that_favors_the_background_has_no_influence_where_the_runner_up_is_unreliable():
    labels, now = np.array([[0.6, 0.4, 0.0]]), np.array([[0.9, 0.1, 0.0]])
    for reliability in (0, 0.5, 1):
        given = unsaid(labels.shape)._color_confidence(labels, now, np.array([[1, reliability, 1]]))
        assert given == pytest.approx([2 * reliability * 0.2])


def test_surfaces_part_in_a_crease_sooner_than_at_an_edge():
    floor = np.stack(np.meshgrid(np.arange(6.0), np.arange(-6, 0.0)), -1).reshape(-1, 2)
    floor = np.column_stack([floor, np.zeros(len(floor))])
    wall = np.stack(np.meshgrid(np.arange(6.0), np.arange(0.5, 6.0)), -1).reshape(-1, 2)
    wall = np.column_stack([wall[:, 0], np.zeros(len(wall)), wall[:, 1]])
    across = []
    for inward, up in ((-1.0, 1), (-1.0, -1)):  # seen from where the two face each other, and from behind
        normals = np.repeat([[0, 0, up], [0, inward * up, 0]], [len(floor), len(wall)], axis=0).astype(float)
        positions = np.concatenate([floor, wall])
        graph = neighbor_graph(positions, np.zeros_like(positions), normals, 1.0).toarray()
        across.append(graph[: len(floor), len(floor) :].max())
    assert across[0] < 0.05 * across[1]


def test_a_look_alike_that_is_not_connected_to_the_masks_is_dropped(random):
    masked, look_alike = sphere([0, 0, 0], 0.4, 2500), sphere([1.0, 0, 0], 0.3, 1500)
    ground = plane(-0.45, 2.0, 0.06)
    positions, lab, normals = cloud((masked, RED), (look_alike, RED), (ground, GRAY), random=random)
    truth = np.repeat([1, 0, 0], [2500, 1500, len(ground[0])])
    seen = (normals @ [0, -1, 0.2] > 0.1) & ((positions[:, 0] < 0.6) | (positions[:, 2] < -0.44))
    labels = propagate_labels(positions, lab, normals, VOXEL, *seeds_from(truth, 2, seen), 4, random)
    assert (labels.classes[2500:4000] == 0).all()
    assert (labels.classes[:2500] == 1).mean() >= 0.97


def test_a_color_that_no_mask_shows_has_no_influence_and_the_neighbors_decide(random):
    ball = sphere([0, 0, 0], 0.5, 4000)
    colors = np.where(ball[0][:, 1:2] > 0.25, BLUE, RED)  # the back, which no mask reaches, is blue
    ground = plane(-0.56, 2.0, 0.06)
    positions, lab, normals = cloud((ball, colors), (ground, GRAY), random=random)
    truth = np.repeat([1, 0], [4000, len(ground[0])])
    seen = (normals @ [0, -1, 0.3]) > 0.2
    labels = propagate_labels(positions, lab, normals, VOXEL, *seeds_from(truth, 2, seen), 4, random)
    blue = np.flatnonzero(ball[0][:, 1] > 0.25)
    assert not (seen[blue] & (normals[blue, 1] > 0.5)).any()
    assert (labels.classes[blue] == 1).mean() >= 0.97


def test_same_seed_same_labels(two_balls):
    positions, lab, normals, _, coarse, seen = two_balls
    runs = [
        propagate_labels(positions, lab, normals, VOXEL, *seeds_from(coarse, 3, seen), 2, np.random.default_rng(7))
        for _ in range(2)
    ]
    assert np.array_equal(runs[0].probabilities, runs[1].probabilities)


def test_the_graph_is_symmetric_and_weak_across_edges_of_normal_and_color(random):
    positions = np.column_stack([np.arange(30) * VOXEL, np.zeros(30), np.zeros(30)])
    normals = np.tile([0.0, 0.0, 1.0], (30, 1))
    lab = np.tile([50.0, 0.0, 0.0], (30, 1))
    normals[10:] = [1.0, 0.0, 0.0]
    lab[20:] = [50.0, 60.0, 0.0]
    graph = neighbor_graph(positions, lab, normals, VOXEL).toarray()
    assert_allclose(graph, graph.T)
    assert graph.diagonal().sum() == 0
    smooth, corner, pattern = graph[4, 5], graph[9, 10], graph[19, 20]
    assert smooth == pytest.approx(np.exp(-1 / 32), abs=1e-3)
    assert corner < 0.05 * smooth
    # an edge of color alone is weak, but stronger than none: a pattern is one thing
    assert 0.5 * PATTERN * smooth < pattern < 2 * PATTERN * smooth
    assert graph[4, 29] == 0


def test_the_linear_solver_agrees_with_numpy(random):
    matrix = random.normal(size=(30, 30))
    matrix = matrix @ matrix.T + 30 * np.eye(30)
    right = random.normal(size=(30, 3))
    found = conjugate_gradients(lambda v: matrix @ v, matrix.diagonal().copy(), right, np.zeros((30, 3)))
    assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-4)


def test_a_class_is_dense_at_its_own_colors_only(random):
    lab = np.concatenate([random.normal([40, 50, 30], 3, (300, 3)), random.normal([70, -20, 10], 3, (300, 3))])
    strengths = np.repeat(np.eye(2), 300, 0)
    log_density = class_log_densities(lab, strengths, random)
    assert (log_density[:300, 0] > log_density[:300, 1] + 5).all()
    assert (log_density[300:, 1] > log_density[300:, 0] + 5).all()


def test_a_few_points_in_the_wrong_class_do_not_win_their_color(random):
    lab = np.concatenate([random.normal([40, 50, 30], 3, (500, 3)), random.normal([70, -20, 10], 3, (500, 3))])
    strengths = np.repeat(np.eye(2), 500, 0)
    strengths[:50] = [0, 1]  # a tenth of the first color is labelled as the second class
    log_density = class_log_densities(lab, strengths, random)
    assert (log_density[:500, 0] > log_density[:500, 1]).mean() > 0.99


# ------------------------------------------------------------------------------------------------------- hardly any seeds
def test_one_seed_is_enough(two_balls, random):
    positions, lab, normals, _, _, _ = two_balls
    targets, confidence = seeds_from(
        np.where(np.arange(len(positions)) == 100, 1, 0), 2, np.arange(len(positions)) % 7 < 3
    )
    assert confidence[100] == 1
    labels = propagate_labels(positions, lab, normals, VOXEL, targets, confidence, 2, random)
    assert np.isfinite(labels.probabilities).all() and labels.precision.shape == (1,)


def test_a_thin_object_holds_on_to_its_seeds_among_many_neighbors(random):
    places = np.stack(np.meshgrid(np.arange(60.0), np.arange(41.0), indexing="ij"), -1).reshape(-1, 2) * VOXEL
    truth = (abs(places[:, 1] - 20 * VOXEL) < 0.5 * VOXEL).astype(int)
    positions = np.column_stack([places, np.zeros(len(places))])
    lab = srgb_to_lab(np.where(truth[:, None] == 1, RED, GRAY)) + random.normal(0, 3, (len(places), 3))
    targets, confidence = seeds_from(truth, 2, places[:, 0] < 30 * VOXEL)
    normals = np.tile([0.0, 0, 1], (len(places), 1))
    classes = propagate_labels(positions, lab, normals, VOXEL, targets, confidence * 0.3, 4, random).classes
    assert (classes[truth == 1] == 1).mean() > 0.7 and (classes[truth == 0] == 0).mean() > 0.98


def test_an_object_without_seeds_gets_no_point_and_leaves_the_others_theirs(two_balls):
    positions, lab, normals, _, coarse, seen = two_balls
    targets, confidence = seeds_from(coarse, 3, seen)
    more = np.column_stack([targets, np.zeros(len(targets))])
    with_it, without = (
        propagate_labels(positions, lab, normals, VOXEL, each, confidence, 2, np.random.default_rng(3)).classes
        for each in (more, targets)
    )
    assert (with_it != 3).all() and (with_it == without).mean() > 0.99


def test_a_single_point_far_from_all_others_is_solved(random):
    positions = np.array([[0.0, 0, 0], [50.0, 0, 0], [50.0, 0.04, 0]])
    lab, normals = srgb_to_lab(np.array([RED, GRAY, GRAY])), np.tile([0.0, 0, 1], (3, 1))
    targets, confidence = seeds_from(np.array([1, 0, 0]), 2, np.ones(3, bool))
    assert propagate_labels(positions, lab, normals, VOXEL, targets, confidence, 2, random).classes.tolist() == [
        1,
        0,
        0,
    ]


def test_an_object_has_seeds_where_votes_for_it_are_confident():
    targets = np.array([[0.0, 1.0, 0.0], [0.5, 0.0, 0.5], [0.0, 0.0, 1.0]])
    assert has_seeds(targets, np.ones(3)).tolist() == [True, True]
    assert has_seeds(targets, np.array([1.0, 1.0, 0.0])).tolist() == [True, False]
    assert has_seeds(targets, np.zeros(3)).tolist() == [False, False]
    assert has_seeds(targets[:0], np.zeros(0)).tolist() == [False, False]


def test_a_crowd_of_open_votes_far_away_does_not_outshine_an_objects_own_seeds():
    """Where an object has no mask in a view, what lies behind is half a vote for it; far points gather many of these."""
    targets = np.array([[0.0, 1.0], [0.5, 0.5]])
    assert has_seeds(targets, np.array([50.0, 1000.0])).tolist() == [True]


def test_classes_of_one_color_are_equally_likely(random):
    lab = np.tile([40.0, 10.0, 5.0], (60, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of clusters without points
        densities = class_log_densities(lab, np.eye(2)[np.arange(60) % 2], random)
    assert np.isfinite(densities).all()
    assert_allclose(densities[:, 0], densities[:, 1])


def test_a_patch_in_doubt_follows_what_surrounds_it_and_a_point_that_would_change_alone_stays():
    places = np.stack(np.meshgrid(np.arange(30.0), np.arange(20.0), indexing="ij"), -1).reshape(-1, 2)
    positions = np.column_stack([places, np.zeros(len(places))])
    graph = neighbor_graph(positions, np.full((len(places), 3), 50.0), np.tile([0.0, 0.0, 1.0], (len(places), 1)), 1.0)
    patch = np.linalg.norm(places - [8, 10], axis=1) < 4
    alone = (places == [22, 10]).all(1)
    x = np.where((patch | alone)[:, None], [0.55, 0.45], [0.05, 0.95])
    found = _Propagation(None, None, graph, None, None, None, None, None)._with_patches(
        x, np.ones(len(x)), np.zeros(len(x), bool)
    )
    assert (found.argmax(1)[patch] == 1).mean() > 0.8
    assert_allclose(found[~patch], x[~patch])
    kept = _Propagation(None, None, graph, None, None, None, None, None)._with_patches(x, np.ones(len(x)), patch)
    assert_allclose(kept, x)  # masks and colors agree on all of the patch


@pytest.mark.parametrize(("confidence", "color", "agreed"), [(1, 0.95, True), (0.1, 0.95, False), (1, 0.05, False)])
def test_points_are_agreed_on_where_masks_surely_say_what_their_color_says(confidence, color, agreed):
    propagation = _Propagation(None, None, None, np.array([[0.0, 1.0]]), np.array([confidence]), None, None, None)
    assert propagation._agreed(np.array([[1 - color, color]]), np.ones((1, 2))).tolist() == [agreed]


def test_what_masks_and_colors_say_alike_counts_many_times():
    labels, reliable = np.array([[0.1, 0.9]]), np.ones((1, 2))
    silent = unsaid(labels.shape)
    agreed = replace(silent, seed_targets=np.array([[0.0, 1.0]]), seed_confidence=np.ones(1))
    one, many = (each._color_confidence(labels, labels, reliable)[0] for each in (silent, agreed))
    assert many == pytest.approx((1 + AGREED_WEIGHT) * one)


def test_a_twin_far_away_does_not_make_a_color_useless_near_the_object():
    here, there = np.zeros((50, 3)), np.full((200, 3), 40.0)
    positions = np.concatenate([here, there])
    looks_like_it = np.tile([0.0, 1.0], (250, 1))
    drawn_here = np.where(np.arange(250)[:, None] < 50, [0.0, 1.0], [1.0, 0.0])
    alike = replace(
        unsaid((250, 2)), positions=positions, radii=np.ones(1), seed_targets=drawn_here, seed_confidence=np.ones(250)
    )
    reliability, precision = alike._color_reliability(looks_like_it)
    assert precision == pytest.approx([0.2])
    assert (reliability[:50, 1] == 1).all() and (reliability[50:, 1] == 0).all()
