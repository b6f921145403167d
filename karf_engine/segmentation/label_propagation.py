"""Label propagation: turn the masks' votes on some surface points into clean labels of all, by neighbors and colors.

Class 0 is the background, 1..K are the objects. Seeds are points with votes `seed_targets` y [p, K+1] of confidence
`seed_confidence` c [p]. The probabilities x [p, K+1] minimize unary terms (agree with the seeds, and weakly with a
uniform prior) plus pairwise terms (agree with the neighbors), one linear system:

    (D + C + eps) x - lambda W x = C y + eps / (K+1)         W: neighbor weights, D: lambda times their row sums

Thin and small objects have few seeds and many ties to their surroundings. Near them all unary terms are multiplied by a
seed weight, doubled until the seeds keep their labels.

A few rounds follow. Each fits Gaussian mixtures in Lab to the colors of the current classes, derives color labels, and
solves the system again with these as a second unary term. Guards keep mistakes from confirming themselves:

- A color counts only if it is reliable: most seeds of that color, in the whole scene or near the point, must be marked
  as the object. Color decides between two classes only as far as both are reliable. The background always is.
- Where masks and colors agree on a point, its color label counts many times.
- A seed that its color clearly contradicts is ignored; its color label too, if the color is the background's.
- Mixtures are redrawn in every round where masks vote, and the mean of their labels counts.
- A color that no class has gives uniform labels. An object's colors fade with the distance from its seeds.

Parts not connected to an object's seeds are removed. Finally patches in doubt follow their surroundings: the system is
solved once more with the labels as unary terms, weighted by their margins. A point that would change alone keeps its
label, otherwise thin ends and rims would erode. So does a point where masks and colors agree.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.ndimage import gaussian_filter
from scipy.sparse.csgraph import connected_components

from ..compute.neighbors import build_kd_tree
from ..compute.sparse_systems import warn_not_converged
from .gaussian_mixtures import class_log_densities
from .surface_points import Labels, margin

SMOOTHNESS = 20.0  # lambda; 5 and 10 leave holes in solid objects
SEED_CONSISTENCY = 0.98  # share of an object's seeds that must keep its label; at 0.9 tiny objects are lost
AGREED_WEIGHT = 20.0  # extra weight of color labels that agree with the masks; less of it lowers the IoU
NEARBY_RADII = 0.5  # standard deviation of the local color reliability, in seed radii; 1 lowers the IoU
PATCH_COHESION = 0.5  # share of a changed point's ties that lead to changed points; without it thin ends erode
MAX_PATCH = 0.1  # share of an object's points; without it small objects are removed whole
DECIDED = 0.6  # least vote of a seed whose class is not open
CELLS_PER_DEVIATION = 2
MAX_CELLS = 100  # along an axis
TOLERANCE, MAX_STEPS = 1e-4, 150  # of conjugate gradients; relative to the right-hand side
NEIGHBORS = 12
COLOR_DEVIATION = 8.0  # Lab units
TURN_SCALE = 0.15  # 1 minus the cosine between normals; a turn of this size multiplies a weight by exp(-1/2)
DISTANCE_DEVIATION = 4  # point spacings
PATTERN = 0.02  # share of a weight that a color edge leaves: a smooth surface with a pattern is one object
CREASE_FACTOR = 3.0  # on concave turns: objects touch in creases
MIN_WEIGHT = 1e-6


def propagate_labels(
    positions: np.ndarray,  # [p, 3] grid coordinates
    lab: np.ndarray,  # [p, 3] CIE Lab
    normals: np.ndarray,  # [p, 3] outward
    spacing: float,  # of the points
    seed_targets: np.ndarray,  # [p, K+1], rows sum to 1
    seed_confidence: np.ndarray,  # [p] >= 0, 0 for all other points
    rounds: int,
    random: np.random.Generator,  # draws the colors that mixtures are fitted to
) -> Labels:
    """Label all points from the seeds among them. An object without seeds (see `has_seeds`) gets no point."""
    distances, radii = [], []
    for k in range(1, seed_targets.shape[1]):
        seeds = positions[seeds_of(k, seed_targets, seed_confidence)]
        distances.append(build_kd_tree(seeds, balanced_tree=False, compact_nodes=False).query(positions)[0])
        radii.append(np.sqrt(((seeds - seeds.mean(0)) ** 2).sum(1).mean()) if len(seeds) else 0)
    distance, radii = np.stack(distances, 1), np.maximum(radii, spacing)  # [p, K], [K] at least the point spacing
    near = (distance < 4.0 * radii).any(1)  # all others are background
    fade_start, fade_strength = 2.0, 4.5  # seed radii; log density lost at twice that distance
    propagation = _Propagation(
        positions[near],
        lab[near],
        neighbor_graph(positions[near], lab[near], normals[near], spacing),
        seed_targets[near],
        seed_confidence[near],
        fade_strength * np.maximum(0, distance[near] / (fade_start * radii) - 1) ** 2,
        radii,
        random,
    )
    solved = propagation.run(rounds)
    background = np.eye(seed_targets.shape[1])[0]
    probabilities, opinion = (np.tile(background, (len(positions), 1)) for _ in range(2))
    probabilities[near], opinion[near] = solved.probabilities, solved.opinion
    return Labels(probabilities, solved.precision, opinion)


@dataclass(frozen=True)
class _Propagation:
    """The points near the objects before the first round."""

    positions: np.ndarray  # [p, 3] grid coordinates
    lab: np.ndarray  # [p, 3]
    graph: sparse.csr_matrix  # [p, p] neighbor weights
    seed_targets: np.ndarray  # [p, K+1]
    seed_confidence: np.ndarray  # [p]
    distance_penalty: np.ndarray  # [p, K], subtracted from the objects' log densities
    radii: np.ndarray  # [K] of the objects' seeds, grid coordinates
    random: np.random.Generator

    def run(self, rounds: int) -> Labels:
        targets, confidence = self.seed_targets, self.seed_confidence
        from_masks, seed_weight = self._seed_weight()
        x, mixture_weight = from_masks, confidence
        precision, reliability = np.ones(targets.shape[1] - 1), np.ones_like(x)
        color_labels = np.zeros_like(x)
        for number in range(rounds):
            # the mean over rounds, since single ones vary with the mixtures' draw
            color_labels = (number * color_labels + self._color_labels(x, mixture_weight)) / (number + 1)
            reliability, precision = self._color_reliability(color_labels)
            seed_reliability = self._seed_reliability(color_labels, reliability)
            reliable = confidence * seed_reliability
            # background colors count as reliable untested, so they are discounted where they contradict a seed
            untested = np.where(color_labels.argmax(1) == 0, seed_reliability, 1)
            color_confidence = self._color_confidence(color_labels, x, reliability) * untested
            total = reliable + color_confidence
            # color divides votes among the classes that they leave open ("not this object")
            shared = targets * np.maximum(color_labels, 1e-3)
            shared /= shared.sum(1, keepdims=True)
            unary = reliable[:, None] * shared + color_confidence[:, None] * color_labels
            x = self._smooth(unary / np.maximum(total, 1e-12)[:, None], seed_weight * total, x)
            mixture_weight = reliable  # without color labels, which would confirm themselves
        agreed = self._agreed(color_labels, reliability)
        x = self._connected(self._with_patches(self._connected(x), seed_weight, agreed))
        return Labels(x, precision, (from_masks + color_labels + x) / 3)

    def _seed_weight(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the solution without colors, [p, K+1], and the seed weight that preserves the seeds, [p]."""
        n_objects = self.seed_targets.shape[1] - 1
        numbers = np.arange(1, n_objects + 1)
        own = np.stack([seeds_of(k, self.seed_targets, self.seed_confidence) for k in numbers], 1)
        factors, n_doublings = np.ones(n_objects), 6
        for doublings in range(n_doublings + 1):
            seed_weight = np.where(self.distance_penalty > 0, 1, factors).max(1)
            x = self._smooth(self.seed_targets, seed_weight * self.seed_confidence, None)
            is_consistent = (own & (x.argmax(1)[:, None] == numbers)).sum(0) >= SEED_CONSISTENCY * own.sum(0)
            if is_consistent.all() or doublings == n_doublings:
                break
            factors = np.where(is_consistent, factors, 2 * factors)
        return x, seed_weight

    def _smooth(self, targets: np.ndarray, confidence: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """Solve the linear system for all classes; start: [p, K+1], None for uniform labels."""
        n_classes, uniform_weight = targets.shape[1], 1e-4
        row_sums = np.asarray(self.graph.sum(1)).ravel()
        diagonal = SMOOTHNESS * row_sums + confidence + uniform_weight
        right = confidence[:, None] * targets + uniform_weight / n_classes
        x = np.full_like(targets, 1 / n_classes) if start is None else start
        x = conjugate_gradients(lambda v: diagonal[:, None] * v - SMOOTHNESS * (self.graph @ v), diagonal, right, x)
        x = np.clip(x, 0, None)
        return x / np.maximum(x.sum(1, keepdims=True), 1e-12)

    def _color_labels(self, x: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Return class probabilities by each point's color and its distance from the objects, [p, K+1]."""
        strengths = (weight * margin(x))[:, None] * np.eye(x.shape[1])[x.argmax(1)]
        log_density = class_log_densities(self.lab, strengths, self.random)
        mass = strengths.sum(0)
        # where there is little background, most of its seeds are parts of objects that the masks missed
        log_density[:, 0] += 0.25 * np.log(np.clip(mass[0] / max(mass[1:].sum(), 1e-12), 1e-12, 1))
        log_density[:, 1:] -= self.distance_penalty
        density = np.exp(np.maximum(log_density, -700))
        unknown = np.exp(-15.5)  # density of colors that no class has
        return (density + unknown / x.shape[1]) / (density.sum(1, keepdims=True) + unknown)

    def _color_reliability(self, color_labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the reliability of each class's color at each point, [p, K+1] in [0, 1], and the precision, [K]."""
        predicted = color_labels.argmax(1)
        decided = self.seed_confidence * (self.seed_targets.max(1) > DECIDED)
        # the background is always reliable: a mask that spills over much of it must not disable its color
        share, precision = np.ones_like(color_labels), np.ones(len(self.radii))
        for k, radius in enumerate(self.radii, 1):
            weight = decided * (predicted == k)
            own = weight * self.seed_targets[:, k]
            precision[k - 1] = overall = own.sum() / max(weight.sum(), 1e-12)
            nearby = local_share(self.positions, weight, own, NEARBY_RADII * radius, overall, prior=5.0)
            share[:, k] = np.maximum(overall, nearby)
        return np.clip((share - 0.5) / 0.2, 0, 1), precision  # none up to a share of 0.5, full from 0.7

    def _color_confidence(self, color_labels: np.ndarray, x: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """Return the confidence of the color labels, [p]: their margin times the least reliability of three classes."""
        second, first = np.argsort(color_labels, 1)[:, -2:].T
        rows = np.arange(len(color_labels))
        # with the likeliest alone, the background would take points from an object whose own colors are unreliable
        least = np.minimum.reduce([reliability[rows, each] for each in (first, second, x.argmax(1))])
        factor = 1 + AGREED_WEIGHT * self._agreed(color_labels, reliability)
        return 2 * factor * least * (color_labels[rows, first] - color_labels[rows, second])

    def _seed_reliability(self, color_labels: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """Return a factor on the seeds' confidence, [p] in [0, 1]: low where color clearly contradicts the seed."""
        label, rows = self.seed_targets.argmax(1), np.arange(len(color_labels))
        agreement = (self.seed_targets * color_labels).sum(1) / np.maximum(self.seed_targets.max(1), 1e-12)
        least = np.minimum(reliability[rows, label], reliability[rows, color_labels.argmax(1)])
        contradiction = least * np.clip(2 * (1 - agreement) - 1, 0, 1)
        return np.where(self.seed_confidence > 0, (1 - contradiction) ** 2, 1)

    def _connected(self, x: np.ndarray) -> np.ndarray:
        """Move parts of an object that are not connected to its seeds to the next likely class."""
        x = x.copy()
        for _ in range(x.shape[1]):
            label = x.argmax(1)
            part = self._parts(label)
            votes = self.seed_confidence * self.seed_targets[np.arange(len(label)), label]
            anchored = np.bincount(part, votes * (votes > 0.1), part.max() + 1) > 0
            loose = ~anchored[part] & (label > 0)
            if not loose.any():
                break
            x[loose, label[loose]] = 0
            x[loose, 0] += 1e-6
            x /= x.sum(1, keepdims=True)
        return x

    def _agreed(self, color_labels: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """Return True where masks and colors agree on a point, [p]."""
        label, rows = color_labels.argmax(1), np.arange(len(color_labels))
        vote = self.seed_targets[rows, label]
        certainty = np.minimum(self.seed_confidence, 1) * reliability[rows, label] * margin(color_labels)
        return (vote > DECIDED) & (certainty > 0.3)

    def _with_patches(self, x: np.ndarray, seed_weight: np.ndarray, agreed: np.ndarray) -> np.ndarray:
        """Relabel patches in doubt by their surroundings; all other points keep their labels."""
        solved = self._smooth(x, seed_weight * (0.02 + 5.0 * margin(x)), x)  # confidence in full doubt, and gain
        before, after = x.argmax(1), solved.argmax(1)
        # only between an object and the background, whose colors alone counted untested
        changed = (before != after) & (before * after == 0) & ~agreed
        cohesive = changed & (self.graph @ changed >= PATCH_COHESION * np.asarray(self.graph.sum(1)).ravel())
        patch = self._parts(np.where(cohesive, before, -1))
        is_small = np.bincount(patch)[patch] <= MAX_PATCH * np.bincount(before)[before]
        return np.where((cohesive & ((before == 0) | is_small))[:, None], solved, x)

    def _parts(self, label: np.ndarray) -> np.ndarray:
        """Return the number of each point's connected part of equal labels, [p]."""
        edges = self.graph.tocoo()
        same = (edges.data > 1e-5) & (label[edges.row] == label[edges.col])
        tied = sparse.coo_matrix((np.ones(same.sum()), (edges.row[same], edges.col[same])), shape=self.graph.shape)
        return connected_components(tied, directed=False)[1]


def has_seeds(seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Return whether each object has a seed, [K] bool; arguments as for `propagate_labels`."""
    objects = range(1, seed_targets.shape[1])
    return np.array([seeds_of(k, seed_targets, seed_confidence).any() for k in objects])


def seeds_of(k: int, seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Return True for the points that the masks confidently assign to class k, [p]."""
    # votes of 0.5 and less may be open: far points gather many of them
    votes = seed_confidence * seed_targets[:, k] * (seed_targets[:, k] > 0.5)
    return votes >= np.maximum(0.25 * votes.max(initial=0), np.finfo(float).tiny)


def local_share(
    positions: np.ndarray, weight: np.ndarray, part: np.ndarray, deviation: float, expected: float, prior: float
) -> np.ndarray:
    """Return the share of the weight that belongs to a part, under a Gaussian around each point, [p] in [0, 1].

    Weights [p] >= 0 are binned on a grid and blurred, so shares are constant within a cell. deviation: of the Gaussian,
    in the units of positions. expected: share where nothing is near, with the weight `prior` > 0.
    """
    least, most = positions.min(0), positions.max(0)
    cell = max(deviation / CELLS_PER_DEVIATION, (most - least).max() / MAX_CELLS)
    cells = ((positions - least) / cell).astype(np.intp)
    shape = cells.max(0) + 1
    index = np.ravel_multi_index(tuple(cells.T), shape)
    deviation = deviation / cell

    def blurred(values: np.ndarray) -> np.ndarray:
        sums = np.bincount(index, values, int(shape.prod())).reshape(shape)
        scale = max(np.sqrt(2 * np.pi) * deviation, 1) ** 3  # peak 1; a deviation far below a cell blurs nothing
        return gaussian_filter(sums, deviation, mode="constant", truncate=3).ravel()[index] * scale

    return (blurred(part) + prior * expected) / (blurred(weight) + prior)


def neighbor_graph(positions: np.ndarray, lab: np.ndarray, normals: np.ndarray, spacing: float) -> sparse.csr_matrix:
    """Return weights between nearest neighbors, near 1 where color, normal and position agree: symmetric [p, p]."""
    # building a balanced tree has crashed together with torch
    tree = build_kd_tree(positions, balanced_tree=False, compact_nodes=False)
    distances, neighbors = tree.query(positions, k=range(1, min(NEIGHBORS + 1, len(positions)) + 1))
    distances, neighbors = distances[:, 1:], neighbors[:, 1:]
    color = ((lab[neighbors] - lab[:, None]) ** 2).sum(2) / (2 * COLOR_DEVIATION**2)
    turn = (1 - (normals[neighbors] * normals[:, None]).sum(2)) / (2 * TURN_SCALE)
    bend = ((normals[neighbors] - normals[:, None]) * (positions[neighbors] - positions[:, None])).sum(2)
    turn = np.where(bend < 0, CREASE_FACTOR * turn, turn)  # negative: the normals turn towards each other
    place = distances**2 / (2 * (DISTANCE_DEVIATION * spacing) ** 2)
    weights = np.exp(-turn - place) * (PATTERN + (1 - PATTERN) * np.exp(-color)) + MIN_WEIGHT
    rows = np.repeat(np.arange(len(positions)), neighbors.shape[1])
    graph = sparse.csr_matrix((weights.ravel(), (rows, neighbors.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T).tocsr()


def conjugate_gradients(
    product: Callable[[np.ndarray], np.ndarray], diagonal: np.ndarray, right: np.ndarray, x: np.ndarray
) -> np.ndarray:
    """Solve A x = b for several right-hand sides [p, c] at once, preconditioned with the diagonal of A.

    product: maps [p, c] to A times it; A is positive definite. x: initial guess. Warns if it has not converged after
    MAX_STEPS iterations. (SciPy's solvers take one right-hand side at a time.)
    """
    inverse = 1 / diagonal[:, None]
    x, residual = x.copy(), right - product(x)
    scaled = residual * inverse
    direction = scaled.copy()
    energy = _dots(residual, scaled)
    goal = TOLERANCE * np.sqrt(_dots(right, right))
    for _ in range(MAX_STEPS):
        if (np.sqrt(_dots(residual, residual)) <= goal).all():
            break
        image = product(direction)
        length = energy / np.maximum(_dots(direction, image), 1e-30)
        x += length * direction
        image *= length
        residual -= image
        np.multiply(residual, inverse, out=scaled)
        new_energy = _dots(residual, scaled)
        direction *= new_energy / np.maximum(energy, 1e-30)
        direction += scaled
        energy = new_energy
    left = np.sqrt(_dots(residual, residual))
    if (left > goal).any():
        norms = np.sqrt(_dots(right, right))
        warn_not_converged(MAX_STEPS, float((left / np.maximum(norms, np.finfo(float).tiny)).max()), TOLERANCE)
    return x


def _dots(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return the scalar products [c] of columns [p, c] without a temporary array."""
    return np.einsum("pc,pc->c", a, b)
