"""Labels propagated from coarse seeds on point clouds of known truth."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

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
UP = np.array([0.0, 0.0, 1.0])
TARGETS = np.array([[0.0, 1.0, 0.0], [0.5, 0.0, 0.5], [0.0, 0.0, 1.0]])


def sphere(center, radius, count):
    """Even points on a sphere (Fibonacci) and their normals."""
    i = np.arange(count) + 0.5
    z, angle = 1 - 2 * i / count, i * np.pi * (1 + 5**0.5)
    normals = np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], 1)
    return center + radius * normals, normals


def plane(*steps, height=0.0):
    """Points of a horizontal plane, and their normals."""
    places = np.stack(np.meshgrid(*steps, indexing="ij"), -1).reshape(-1, 2)
    return np.column_stack([places, np.full(len(places), height)]), np.tile(UP, (len(places), 1))


def ground(height, spacing=0.06):
    return plane(*[np.arange(-2, 2, spacing)] * 2, height=height)


def join(*parts):
    """Positions, lab, normals and truth of parts ((positions, normals), sRGB), with a little noise.

    The parts are those of the classes 1, 2, ... and, last, of the background.
    """
    random = np.random.default_rng(0)
    positions = np.concatenate([p for (p, _), _ in parts])
    normals = np.concatenate([n for (_, n), _ in parts])
    rgb = np.concatenate([np.broadcast_to(color, p.shape) for (p, _), color in parts])
    lab = srgb_to_lab(np.clip(rgb + random.normal(scale=0.01, size=rgb.shape), 0, 1))
    truth = np.repeat([*range(1, len(parts)), 0], [len(p) for (p, _), _ in parts])
    return positions + random.normal(scale=0.1 * VOXEL, size=positions.shape), lab, normals, truth


def propagate(positions, lab, normals, coarse, seen, rounds=4, n_classes=2):
    """Propagate one vote per seen point, for its coarse label."""
    targets, random = np.eye(n_classes)[coarse], np.random.default_rng(0)
    return propagate_labels(positions, lab, normals, VOXEL, targets, seen * 1.0, rounds, random)


@pytest.fixture(scope="module")
def two_balls():
    """Touching red and green balls on gray ground, a distant point, and sloppy coarse labels."""
    balls = [(sphere([-0.5, 0, 0], 0.5, 2600), RED), (sphere([0.5, 0, 0], 0.5, 2600), GREEN)]
    positions, lab, normals, truth = join(*balls, (ground(-0.52, 0.07), GRAY), ((np.full((1, 3), 9.0), UP[None]), RED))
    truth[truth == 3], truth[-1] = 0, 0
    # drawn from the front (y < 0) and shifted: the masks spill over the borders and lack a strip
    coarse = np.zeros(len(truth), int)
    shifted = positions - [0.08, 0, 0.03]
    coarse[np.linalg.norm(shifted - [-0.5, 0, 0], axis=1) < 0.56] = 1
    coarse[np.linalg.norm(shifted - [0.5, 0, 0], axis=1) < 0.52] = 2
    coarse[(positions[:, 2] > 0.38) & (positions[:, 0] < 0)] = 0  # a missing piece
    seen = (normals @ [0, -1, 0.3]) > 0.1
    seen[-1] = False
    return positions, lab, normals, truth, coarse, seen


def test_touching_balls_are_separated_despite_sloppy_masks(two_balls):
    *points, truth, coarse, seen = two_balls
    assert (coarse[seen] == truth[seen]).mean() < 0.93
    labels = propagate(*points, coarse, seen, n_classes=3)
    assert (labels.classes == truth).mean() >= 0.97
    assert_allclose(labels.probabilities.sum(1), np.ones(len(truth)), atol=1e-6)
    assert (labels.precision > 0.5).all()
    assert labels.probabilities[-1].tolist() == [1, 0, 0]  # far from every object is background


def test_labels_are_deterministic_and_objects_need_seeds(two_balls):
    *points, _, coarse, seen = (each[::4] for each in two_balls)
    one, two, with_another = (propagate(*points, coarse, seen, 2, n) for n in (3, 3, 4))
    assert_array_equal(one.probabilities, two.probabilities)
    assert (with_another.classes != 3).all() and (with_another.classes == one.classes).mean() > 0.99
    single = propagate(*points, np.eye(len(seen), dtype=int)[98], np.arange(len(seen)) % 7 < 3, 2)
    assert np.isfinite(single.probabilities).all() and single.precision.shape == (1,)  # one seed is enough


def patterned():
    """A striped ball, marked from one side with a shifted mask."""
    points, normals = sphere([0, 0, 0], 0.5, 4000)
    stripes = np.where((np.floor(points[:, 2] / 0.125) % 2 == 0)[:, None], WHITE, RED)
    positions, lab, normals, truth = join(((points, normals), stripes), (ground(-0.52), GRAY))
    coarse = np.where(np.linalg.norm(positions - [0.08, 0, 0], axis=1) < 0.53, 1, 0)
    return positions, lab, normals, truth, coarse, (normals @ [0.6, -0.6, 0.5]) > 0.1


def look_alike():
    """A ball and, beside it but not connected, a second one of its color."""
    masked, similar = sphere([0, 0, 0], 0.4, 2500), sphere([1.0, 0, 0], 0.3, 1500)
    positions, lab, normals, truth = join((masked, RED), (similar, RED), (ground(-0.45), GRAY))
    seen = (normals @ [0, -1, 0.2] > 0.1) & ((positions[:, 0] < 0.6) | (positions[:, 2] < -0.44))
    truth[truth == 2] = 0
    return positions, lab, normals, truth, truth, seen


def unseen_color():
    """A ball whose unmasked back has another color: its neighbors decide."""
    points, outward = sphere([0, 0, 0], 0.5, 4000)
    colors = np.where(points[:, 1:2] > 0.25, BLUE, RED)
    positions, lab, normals, truth = join(((points, outward), colors), (ground(-0.56), GRAY))
    return positions, lab, normals, truth, truth, (normals @ [0, -1, 0.3]) > 0.2


def thin():
    """A thin line with weak seeds on one half."""
    positions, normals = plane(np.arange(60.0) * VOXEL, np.arange(41.0) * VOXEL)
    truth = (abs(positions[:, 1] - 20 * VOXEL) < 0.5 * VOXEL).astype(int)
    noise = np.random.default_rng(0).normal(0, 3, (len(truth), 3))
    lab = srgb_to_lab(np.where(truth[:, None] == 1, RED, GRAY)) + noise
    return positions, lab, normals, truth, truth, 0.3 * (positions[:, 0] < 30 * VOXEL)


def alone():
    """A single point far from all others."""
    positions, truth = np.array([[0.0, 0, 0], [50.0, 0, 0], [50.0, 0.04, 0]]), np.array([1, 0, 0])
    return positions, srgb_to_lab(np.array([RED, GRAY, GRAY])), np.tile(UP, (3, 1)), truth, truth, np.ones(3)


@pytest.mark.parametrize(
    ("scene", "of_object", "of_ground"),
    [(patterned, 0.97, 0.97), (look_alike, 0.97, 0.99), (unseen_color, 0.97, 0.97), (thin, 0.7, 0.98), (alone, 1, 1)],
)
def test_objects_and_background_keep_their_points(scene, of_object, of_ground):
    *points, truth, coarse, seen = scene()
    labels = propagate(*points, coarse, seen)
    assert (labels.classes[truth == 1] == 1).mean() >= of_object
    assert (labels.classes[truth == 0] == 0).mean() >= of_ground


@pytest.mark.parametrize(
    ("targets", "confidence", "expected"),
    [
        (TARGETS, [1, 1, 1], [True, True]),
        (TARGETS, [1, 1, 0], [True, False]),
        (TARGETS, [0, 0, 0], [False, False]),
        (TARGETS[:0], [], [False, False]),
        # without a mask, points behind an object give it half a vote; far points gather many of these
        (np.array([[0.0, 1.0], [0.5, 0.5]]), [50, 1000], [True]),
    ],
)
def test_confident_votes_make_seeds(targets, confidence, expected):
    assert has_seeds(targets, np.array(confidence, float)).tolist() == expected


def propagation(n=0, **parts):
    """A propagation over n points of two classes without votes, except for the given parts."""
    blank = dict.fromkeys(_Propagation.__dataclass_fields__)
    return _Propagation(**blank | {"seed_targets": np.full((n, 2), 0.5), "seed_confidence": np.zeros(n)} | parts)


@pytest.mark.parametrize(
    ("labels", "now", "reliability", "confidence"),
    [
        ([0.9, 0.1], [0.2, 0.8], [1, 1], 1.6),
        ([0.9, 0.1], [0.2, 0.8], [0.5, 1], 0.8),
        ([0.9, 0.1], [0.2, 0.8], [1, 0.25], 0.4),
        ([0.9, 0.1], [0.2, 0.8], [0, 1], 0),
        # if the runner-up is unreliable, color cannot favor the background
        *(([0.6, 0.4, 0.0], [0.9, 0.1, 0.0], [1, reliable, 1], 0.4 * reliable) for reliable in (0, 0.5, 1)),
    ],
)
def test_color_confidence_needs_reliable_classes(labels, now, reliability, confidence):
    silent = propagation(seed_targets=np.full((1, len(labels)), 1 / len(labels)), seed_confidence=np.zeros(1))
    given = silent._color_confidence(*(np.array([each]) for each in (labels, now, reliability)))
    assert given == pytest.approx([confidence])


@pytest.mark.parametrize(("confidence", "color", "agreed"), [(1, 0.95, True), (0.1, 0.95, False), (1, 0.05, False)])
def test_agreement_of_masks_and_colors_multiplies_confidence(confidence, color, agreed):
    labels, reliable = np.array([[1 - color, color]]), np.ones((1, 2))
    marked = propagation(seed_targets=np.array([[0.0, 1.0]]), seed_confidence=np.array([confidence]))
    assert marked._agreed(labels, reliable).tolist() == [agreed]
    one, many = (each._color_confidence(labels, labels, reliable)[0] for each in (propagation(1), marked))
    assert many == pytest.approx((1 + AGREED_WEIGHT * agreed) * one)


def test_distant_look_alike_keeps_a_color_reliable_nearby():
    near = np.arange(250) < 50
    alike = propagation(
        positions=np.where(near[:, None], 0.0, 40.0) * np.ones((1, 3)),
        radii=np.ones(1),
        seed_targets=np.where(near[:, None], [0.0, 1.0], [1.0, 0.0]),
        seed_confidence=np.ones(250),
    )
    reliability, precision = alike._color_reliability(np.tile([0.0, 1.0], (250, 1)))
    assert precision == pytest.approx([0.2])
    assert_array_equal(reliability[:, 1], near)


def test_doubtful_patch_follows_its_surroundings_and_single_points_stay():
    positions, normals = plane(np.arange(30.0), np.arange(20.0))
    graph = neighbor_graph(positions, np.full_like(positions, 50.0), normals, 1.0)
    patch = np.linalg.norm(positions - [8, 10, 0], axis=1) < 4
    alone = (positions == [22, 10, 0]).all(1)
    x = np.where((patch | alone)[:, None], [0.55, 0.45], [0.05, 0.95])
    smooth = propagation(graph=graph)
    found, kept = (smooth._with_patches(x, np.ones(len(x)), agreed) for agreed in (np.zeros_like(patch), patch))
    assert (found.argmax(1)[patch] == 1).mean() > 0.8
    assert_allclose(found[~patch], x[~patch])
    assert_allclose(kept, x)  # masks and colors agree on the whole patch


def test_neighbor_graph_follows_its_formula():
    """Neighbors are strongly tied where color, normal and place agree; least of all across a crease."""
    random = np.random.default_rng(0)
    positions, lab = random.random((40, 3)), random.normal(50, 10, (40, 3))
    normals = random.normal(UP, 0.3, (40, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    expected = np.zeros((40, 40))
    for i in range(40):
        distances = np.linalg.norm(positions - positions[i], axis=1)
        for j in np.argsort(distances)[1:13]:
            is_crease = (normals[j] - normals[i]) @ (positions[j] - positions[i]) < 0
            turn = (3 if is_crease else 1) * (1 - normals[i] @ normals[j]) / (2 * 0.15)
            place = (distances[j] / (4 * 0.2)) ** 2 / 2
            color = np.exp(-((lab[j] - lab[i]) ** 2).sum() / (2 * 8.0**2))
            # an edge of color alone is weak, but stronger than none: a pattern is one thing
            expected[i, j] = np.exp(-turn - place) * (PATTERN + (1 - PATTERN) * color) + 1e-6
    assert_allclose(neighbor_graph(positions, lab, normals, 0.2).toarray(), np.maximum(expected, expected.T))


def test_linear_solver_agrees_with_numpy():
    random = np.random.default_rng(0)
    matrix, right = random.normal(size=(30, 30)), random.normal(size=(30, 3))
    matrix = matrix @ matrix.T + 30 * np.eye(30)
    found = conjugate_gradients(lambda v: matrix @ v, matrix.diagonal().copy(), right, np.zeros((30, 3)))
    assert_allclose(found, np.linalg.solve(matrix, right), atol=1e-4)


@pytest.mark.parametrize(("wrong", "advantage", "share"), [(0, 5, 1), (30, 0, 0.99)])
def test_density_favors_the_own_class_despite_wrong_labels(wrong, advantage, share):
    random = np.random.default_rng(0)
    lab = np.concatenate([random.normal([40, 50, 30], 3, (300, 3)), random.normal([70, -20, 10], 3, (300, 3))])
    strengths = np.repeat(np.eye(2), 300, 0)
    strengths[:wrong] = [0, 1]
    first, second = class_log_densities(lab, strengths, random).T
    assert (first > second + advantage)[:300].mean() >= share and (second > first + advantage)[300:].mean() >= share


def test_classes_of_one_color_are_equally_likely():
    lab = np.tile([40.0, 10.0, 5.0], (60, 1))
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # of clusters without points
        densities = class_log_densities(lab, np.eye(2)[np.arange(60) % 2], np.random.default_rng(0))
    assert np.isfinite(densities).all()
    assert_allclose(densities[:, 0], densities[:, 1])
