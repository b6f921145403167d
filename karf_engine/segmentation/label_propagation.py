"""Label propagation: coarse labels of some surface points become clean labels of all, by neighbors and colors.

Classes: 0 is the background, 1..K the objects. Points [p], probabilities `x` [p, K+1] that sum to one.
Seeds are points that the masks say something of: `seed_targets` y [p, K+1] with `seed_confidence` c [p].
The probabilities minimize a sum of unary terms (be as the seeds say; a weak prior for no class in particular) and of
pairwise terms (be as your neighbors are), which is one linear system:

    (D + C + eps) x - lambda W x = C y + eps / (K+1)         W: neighbor weights, D: lambda times their row sums

What is thin or small has few seeds and many ties to what surrounds it. There all unary terms, C, count more, by a seed
weight with which the seeds keep their labels.

A few rounds follow. In each, mixtures of Gaussians in Lab are fitted to the colors of the classes as they are, each
point gets a color label from them, and the system is solved again with these labels as a second unary term. This is
kept from running away:

- The color of an object has no influence where most of the seeds that look like the object were not drawn as it: its
  reliability is 0. That is asked of the whole scene and of what is near a point, and the better answer counts: a twin far
  away does not make a color useless here, nor a missing chunk of a mask one that tells the object elsewhere. Color
  decides between two classes only as far as both are reliable. The background always is.
- What masks and colors say alike of a point counts many times: it is seldom mistaken.
- A seed that its color clearly contradicts is ignored; where that color is the background's, so is the color.
- Mixtures are fitted where masks say something, never where only colors did.
- They are drawn anew in each round, and the mean of their labels so far counts.
- A color that no class has gives even labels.
- An object's colors fade with the distance to its seeds, and in the end only parts connected to its seeds remain.

In the end patches in doubt follow what surrounds them: the system is solved once more with the labels themselves as
unary terms, as sure as their margins. A point that would change alone stays: that is how thin ends and rims erode. So does one of
which masks and colors say the same.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from .gaussian_mixtures import class_log_densities
from .nearby import share_nearby
from .neighbor_graph import conjugate_gradients, neighbor_graph
from .point_labels import Labels, margin
from .seeds import seed_regions, seeds_of


@dataclass(frozen=True)
class PropagationParameters:
    """What decides the labels. docs/method.md (label propagation) says what was tried with them, and on which scenes.

    Attributes:
        smoothness: Lambda, weight of the pairwise terms. 5, 10 and 20 were measured on drawn seeds 0 to 7 and the demo: less of
            it gained on the first (0.776, 0.774, 0.768 of IoU) and lost on the demo (0.937, 0.950, 0.960), whose mug got holes.
        uniform_prior: Eps, weight of the prior for no class in particular. Not varied on record.
        unknown_log_density: Of a color that belongs to no class, natural logarithm. Not varied on record.
        rare_background: The background's density falls with this power of its mass, where it has less than the objects.
            Not varied on record.
        decided: A seed's largest vote; with less its class is open. Not varied on record.
        seed_consistency: Share of an object's seeds that must keep its label; set on a plant of 200 points, raised from
            0.9 for things as small.
        most_doublings: The seed weight doubles this many times at most. Not varied on record.
        fade_radii: An object's colors fade beyond this many seed radii. Not varied on record.
        fade_strength: Taken off the log density at twice that distance. Not varied on record.
        patch_confidence: Of labels without a doubt, as patches follow what surrounds them. Not varied on record.
        least_patch_confidence: Of labels in full doubt, likewise. Not varied on record.
        agreed: Masks and colors agree on a point where both say the same, and the masks' confidence times the margin of its
            color label is more. It is in no patch then. Not varied on record.
        agreed_weight: How many times more such a point's color label counts. 0, 3, 10 and 20 were measured on drawn seeds 0 to
            7, thin scenes 0 and 1 and the demo (IoU on the drawn ones 0.780, 0.780, 0.784, 0.786; thin 1 0.686, 0.697, 0.704,
            0.706; demo 0.957, 0.950, 0.958, 0.961).
        most_of_object: Share of an object's points; a larger part of it is not a patch: small objects were taken whole.
        together: Share of the ties of a point that changes, that lead to others that do. Set on a scene seen from the
            front alone, where thin ends and rims eroded.
        reach_radii: Points farther than this many seed radii from every object are background without being solved for.
            Not varied on record.
        unreliable: Share of the seeds of an object's color that are its own, up to which the color has no influence. Not
            varied on record.
        reliable_range: Further share, after which its influence is whole. Not varied on record.
        nearby_radii: How far near is when that share is taken near a point, seed radii of the object. 0.5 and 1 were measured
            on the same scenes: IoU 0.780 and 0.775 on the drawn ones, 0.774 without.
        nearby_prior: Points' worth of votes that the whole scene's share has against those near a point. Not varied on record.
        least_anchor: Votes of a point that can hold its part of an object. Not varied on record.
        least_tie: Weight of the graph that joins two points of a part. Not varied on record.
        least_color_share: Of each class when open votes are shared out by color. Not varied on record.
    """

    smoothness: float = 20.0
    uniform_prior: float = 1e-4
    unknown_log_density: float = -15.5
    rare_background: float = 0.25
    decided: float = 0.6
    seed_consistency: float = 0.98
    most_doublings: int = 6
    fade_radii: float = 2.0
    fade_strength: float = 4.5
    patch_confidence: float = 5.0
    least_patch_confidence: float = 0.02
    agreed: float = 0.3
    agreed_weight: float = 20.0
    most_of_object: float = 0.1
    together: float = 0.5
    reach_radii: float = 4.0
    unreliable: float = 0.5
    reliable_range: float = 0.2
    nearby_radii: float = 0.5
    nearby_prior: float = 5.0
    least_anchor: float = 0.1
    least_tie: float = 1e-5
    least_color_share: float = 1e-3


PARAMETERS = PropagationParameters()


def propagate_labels(
    positions: np.ndarray,
    lab: np.ndarray,
    normals: np.ndarray,
    spacing: float,
    seed_targets: np.ndarray,
    seed_confidence: np.ndarray,
    rounds: int,
    random: np.random.Generator,
) -> Labels:
    """Label all points from the seeds among them. An object without any (see `has_seeds`) gets no point.

    Args:
        positions: [p, 3] grid coordinates.
        lab: [p, 3] CIE Lab.
        normals: [p, 3] of unit length, outward.
        spacing: how fine the points are, see `SurfacePoints`.
        seed_targets: [p, K+1]; rows sum to 1.
        seed_confidence: [p] >= 0; 0 where there is no seed.
        rounds: in which colors are learned, at least 1.
        random: draws the colors that mixtures are fitted to.
    """
    n_classes = seed_targets.shape[1]
    trees, radii = seed_regions(positions, spacing, seed_targets, seed_confidence)
    distance = np.stack([tree.query(positions)[0] for tree in trees], 1)  # [p, K]
    near = (distance < PARAMETERS.reach_radii * radii).any(1)
    propagation = _Propagation(
        positions[near],
        lab[near],
        neighbor_graph(positions[near], lab[near], normals[near], spacing),
        seed_targets[near],
        seed_confidence[near],
        PARAMETERS.fade_strength * np.maximum(0, distance[near] / (PARAMETERS.fade_radii * radii) - 1) ** 2,
        radii,
        random,
    )
    solved = propagation.run(rounds)
    probabilities, opinion = (np.tile(np.eye(n_classes)[0], (len(positions), 1)) for _ in range(2))
    probabilities[near], opinion[near] = solved.probabilities, solved.opinion
    return Labels(probabilities, solved.precision, opinion)


@dataclass(frozen=True)
class _Propagation:
    """The points near the objects, and what is known of them before the first round.

    positions [p, 3] grid coordinates; lab [p, 3]; graph [p, p] of neighbor weights; seed_targets [p, K+1]; seed_confidence
    [p]; distance_penalty [p, K], taken off the objects' log densities; radii [K] of the objects' seeds, grid coordinates.
    """

    positions: np.ndarray
    lab: np.ndarray
    graph: sparse.csr_matrix
    seed_targets: np.ndarray
    seed_confidence: np.ndarray
    distance_penalty: np.ndarray
    radii: np.ndarray
    random: np.random.Generator

    def run(self, rounds: int) -> Labels:
        """Labels of the points."""
        targets, confidence = self.seed_targets, self.seed_confidence
        of_masks, seed_weight = self._seed_weight()
        x = of_masks
        mixture_weight = confidence
        precision = np.ones(targets.shape[1] - 1)
        color_labels = np.zeros_like(x)
        for number in range(rounds):
            # the mean: single rounds sway with the mixtures' draw
            color_labels = (number * color_labels + self._color_labels(x, mixture_weight)) / (number + 1)
            reliability, precision = self._color_reliability(color_labels)
            seed_reliability = self._seed_reliability(color_labels, reliability)
            reliable = confidence * seed_reliability
            # the background's colors count as reliable untested: where they contradict a seed they are ignored as well
            untested = np.where(color_labels.argmax(1) == 0, seed_reliability, 1)
            color_confidence = self._color_confidence(color_labels, x, reliability) * untested
            together = reliable + color_confidence
            shared = _share_open_votes(targets, color_labels)
            unary = reliable[:, None] * shared + color_confidence[:, None] * color_labels
            x = self._smooth(unary / np.maximum(together, 1e-12)[:, None], seed_weight * together, x)
            # not where colors said it: they would confirm themselves, and a neighbor of nearly the object's hue be lost to it
            mixture_weight = reliable
        agreed = self._agreed(color_labels, reliability)
        x = self._connected(self._with_patches(self._connected(x), seed_weight, agreed))
        return Labels(x, precision, (of_masks + color_labels + x) / 3)

    def _seed_weight(self) -> tuple[np.ndarray, np.ndarray]:
        """The first solution, [p, K+1], and the factor on all unary terms with which seeds keep their labels there, [p]."""
        n_objects = self.seed_targets.shape[1] - 1
        numbers = np.arange(1, n_objects + 1)
        own = np.stack([seeds_of(k, self.seed_targets, self.seed_confidence) for k in numbers], 1)
        factors = np.ones(n_objects)
        for doublings in range(PARAMETERS.most_doublings + 1):
            seed_weight = np.where(self.distance_penalty > 0, 1, factors).max(1)
            x = self._smooth(self.seed_targets, seed_weight * self.seed_confidence, None)
            is_consistent = (own & (x.argmax(1)[:, None] == numbers)).sum(0) >= PARAMETERS.seed_consistency * own.sum(0)
            if is_consistent.all() or doublings == PARAMETERS.most_doublings:
                break
            factors = np.where(is_consistent, factors, 2 * factors)
        return x, seed_weight

    def _smooth(self, targets: np.ndarray, confidence: np.ndarray, start: np.ndarray | None) -> np.ndarray:
        """Solve the linear system for all classes; they sum to one by themselves."""
        n_classes = targets.shape[1]
        row_sums = np.asarray(self.graph.sum(1)).ravel()
        diagonal = PARAMETERS.smoothness * row_sums + confidence + PARAMETERS.uniform_prior
        right = confidence[:, None] * targets + PARAMETERS.uniform_prior / n_classes
        x = np.full_like(targets, 1 / n_classes) if start is None else start
        x = conjugate_gradients(
            lambda v: diagonal[:, None] * v - PARAMETERS.smoothness * (self.graph @ v), diagonal, right, x
        )
        x = np.clip(x, 0, None)
        return x / np.maximum(x.sum(1, keepdims=True), 1e-12)

    def _color_labels(self, x: np.ndarray, weight: np.ndarray) -> np.ndarray:
        """Class probabilities by each point's color and its distance to the objects, [p, K+1]."""
        strengths = (weight * margin(x))[:, None] * np.eye(x.shape[1])[x.argmax(1)]
        log_density = class_log_densities(self.lab, strengths, self.random)
        mass = strengths.sum(0)
        # before an empty background most of its seeds are what the masks left out of the objects
        log_density[:, 0] += PARAMETERS.rare_background * np.log(
            np.clip(mass[0] / max(mass[1:].sum(), 1e-12), 1e-12, 1)
        )
        log_density[:, 1:] -= self.distance_penalty
        density = np.exp(np.maximum(log_density, -700))
        unknown = np.exp(PARAMETERS.unknown_log_density)
        return (density + unknown / x.shape[1]) / (density.sum(1, keepdims=True) + unknown)

    def _color_reliability(self, color_labels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """How reliable the color labels of each class are at each point, [p, K+1] in [0, 1], and the objects' precision, [K].

        The background's are always: a mask that spills over much of it must not take away its influence.
        """
        predicted = color_labels.argmax(1)
        decided = self.seed_confidence * (self.seed_targets.max(1) > PARAMETERS.decided)
        share, precision = np.ones_like(color_labels), np.ones(len(self.radii))
        for k, radius in enumerate(self.radii, 1):
            weight = decided * (predicted == k)
            own = weight * self.seed_targets[:, k]
            precision[k - 1] = whole = own.sum() / max(weight.sum(), 1e-12)
            reach = PARAMETERS.nearby_radii * radius
            nearby = share_nearby(self.positions, weight, own, reach, whole, PARAMETERS.nearby_prior)
            share[:, k] = np.maximum(whole, nearby)
        return np.clip((share - PARAMETERS.unreliable) / PARAMETERS.reliable_range, 0, 1), precision

    def _color_confidence(self, color_labels: np.ndarray, x: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """Confidence of the color labels, [p]: their margin, times the least reliability of three classes.

        These are the two likeliest by color and the one that the point has now. Were it the likeliest alone, the
        background would gain ground on an object whose own colors have no influence. Where the masks say the same, it is more.
        """
        second, first = np.argsort(color_labels, 1)[:, -2:].T
        rows = np.arange(len(color_labels))
        least = np.minimum.reduce([reliability[rows, each] for each in (first, second, x.argmax(1))])
        more = 1 + PARAMETERS.agreed_weight * self._agreed(color_labels, reliability)
        return 2 * more * least * (color_labels[rows, first] - color_labels[rows, second])

    def _seed_reliability(self, color_labels: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """Factor on the seeds' confidence, [p] in [0, 1]: low where color clearly contradicts it; 1 without a seed."""
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
            strength = self.seed_confidence * self.seed_targets[np.arange(len(label)), label]
            anchored = np.bincount(part, strength * (strength > PARAMETERS.least_anchor), part.max() + 1) > 0
            loose = ~anchored[part] & (label > 0)
            if not loose.any():
                break
            x[loose, label[loose]] = 0
            x[loose, 0] += 1e-6
            x /= x.sum(1, keepdims=True)
        return x

    def _agreed(self, color_labels: np.ndarray, reliability: np.ndarray) -> np.ndarray:
        """True for the points of which masks and colors say the same, [p]."""
        label, rows = color_labels.argmax(1), np.arange(len(color_labels))
        vote = self.seed_targets[rows, label]
        sure = np.minimum(self.seed_confidence, 1) * reliability[rows, label] * margin(color_labels)
        return (vote > PARAMETERS.decided) & (sure > PARAMETERS.agreed)

    def _with_patches(self, x: np.ndarray, seed_weight: np.ndarray, agreed: np.ndarray) -> np.ndarray:
        """Let patches in doubt follow what surrounds them; all other points, and those `agreed` on, are as they were."""
        solved = self._smooth(
            x, seed_weight * (PARAMETERS.least_patch_confidence + PARAMETERS.patch_confidence * margin(x)), x
        )
        before, after = x.argmax(1), solved.argmax(1)
        changed = (before != after) & (before * after == 0) & ~agreed  # only the background's colors counted untested
        together = changed & (self.graph @ changed >= PARAMETERS.together * np.asarray(self.graph.sum(1)).ravel())
        patch = self._parts(np.where(together, before, -1))
        is_small = np.bincount(patch)[patch] <= PARAMETERS.most_of_object * np.bincount(before)[before]
        return np.where((together & ((before == 0) | is_small))[:, None], solved, x)

    def _parts(self, label: np.ndarray) -> np.ndarray:
        """Number of the connected part of equal labels that each point belongs to, [p]."""
        edges = self.graph.tocoo()
        same = (edges.data > PARAMETERS.least_tie) & (label[edges.row] == label[edges.col])
        tied = sparse.coo_matrix((np.ones(same.sum()), (edges.row[same], edges.col[same])), shape=self.graph.shape)
        return connected_components(tied, directed=False)[1]


def _share_open_votes(targets: np.ndarray, color_labels: np.ndarray) -> np.ndarray:
    """Votes that leave several classes open ("not this object" is no more), shared out by color, [p, K+1]."""
    shared = targets * np.maximum(color_labels, PARAMETERS.least_color_share)
    return shared / shared.sum(1, keepdims=True)
