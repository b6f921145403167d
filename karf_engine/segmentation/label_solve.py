"""Coarse masks to clean labels on surface points: a graph of neighbors, color mixtures, and one linear solve a round.

Classes: 0 is the background, 1..K the objects. Points [p], probabilities `x` [p, K+1] that sum to one.
Seeds: what the masks say of a point, `seed_targets` y [p, K+1] with `seed_confidence` c [p].

    (D + C + eps) x - lambda W x = C y + eps / (K+1)         W: neighbor weights, D: their row sums

Then, a few rounds: color mixtures of the classes as they stand -> a color label for every point -> solve again with it.
What keeps that from running away:

- an object whose look-alikes among the seeds are mostly not marked as it has no say (guard), and color decides between
  two classes only as far as both guards allow; the background's guard is always open;
- a seed whose color clearly contradicts it has no say; where that color is the background's, neither has it;
- mixtures are drawn anew in each round, and the mean of what they have said so far counts;
- a color seen in no class says nothing;
- an object's colors fade with the distance to its seeds, and in the end only parts connected to its seeds remain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from .mixtures import class_log_densities

NEIGHBORS = 12
SMOOTHNESS = 20.0
PATTERN = 0.02  # what stays of a weight across a color edge: a smooth surface with a pattern is one thing
CONCAVE = 3.0  # so much more an inward turn of the normals separates: where things touch there is a crease
PRIOR = 1e-4
UNKNOWN_LOG_DENSITY = -15.5
RARE_BACKGROUND = 0.25  # the background's density falls with this power of its mass, where it has less than the objects
DECIDED = 0.6  # votes below this leave the class of a seed open
HOME = 2.0  # an object's colors fade beyond this many seed radii
REACH = 4.0  # points farther than this many seed radii from every object are background without a solve


@dataclass(frozen=True)
class Labels:
    """probabilities [p, K+1]; precision [K]: of the seeds that look like an object, the share that is marked as it."""

    probabilities: np.ndarray
    precision: np.ndarray

    @property
    def classes(self) -> np.ndarray:
        """Most likely class of each point, [p] int."""
        return self.probabilities.argmax(1)


def neighbor_graph(positions: np.ndarray, lab: np.ndarray, normals: np.ndarray, grain: float) -> sparse.csr_matrix:
    """Symmetric weights between the NEIGHBORS nearest points, near 1 where color, normal and place agree.

    A crease (the normals turn towards each other) separates CONCAVE times as much as an edge: things touch in creases.
    positions (grid coordinates), normals, lab: [p, 3]. grain: of the points.
    """
    # the balanced build has crashed beside torch on real data; this one has not
    tree = cKDTree(positions, balanced_tree=False, compact_nodes=False)
    distances, neighbors = tree.query(positions, k=range(1, min(NEIGHBORS + 1, len(positions)) + 1))
    distances, neighbors = distances[:, 1:], neighbors[:, 1:]
    color = ((lab[neighbors] - lab[:, None]) ** 2).sum(2) / (2 * 8.0**2)
    turn = (1 - (normals[neighbors] * normals[:, None]).sum(2)) / (2 * 0.15)
    # negative where the normals turn towards each other
    bend = ((normals[neighbors] - normals[:, None]) * (positions[neighbors] - positions[:, None])).sum(2)
    turn = np.where(bend < 0, CONCAVE * turn, turn)
    place = distances**2 / (2 * (4 * grain) ** 2)
    weights = np.exp(-turn - place) * (PATTERN + (1 - PATTERN) * np.exp(-color)) + 1e-6
    rows = np.repeat(np.arange(len(positions)), neighbors.shape[1])
    graph = sparse.csr_matrix((weights.ravel(), (rows, neighbors.ravel())), shape=(len(positions),) * 2)
    return graph.maximum(graph.T).tocsr()


def solve_labels(
    positions: np.ndarray,
    lab: np.ndarray,
    normals: np.ndarray,
    grain: float,
    seed_targets: np.ndarray,
    seed_confidence: np.ndarray,
    rounds: int,
    random: np.random.Generator,
) -> Labels:
    """Clean labels for all points. seed_targets: [p, K+1], rows sum to 1; seed_confidence: [p] >= 0, 0 = no seed.

    positions (grid coordinates), lab, normals: [p, 3]. grain: how fine the points are, see SurfacePoints. Each object
    must have seeds (see `has_seeds`).
    """
    n_classes = seed_targets.shape[1]
    trees, radii = _seed_regions(positions, grain, seed_targets, seed_confidence)
    distance = np.stack([tree.query(positions)[0] for tree in trees], 1)  # [p, K]
    near = (distance < REACH * radii).any(1)
    solver = _Solver(
        positions[near],
        lab[near],
        neighbor_graph(positions[near], lab[near], normals[near], grain),
        seed_targets[near],
        seed_confidence[near],
        4.5 * np.maximum(0, distance[near] / (HOME * radii) - 1) ** 2,
        random,
    )
    near_probabilities, precision = solver.run(rounds)
    probabilities = np.zeros((len(positions), n_classes))
    probabilities[:, 0] = 1
    probabilities[near] = near_probabilities
    return Labels(probabilities, precision)


def has_seeds(seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """Whether any point stands for each object, [K] bool; arguments as for `solve_labels`."""
    objects = range(1, seed_targets.shape[1])
    return np.array([_seeds_of(k, seed_targets, seed_confidence).any() for k in objects])


def _seeds_of(k: int, seed_targets: np.ndarray, seed_confidence: np.ndarray) -> np.ndarray:
    """True for the confident seeds of class k, [p]."""
    strength = seed_confidence * seed_targets[:, k]
    firm = np.maximum(0.25 * strength.max(initial=0), np.finfo(float).tiny)  # no confidence is no seed
    return (seed_targets[:, k] > 0.5) & (strength >= firm)


def _seed_regions(positions, grain, seed_targets, seed_confidence) -> tuple[list[cKDTree], np.ndarray]:
    """For each object a search tree of its confident seeds, and their RMS radius, at least a grain: one may be all."""
    trees, radii = [], []
    for k in range(1, seed_targets.shape[1]):
        seeds = positions[_seeds_of(k, seed_targets, seed_confidence)]
        trees.append(cKDTree(seeds, balanced_tree=False, compact_nodes=False))
        radii.append(np.sqrt(((seeds - seeds.mean(0)) ** 2).sum(1).mean()) + 1e-9)
    return trees, np.maximum(radii, grain)


@dataclass(frozen=True)
class _Solver:
    positions: np.ndarray
    lab: np.ndarray
    graph: sparse.csr_matrix
    seed_targets: np.ndarray
    seed_confidence: np.ndarray
    distance_penalty: np.ndarray  # [p, K], taken off the objects' log densities
    random: np.random.Generator

    def run(self, rounds: int) -> tuple[np.ndarray, np.ndarray]:
        targets, confidence = self.seed_targets, self.seed_confidence
        x = self._smooth(targets, confidence, None)
        mixture_weight = confidence
        precision = np.ones(targets.shape[1] - 1)
        p = np.zeros_like(x)
        for number in range(rounds):
            # the mean: single rounds sway with the mixtures' draw
            p = (number * p + self._color_labels(x, mixture_weight)) / (number + 1)
            guards, precision = self._guards(p)
            trust = self._seed_trust(p, guards)
            trusted = confidence * trust
            # what the background claims no guard has examined: it does not speak against a mark
            color_confidence = self._color_confidence(p, x, guards) * np.where(p.argmax(1) == 0, trust, 1)
            together = trusted + color_confidence
            chosen = _choose(targets, p)
            mixed = (trusted[:, None] * chosen + color_confidence[:, None] * p) / np.maximum(together, 1e-12)[:, None]
            x = self._smooth(mixed, together, x)
            mixture_weight = np.maximum(trusted, 0.1 * color_confidence)
        return self._connected(x), precision

    def _smooth(self, targets: np.ndarray, confidence: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """Solve the linear system for all classes; they sum to one by themselves."""
        n_classes = targets.shape[1]
        row_sums = np.asarray(self.graph.sum(1)).ravel()
        diagonal = SMOOTHNESS * row_sums + confidence + PRIOR
        right = confidence[:, None] * targets + PRIOR / n_classes
        x = np.full_like(targets, 1 / n_classes) if start is None else start
        x = _conjugate_gradients(lambda v: diagonal[:, None] * v - SMOOTHNESS * (self.graph @ v), diagonal, right, x)
        x = np.clip(x, 0, None)
        return x / np.maximum(x.sum(1, keepdims=True), 1e-12)

    def _color_labels(self, x: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """What each point's color (and its distance to the objects) says of its class, [p, K+1]."""
        top_two = np.sort(x, 1)[:, -2:]
        sure = weight * (top_two[:, 1] - top_two[:, 0])
        strengths = sure[:, None] * np.eye(x.shape[1])[x.argmax(1)]
        log_density = class_log_densities(self.lab, strengths, self.random)
        mass = strengths.sum(0)
        # before an empty background most of its seeds are what the masks left out of the objects
        log_density[:, 0] += RARE_BACKGROUND * np.log(np.clip(mass[0] / max(mass[1:].sum(), 1e-12), 1e-12, 1))
        log_density[:, 1:] -= self.distance_penalty
        density = np.exp(np.maximum(log_density, -700))
        unknown = np.exp(UNKNOWN_LOG_DENSITY)
        return (density + unknown / x.shape[1]) / (density.sum(1, keepdims=True) + unknown)

    def _guards(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How far each class may be trusted on color, [K+1], and the objects' precision, [K].

        The background is always trusted: a mask that spills over much of it must not silence it.
        """
        called = p.argmax(1)
        decided = self.seed_confidence * (self.seed_targets.max(1) > DECIDED)
        share = np.ones(p.shape[1])
        for k in range(1, p.shape[1]):
            weight = decided * (called == k)
            share[k] = (weight * self.seed_targets[:, k]).sum() / max(weight.sum(), 1e-12)
        return np.clip((share - 0.5) / 0.2, 0, 1), share[1:]

    def _color_confidence(self, p: np.ndarray, x: np.ndarray, guards: np.ndarray) -> np.ndarray:
        """How firmly color speaks: as far as its two likeliest classes and the one where the point stands are trusted.

        Were it the winner alone, the background would gain ground on an object that may not answer.
        """
        second, first = np.argsort(p, 1)[:, -2:].T
        rows = np.arange(len(p))
        allowed = np.minimum.reduce([guards[first], guards[second], guards[x.argmax(1)]])
        return 2 * allowed * (p[rows, first] - p[rows, second])

    def _seed_trust(self, p: np.ndarray, guards: np.ndarray) -> np.ndarray:
        """Factor on the seeds' confidence: seeds whose color speaks clearly against them lose their say.

        1 where there is no seed.
        """
        label = self.seed_targets.argmax(1)
        agreement = (self.seed_targets * p).sum(1) / np.maximum(self.seed_targets.max(1), 1e-12)
        allowed = np.minimum(guards[label], guards[p.argmax(1)])
        contradiction = allowed * np.clip(2 * (1 - agreement) - 1, 0, 1)
        return np.where(self.seed_confidence > 0, (1 - contradiction) ** 2, 1)

    def _connected(self, x: np.ndarray) -> np.ndarray:
        """Move parts of an object that are not connected to its seeds to the next likely class."""
        x = x.copy()
        edges = self.graph.tocoo()
        strong = edges.data > 1e-5
        rows, columns = edges.row[strong], edges.col[strong]
        for _ in range(x.shape[1]):
            label = x.argmax(1)
            same = label[rows] == label[columns]
            part_graph = sparse.coo_matrix((np.ones(same.sum()), (rows[same], columns[same])), shape=self.graph.shape)
            _, part = connected_components(part_graph, directed=False)
            strength = self.seed_confidence * self.seed_targets[np.arange(len(label)), label]
            anchored = np.bincount(part, strength * (strength > 0.1), part.max() + 1) > 0
            loose = ~anchored[part] & (label > 0)
            if not loose.any():
                break
            x[loose, label[loose]] = 0
            x[loose, 0] += 1e-6
            x /= x.sum(1, keepdims=True)
        return x


def _choose(targets: np.ndarray, p: np.ndarray) -> np.ndarray:
    """Votes that are split between classes, shared out as the colors say, [p, K+1]: "not this object" is no more."""
    chosen = targets * np.maximum(p, 1e-3)
    return chosen / chosen.sum(1, keepdims=True)


def _conjugate_gradients(product, diagonal: np.ndarray, right: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Solve A x = b for several right-hand sides at once, A positive definite, with the diagonal as preconditioner."""
    residual = right - product(x)
    scaled = residual / diagonal[:, None]
    direction = scaled
    energy = (residual * scaled).sum(0)
    goal = 1e-4 * np.sqrt((right**2).sum(0))
    for _ in range(150):
        if (np.sqrt((residual**2).sum(0)) <= goal).all():
            break
        image = product(direction)
        length = energy / np.maximum((direction * image).sum(0), 1e-30)
        x = x + length * direction
        residual = residual - length * image
        scaled = residual / diagonal[:, None]
        new_energy = (residual * scaled).sum(0)
        direction = scaled + new_energy / np.maximum(energy, 1e-30) * direction
        energy = new_energy
    return x
